"""Checks of the scenes, cameras, G-buffers and frames that functions of the tracer are given."""

from __future__ import annotations

import warnings
from typing import Any

from gbufrt import Frame, GBuffer
from gbufrt.demands.pictures import check_camera
from gbufrt.numeric import check_kind
from tracer.scene.scene import Scene, View


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


def check_frame_of(scene: Any, **frames: Any) -> None:
    """Raise TypeError unless they are a scene and frames, or None, by the names of their arguments."""
    check_is_scene(scene)
    for name, frame in frames.items():
        if frame is not None:
            check_kind(Frame, name, frame, "; tracer.render(scene, camera) gives one")


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
