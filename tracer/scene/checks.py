"""Checks of the scenes, cameras, G-buffers and frames that functions of the tracer are given."""

from __future__ import annotations

import warnings
from typing import Any

import torch
from torch import Tensor

from gbufrt import Frame, GBuffer
from gbufrt.demands.pictures import check_camera
from gbufrt.numeric import check_kind
from tracer.scene.scene import Scene
from tracer.scene.view import View


def check_is_scene(scene: Any) -> None:
    """Raise TypeError unless it is a scene."""
    check_kind(Scene, "scene", scene, "; tracer.load(name) gives one")


def check_scene(scene: Any) -> None:
    """Raise TypeError unless it is a scene, and ValueError where it shows nothing."""
    check_is_scene(scene)
    if scene.empty:
        raise ValueError("the world has no voxels, so there is nothing to see; fill it, or load another")


def check_seen_by(scene: Scene, camera: Any, name: str = "camera") -> None:
    """Raise TypeError unless it is a camera: of a view, or its name, tell how it becomes one."""
    view = camera if isinstance(camera, str) and camera in scene.views else next(iter(scene.views), None)
    which = "view" if isinstance(camera, View) or view is None else f"scene.views[{view!r}]"
    check_camera(camera, name, f"; {which}.camera(time=0.0, size=(540, 960)) gives one")


def check_shown(scene: Any, gbuffer: Any) -> None:
    """Raise TypeError unless they are a scene and a G-buffer."""
    check_is_scene(scene)
    frame = "; frame.gbuffer is one" if isinstance(gbuffer, Frame) else ""
    check_kind(GBuffer, "gbuffer", gbuffer, frame or "; tracer.gbuffer(scene, camera) gives one")


def check_frame_of(scene: Any, frame: Any, before: Any = None) -> None:
    """Raise TypeError unless they are a scene, a frame, and the frame before or None."""
    check_is_scene(scene)
    remedy = "; tracer.render(scene, camera) gives one"
    check_kind(Frame, "frame", frame, remedy)
    if before is not None:
        check_kind(Frame, "before", before, remedy)


def check_mask(name: str, mask: Any, like: Tensor | None = None) -> None:
    """Raise unless a mask is ``(B, 1, H, W)`` of bool, and of the size of another one.

    Raises:
        TypeError: no tensor, or of other numbers.
        ValueError: another shape.
    """
    check_kind(Tensor, name, mask)
    if mask.dtype != torch.bool:
        raise TypeError(f"{name} must be bool, got {str(mask.dtype).removeprefix('torch.')}; compare it: {name} > 0")
    fits = mask.ndim == 4 and mask.shape[1] == 1 if like is None else mask.shape == like.shape
    if not fits:
        wanted = "(B,1,H,W)" if like is None else tuple(like.shape)
        raise ValueError(f"{name} must be {wanted}, got {tuple(mask.shape)}")


def check_open(scene: Any) -> None:
    """Raise TypeError unless it is a scene, or a stream of a world, which has a sky too."""
    if not hasattr(scene, "haze"):
        check_is_scene(scene)


def keeps_its_light(scene: Any, what: str) -> bool:
    """Whether a scene's sky knows no day; warns that it knows nothing of ``what`` then."""
    if scene.sky.dayless:
        told = f"the world keeps its own light: the Nether and the End have no day, and know no {what}"
        warnings.warn(told, stacklevel=3)  # where the scene is given
    return scene.sky.dayless
