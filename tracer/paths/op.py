"""Paths: kernels on the CPU and on CUDA, the torch reference elsewhere.

Those from the surfaces of a picture take its M surfaces, which may be sent out changed as ``start``, and a sequence
whose points are numbers of paths from each. They return sums, see `tracer.paths.receivers.Sums`.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from tracer.lights.samples import Lights
from tracer.paths import integrators
from tracer.paths import radiance as path_radiance
from tracer.paths.interaction import FINE
from tracer.paths.memory import Memory
from tracer.paths.on_screen import Picture
from tracer.paths.receivers import Receivers, summed
from tracer.paths.surfaces.vertices import Vertices
from tracer.sampling.progressive import Values
from tracer.sampling.sequence import Sequence
from tracer.scene.scene import Scene


def occlusion(scene: Scene, at: Receivers, sequence: Sequence, radius: float) -> Values:
    """See `tracer.paths.integrators.occlusion`."""
    if _form(at.places, sequence) is Form.REFERENCE:
        return summed(partial(integrators.occlusion, scene, at, radius=radius), at, at.vertices, sequence)
    from tracer.paths import drivers

    return drivers.occlusion(scene, at, sequence, radius)


def indirect(scene: Scene, at: Receivers, start: Vertices, sequence: Sequence, bounces: int) -> Values:
    """See `tracer.paths.integrators.indirect`."""
    if _form(start.points, sequence) is Form.REFERENCE:
        return summed(partial(integrators.indirect, scene, at, bounces=bounces), at, start, sequence)
    from tracer.paths import drivers

    return drivers.indirect(scene, at, start, sequence, bounces)


def lit(scene: Scene, at: Receivers, start: Vertices, sequence: Sequence) -> Values:
    """See `tracer.paths.integrators.lit`."""
    if _form(start.points, sequence) is Form.REFERENCE:
        return summed(partial(integrators.lit, scene, at), at, start, sequence)
    from tracer.paths import drivers

    return drivers.lit(scene, at, start, sequence)


def reflected(scene: Scene, at: Receivers, start: Vertices, sequence: Sequence, sharp: float) -> Values:
    """See `tracer.paths.integrators.reflected`."""
    if _form(start.points, sequence) is Form.REFERENCE:
        return summed(partial(integrators.reflected, scene, at, sharp=sharp), at, start, sequence)
    from tracer.paths import drivers

    return drivers.reflected(scene, at, start, sequence, sharp)


def lobes(
    scene: Scene, at: Receivers, start: Vertices, sequence: Sequence, bounces: int, memory: Memory | None = None
) -> Values:
    """See `tracer.paths.integrators.lobes`; a ``memory`` takes a sequence of one point."""
    if _form(start.points, sequence) is Form.REFERENCE:
        if memory is None:
            return summed(partial(integrators.lobes, scene, at, bounces=bounces), at, start, sequence)
        numbers = sequence.draw(at.pixels)
        found = integrators.lobes(scene, at, start, numbers, bounces, memory)
        return {name: at.found(x.T) for name, x in found.items()}
    from tracer.paths import drivers

    return drivers.lobes(scene, at, start, sequence, bounces, memory)


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


def _form(starts: Tensor, sequence: Sequence) -> Form:
    """The form of paths from the surfaces of a picture."""
    return form_of(starts, cuda=len(sequence.rotation) <= integrators.MOST_DIMS)
