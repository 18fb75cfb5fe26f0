"""Paths: compiled on the CPU and for CUDA, the torch reference elsewhere."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from tracer.lights.samples import Lights
from tracer.paths import integrators
from tracer.paths import radiance as path_radiance
from tracer.paths.interaction import FINE, Vertices
from tracer.paths.on_screen import Picture
from tracer.paths.receivers import Receivers
from tracer.sampling.progressive import Values
from tracer.scene.scene import Scene


def occlusion(scene: Scene, at: Receivers, start: Vertices, u: Tensor, radius: float) -> Values:
    """See `tracer.paths.integrators.occlusion`."""
    if form_of(u, cuda=True) is Form.REFERENCE:
        return integrators.occlusion(scene, at, start, u, radius)
    from tracer.paths import drivers

    return drivers.occlusion(scene, at, start, u, radius)


def indirect(scene: Scene, at: Receivers, start: Vertices, u: Tensor, bounces: int) -> Values:
    """See `tracer.paths.integrators.indirect`."""
    if form_of(u, cuda=True) is Form.REFERENCE:
        return integrators.indirect(scene, at, start, u, bounces)
    from tracer.paths import drivers

    return drivers.indirect(scene, at, start, u, bounces)


def lit(scene: Scene, at: Receivers, start: Vertices, u: Tensor) -> Values:
    """See `tracer.paths.integrators.lit`."""
    if form_of(u, cuda=True) is Form.REFERENCE:
        return integrators.lit(scene, at, start, u)
    from tracer.paths import drivers

    return drivers.lit(scene, at, start, u)


def reflected(scene: Scene, at: Receivers, start: Vertices, u: Tensor, sharp: float) -> Values:
    """See `tracer.paths.integrators.reflected`."""
    if form_of(u, cuda=True) is Form.REFERENCE:
        return integrators.reflected(scene, at, start, u, sharp)
    from tracer.paths import drivers

    return drivers.reflected(scene, at, start, u, sharp)


def lobes(scene: Scene, at: Receivers, start: Vertices, u: Tensor, bounces: int) -> Values:
    """See `tracer.paths.integrators.lobes`."""
    if form_of(u) is Form.REFERENCE:
        return integrators.lobes(scene, at, start, u, bounces)
    from tracer.paths import drivers

    return drivers.lobes(scene, at, start, u, bounces)


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
    first: dict[str, Any] = {"t_min": t_min, "t_max": t_max, "detail": detail, "spreads": spreads}
    given: dict[str, Any] = {
        "bounces": bounces,
        "poses": poses,
        "next_event": next_event,
        "picture": picture,
        "known": known,
    }
    if form_of(u, cuda=True) is Form.REFERENCE:
        return path_radiance.radiance(scene, lights, origins, directions, u, **given, **first)
    from tracer.paths import drivers

    return drivers.radiance(scene, lights, origins, directions, u, **given, **first)
