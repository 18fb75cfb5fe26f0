"""The compiled samples of sun and lamps over the pixels of a picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numba import prange
from torch import Tensor

from gbufrt.compute.kernel import array, driver, threads
from tracer.direct import kernel as direct_kernel
from tracer.direct import reference as direct
from tracer.direct.kernel import Shining
from tracer.lights.emitters import Lamps
from tracer.lights.shadows import LEAST, MOST, ShadowRays
from tracer.scene.scene import Sun
from tracer.traversal.kernel import triple
from tracer.traversal.rays import grid_from_world

ROWS = 64  # pixels handed out at a time


@driver
def sun_all(space, axes, sine, pixels, turned, begin, end, lanes, sums):
    numbers, points, normals = pixels
    for lane in prange(lanes):
        for start in range(lane * ROWS, len(numbers), lanes * ROWS):
            for i in range(start, min(start + ROWS, len(numbers))):
                point, normal = triple(points, numbers[i], 0), triple(normals, numbers[i], 0)
                direct_kernel.sun(space, axes, sine, point, normal, turned, i, begin, end, sums[i])


@driver
def lamp_all(space, shining, lamp, pixels, turned, begin, end, lanes, widest, sums):
    numbers, points, normals = pixels
    for lane in prange(lanes):
        each = np.empty(widest)
        for start in range(lane * ROWS, len(numbers), lanes * ROWS):
            for i in range(start, min(start + ROWS, len(numbers))):
                point, normal = triple(points, numbers[i], 0), triple(normals, numbers[i], 0)
                which = lamp[numbers[i] % len(lamp)]
                direct_kernel.lamp(space, shining, which, point, normal, turned, i, begin, end, each, sums[i])


@driver
def choose_all(shining, pixels, known, dice, lanes, levels, chosen, scale):
    numbers, points, normals = pixels
    for lane in prange(lanes):
        power = np.empty(len(levels))
        for start in range(lane * ROWS, len(numbers), lanes * ROWS):
            for k in range(start, min(start + ROWS, len(numbers))):
                i = numbers[k]
                point, normal = triple(points, i, 0), triple(normals, i, 0)
                chosen[i], scale[i] = direct_kernel.choose(shining, point, normal, known[i], dice[i], power, levels, i)


@dataclass(frozen=True, eq=False, kw_only=True)
class Direct(direct.Direct):
    """See `tracer.direct.reference.Direct`."""

    def sun(self, sun: Sun) -> ShadowRays:
        """See `tracer.direct.reference.Direct.sun`."""
        sine, basis = direct.sun_frame(sun)
        axes = array(basis.T.double())

        def run(pixels: Tensor, turned: Tensor, points: range, sums: Tensor) -> None:
            given = self._picture(pixels), array(turned), points.start, points.stop, threads(), array(sums)
            sun_all(self._space, axes, sine, *given)

        return _shadow_rays(run)

    def lamp(self, number: int) -> ShadowRays:
        """See `tracer.direct.reference.Direct.lamp`."""
        return self._lamps(np.array([number]))

    def lamp_of_each(self, numbers: Tensor) -> ShadowRays:
        """See `tracer.direct.reference.Direct.lamp_of_each`."""
        return self._lamps(array(numbers))

    def choices(self, known: Tensor, dice: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See `tracer.direct.reference.Direct.choices`."""
        levels = torch.zeros(len(self.lamps), len(known), dtype=torch.uint8)
        chosen, scale = torch.zeros(len(known), dtype=torch.long), torch.zeros_like(known)
        pixels, out = self._picture(self.surface.lit.nonzero()[:, 0]), (levels, chosen, scale)
        choose_all(self._shining, pixels, array(known), array(dice), threads(), *(array(t) for t in out))
        return out

    def _lamps(self, numbers: np.ndarray) -> ShadowRays:
        widest = int(np.diff(self._shining.first).max())

        def run(pixels: Tensor, turned: Tensor, points: range, sums: Tensor) -> None:
            given = self._picture(pixels), array(turned), points.start, points.stop, threads(), widest, array(sums)
            lamp_all(self._space, self._shining, numbers, *given)

        return _shadow_rays(run)

    def _picture(self, numbers: Tensor) -> tuple[np.ndarray, ...]:
        return array(numbers), *self._rows

    @cached_property
    def _rows(self) -> tuple[np.ndarray, ...]:
        return array(self.surface.points.T), array(self.surface.normals.T)

    @cached_property
    def _space(self) -> tuple[np.ndarray, ...]:
        transforms = grid_from_world(self.scene, self.poses, self.poses.device)[0]
        return array(transforms), *(array(grid) for grid in self.scene.grids.tensors)

    @cached_property
    def _shining(self) -> Shining:
        return shining_of(self.lamps)


def shining_of(lamps: Lamps) -> Shining:
    """Lamps as `tracer.direct.kernel` reads them."""
    used = lamps.edge_u.abs().sum(dim=2) > 0
    corner, edge_u, edge_v = (t[used].double() for t in (lamps.corner, lamps.edge_u, lamps.edge_v))
    facing = torch.linalg.cross(edge_u, edge_v)
    offset = (facing * corner).sum(dim=1, keepdim=True)
    first = torch.cat([torch.zeros(1, dtype=torch.long), used.sum(dim=1).cumsum(0)])
    ball = torch.cat([lamps.center, lamps.radius[:, None], lamps.radiance.mean(dim=1, keepdim=True)], dim=1)
    return Shining(
        array(torch.cat([corner, edge_u, edge_v, facing, offset], dim=1)), array(first), array(ball.double())
    )


def _shadow_rays(run: Any) -> ShadowRays:
    def shadow_rays(pixels: Tensor, turned: Tensor, points: range) -> Tensor:
        sums = torch.zeros(len(pixels), MOST + 1)
        sums[:, LEAST] = 1.0
        run(pixels, turned, points, sums)
        return sums.T

    return shadow_rays
