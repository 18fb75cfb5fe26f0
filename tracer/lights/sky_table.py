"""Importance sampling of the sky by its radiance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import torch
from torch import Tensor

from gbufrt.environment import environment_solid_angles
from tracer.lights.sky import environment
from tracer.scene.scene import Scene, Sky, Sun

CELLS = (32, 64)  # of a lat-long picture; within each, all directions are equally likely
BELOW_ONE = 1 - 2.0**-23  # so that rounding draws no cell behind the last that sends light
_known: WeakKeyDictionary[Sky, tuple[Sun | None, torch.device, SkyTable | None]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False, kw_only=True)
class SkyTable:
    """Density of directions, proportional to the radiance of the sky.

    Args:
        upto: ``(C,)`` cumulative probability of the cells, row by row of the lat-long picture.
        density: ``(C,)`` per steradian.
    """

    upto: Tensor
    density: Tensor

    @staticmethod
    def of(scene: Scene) -> SkyTable | None:
        """The table of a scene; None where the sky is black. It is kept, because the host has to ask whether it is."""
        sun, device, table = _known.get(scene.sky, (None, None, None))
        if device != scene.world.device or sun is not scene.sun:
            table = SkyTable._made(scene)
            _known[scene.sky] = scene.sun, scene.world.device, table
        return table

    @staticmethod
    def _made(scene: Scene) -> SkyTable | None:
        light = environment(scene, size=CELLS).mean(dim=1).flatten()
        angles = environment_solid_angles(CELLS, device=light.device).expand(1, 1, *CELLS).flatten()
        total = (light * angles).sum()
        if not total > 0:
            return None
        density = light / total
        return SkyTable(upto=(density * angles).cumsum(0), density=density)

    def sample(self, u: Tensor) -> tuple[Tensor, Tensor]:
        """Directions ``(N, 3)`` and their density ``(N,)``, from numbers ``(2, N)`` in [0, 1).

        Source: Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th ed., 12.5 (image infinite lights).
        """
        place = u[0] * (self.upto[-1] * BELOW_ONE)
        cell = torch.searchsorted(self.upto, place, right=True)  # past cells that send none
        before = torch.where(cell > 0, self.upto[cell - 1], 0.0)
        within = ((place - before) / (self.upto[cell] - before).clamp_min(1e-12)).clamp(0.0, 1.0)
        row, column = cell // CELLS[1], cell % CELLS[1]
        top, bottom = (row * (math.pi / CELLS[0])).cos(), ((row + 1) * (math.pi / CELLS[0])).cos()
        y = top + (bottom - top) * within
        across = (1 - y * y).clamp_min(0.0).sqrt()
        azimuth = (column + u[1]) * (2 * math.pi / CELLS[1]) - math.pi
        return torch.stack([across * azimuth.sin(), y, -across * azimuth.cos()], dim=1), self.density[cell]

    def density_of(self, directions: Tensor) -> Tensor:
        """``(N,)`` density with which `sample` draws ``directions`` ``(N, 3)``."""
        x, y, z = directions.unbind(dim=1)
        row = (y.clamp(-1.0, 1.0).acos() * (CELLS[0] / math.pi)).long().clamp_max(CELLS[0] - 1)
        column = ((torch.atan2(x, -z) / (2 * math.pi) + 0.5) * CELLS[1]).long().clamp(0, CELLS[1] - 1)
        return self.density[row * CELLS[1] + column]
