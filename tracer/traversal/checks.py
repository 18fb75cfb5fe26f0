"""Checks of the rays that functions of the tracer are given."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from gbufrt.numeric import check_kind, check_numbers
from tracer.scene.checks import check_is_scene
from tracer.scene.scene import Scene
from tracer.traversal.hits import Hits


def check_rays(scene: Scene, origins: Any, directions: Any, poses: Any) -> None:
    """Raise unless rays are ``(..., 3)`` of floats where the scene is, and the poses a tensor or None.

    Raises:
        TypeError: neither a scene nor tensors, or tensors of other numbers than floats.
        ValueError: shapes or devices do not fit.
    """
    check_is_scene(scene)
    for name, tensor in (("origins", origins), ("directions", directions)):
        check_kind(Tensor, name, tensor)
        if not tensor.is_floating_point():
            kind = str(tensor.dtype).removeprefix("torch.")
            raise TypeError(f"{name} must be float32 or float64, got {kind}; convert it with .float()")
    if poses is not None:
        check_kind(Tensor, "poses", poses, "; scene.poses([time]) gives them")
    if origins.shape != directions.shape or origins.ndim < 1 or origins.shape[-1] != 3:
        raise ValueError(
            f"origins and directions must both be (...,3), got {tuple(origins.shape)} and {tuple(directions.shape)}"
        )
    for name, tensor in (("origins", origins), ("directions", directions)):
        if tensor.device != scene.device:
            raise ValueError(f"{name} is on {tensor.device} but scene is on {scene.device}; move one with .to()")


def check_ends(shape: tuple[int, ...], **ends: Any) -> None:
    """Raise unless ends of rays of a ``shape``, by name, are numbers, or tensors that spread to that shape.

    Raises:
        TypeError: neither.
        ValueError: a tensor of another shape.
    """
    for name, end in ends.items():
        if not isinstance(end, Tensor):
            check_numbers(**{name: end})
            continue
        trailing = shape[len(shape) - end.ndim :] if end.ndim <= len(shape) else None
        if trailing is None or any(n not in (1, wanted) for n, wanted in zip(end.shape, trailing, strict=True)):
            wanted = f"{name} must be a number, or {shape} for rays {(*shape, 3)}"
            raise ValueError(f"{wanted}, got {tuple(end.shape)}")


def check_beyond(beyond: Any, shape: tuple[int, ...]) -> None:
    """Raise unless ``beyond`` is what rays of a ``shape`` hit before.

    Raises:
        TypeError: no `Hits`.
        ValueError: of another number of rays.
    """
    check_kind(Hits, "beyond", beyond, "; tracer.trace gave them for these rays")
    if tuple(beyond.t.shape) != shape:
        raise ValueError(f"beyond must be the hits of these rays, {shape}, got those of {tuple(beyond.t.shape)}")
