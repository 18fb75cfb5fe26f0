"""Paths: compiled on the CPU, the torch reference elsewhere."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from tracer.lights.samples import Lights
from tracer.paths import radiance as light_paths
from tracer.paths import shots
from tracer.paths.meet import FINE, Vertices
from tracer.paths.receivers import Receivers
from tracer.paths.seen import Picture
from tracer.sampling.progressive import Values
from tracer.scene.scene import Scene


def occlusion(scene: Scene, at: Receivers, start: Vertices, u: Tensor, radius: float) -> Values:
    """See `tracer.paths.shots.occlusion`."""
    return _form(u, shots).occlusion(scene, at, start, u, radius)


def indirect(scene: Scene, at: Receivers, start: Vertices, u: Tensor, bounces: int) -> Values:
    """See `tracer.paths.shots.indirect`."""
    return _form(u, shots).indirect(scene, at, start, u, bounces)


def reflected(scene: Scene, at: Receivers, start: Vertices, u: Tensor, sharp: float) -> Values:
    """See `tracer.paths.shots.reflected`."""
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
    """See `tracer.paths.radiance.radiance`."""
    first = {"t_min": t_min, "t_max": t_max, "detail": detail, "spreads": spreads}
    given = {"bounces": bounces, "poses": poses, "next_event": next_event, "picture": picture, "known": known}
    return _form(u, light_paths).radiance(scene, lights, origins, directions, u, **given, **first)


def _form(like: Tensor, reference: Any) -> Any:
    if not like.is_cpu:
        return reference
    from tracer.paths import drivers as path_drivers

    return path_drivers
