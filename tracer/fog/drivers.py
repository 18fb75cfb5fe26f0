"""Run `tracer.fog.kernel` over many rays, on the CPU or on a GPU."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from numba import prange
from torch import Tensor

from gbufrt.compute.dispatch import simulated
from gbufrt.compute.each import Each
from gbufrt.compute.kernel import CPU, Kernel, array, driver, replaced, scalar, specialized, threads
from tracer.fog import along_kernel, kernel, reference
from tracer.fog.along import RARE, shared, turns_of
from tracer.fog.medium_kernel import Medium
from tracer.fog.rays_kernel import Arriving, finish, new_shadows
from tracer.fog.reference import FEW, shifts
from tracer.fog.segments import Segments
from tracer.lights.lit import Lit
from tracer.lights.samples import Lights
from tracer.lights.tables import lit_tables
from tracer.scene.scene import Scene
from tracer.traversal.rays import grid_from_world

CHUNK = 64  # rays handed out at a time
Forms = tuple[Kernel, Each]


def item(i: int, *arguments: Any) -> None:
    """Placeholder for the body in the loops below."""


@scalar
def _add_steps(begin, end, shadows, rays, medium, space, tables, weights, turned, noise):
    fog, lit = Medium(*medium), Lit(*tables)
    for i in range(begin, end):
        item(i, shadows, rays, fog, space, lit, weights, turned, noise)


def _all(rays, medium, space, tables, weights, turned, noise, lanes, light):
    count = len(light)
    for lane in prange(lanes):
        shadows = new_shadows(light)
        for begin in range(lane * CHUNK, count, lanes * CHUNK):
            end = min(begin + CHUNK, count)
            _add_steps(begin, end, shadows, rays, medium, space, tables, weights, turned, noise)
        finish(shadows, space)


@scalar
def _weigh_some(begin, end, rays, medium, tables, turns, rare, upto):
    fog, lit = Medium(*medium), Lit(*tables)
    for i in range(begin, end):
        along_kernel.weigh(rays, i, fog, lit, turns, rare, upto[i])


@driver
def weigh_all(rays, medium, tables, turns, rare, lanes, upto):
    for lane in prange(lanes):
        for begin in range(lane * CHUNK, len(upto), lanes * CHUNK):
            _weigh_some(begin, min(begin + CHUNK, len(upto)), rays, medium, tables, turns, rare, upto)


@scalar
def weigh(i, rays, medium, tables, turns, rare, upto):
    """As `weigh_all`, for one ray."""
    _weigh_some(i, i + 1, rays, medium, tables, turns, rare, upto)


@scalar
def steps(i, rays, medium, space, tables, weights, turned, noise, light):
    """As `_all`, of one ray."""
    item(i, Arriving(light), rays, Medium(*medium), space, Lit(*tables), weights, turned, noise)


def _forms(body: Callable[..., None]) -> Forms:
    """Steps for CPU threads, and for those of a GPU."""
    return Kernel(_all, CPU, item=body), Each(specialized(steps, body))


sun_steps, sky_steps, lamp_steps = map(_forms, (kernel.from_sun, kernel.from_sky, kernel.from_lamps))
weigh_each = Each(weigh)


@dataclass(frozen=True, eq=False, kw_only=True)
class March(reference.March):
    """See `tracer.fog.reference.March`.

    Args:
        space: the scene's grids, and the ways into them.
        tables: its lights.
    """

    space: tuple[Tensor, ...]
    tables: tuple[Tensor, ...]

    @staticmethod
    def made(scene: Scene, lights: Lights, poses: Tensor, **rest: Any) -> March:
        """The march through a scene."""
        space = grid_from_world(scene, poses, poses.device)[0].contiguous(), *scene.grids.tensors
        tables = lit_tables(scene, lights, poses.float())
        return March(scene=scene, lights=lights, poses=poses, space=space, tables=tables, **rest)

    def sun(self, noise: Tensor, steps: range) -> Tensor:
        """See `tracer.fog.reference.March.sun`."""
        return self._found(sun_steps, noise, steps)

    def sky(self, noise: Tensor, steps: range) -> Tensor:
        """See `tracer.fog.reference.March.sky`."""
        return self._found(sky_steps, noise, steps)

    def lamps(self, noise: Tensor, steps: range, alike: Tensor | None) -> Tensor:
        """See `tracer.fog.reference.March.lamps`."""
        assert self.lights.lamps is not None
        count, turns = len(self.lights.lamps), turns_of(self.fog, noise.device)
        if count > FEW:
            return self._found(lamp_steps, noise, steps, (noise.new_zeros(0, 0), _each_its_own(self.taken), turns))
        group, rays = (_each_its_own(self.taken), self.segments) if alike is None else shared(self.segments, alike)
        upto = noise.new_empty(len(rays.begin), count)
        given = self._rays(rays, rays.begin), self._medium, self.tables, turns, 0.0 if alike is None else RARE
        if simulated() or upto.is_cuda:
            weigh_each(len(upto), *given, upto)
        else:
            weigh_all(*replaced(given, array), threads(), array(upto))
        return self._found(lamp_steps, noise, steps, (upto, group.int(), turns))

    def _found(self, forms: Forms, noise: Tensor, steps: range, weights: tuple[Tensor, ...] | None = None) -> Tensor:
        """Mean light of steps; ``weights`` are summed ones of all lamps, the row of each ray, and `turns_of`."""
        light, (on_cpu, each) = torch.zeros_like(self.segments.origins), forms
        rays, none = self._rays(self.segments, self.taken), noise.new_zeros(0)
        weights = (none[:, None], none.int(), none) if weights is None else weights
        given = rays, self._medium, self.space, self.tables, weights, shifts(steps, noise), noise.contiguous()
        if simulated() or light.is_cuda:
            each(len(light), *given, light)
        else:
            on_cpu(*replaced(given, array), threads(), array(light))
        return light / len(steps)

    @property
    def _medium(self) -> tuple[float, ...]:
        return tuple(float(getattr(self.fog, name)) for name in Medium._fields)

    @staticmethod
    def _rays(rays: Segments, taken: Tensor) -> tuple[Tensor, ...]:
        return tuple(x.contiguous() for x in (rays.origins, rays.directions, rays.begin, rays.end, taken))


def _each_its_own(taken: Tensor) -> Tensor:
    return torch.arange(len(taken), dtype=torch.int32, device=taken.device)
