"""Paths: compiled on the CPU, the torch reference elsewhere."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from tracer import light_paths, shots
from tracer.light_samples import Lights
from tracer.paths import FINE, Vertices
from tracer.progressive import Values
from tracer.receivers import Receivers
from tracer.scene import Scene
from tracer.seen import Picture


def occlusion(scene: Scene, at: Receivers, start: Vertices, u: Tensor, radius: float) -> Values:
    """See `tracer.shots.occlusion`."""
    return _form(u, shots).occlusion(scene, at, start, u, radius)


def indirect(scene: Scene, at: Receivers, start: Vertices, u: Tensor, bounces: int) -> Values:
    """See `tracer.shots.indirect`."""
    return _form(u, shots).indirect(scene, at, start, u, bounces)


def reflected(scene: Scene, at: Receivers, start: Vertices, u: Tensor, sharp: float) -> Values:
    """See `tracer.shots.reflected`."""
    return _form(u, shots).reflected(scene, at, start, u, sharp)


def radiance(
    scene: Scene,
    lights: Lights,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    bounces: int,
    poses: Tensor,
    t_min: Tensor | float = 0.0,
    t_max: Tensor | float = float("inf"),
    detail: Tensor | float = FINE,
    spreads: bool = False,
    next_event: bool = True,
    picture: Picture | None = None,
    known: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """See `tracer.light_paths.radiance`."""
    first = {"t_min": t_min, "t_max": t_max, "detail": detail, "spreads": spreads}
    given = {"bounces": bounces, "poses": poses, "next_event": next_event, "picture": picture, "known": known}
    return _form(u, light_paths).radiance(scene, lights, origins, directions, u, **given, **first)


def _form(like: Tensor, reference: Any) -> Any:
    if not like.is_cpu:
        return reference
    from tracer import path_drivers

    return path_drivers
