"""Run `tracer.weather.kernel` over many rays or points, on the CPU or on a GPU."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.each import Each
from tracer.weather import kernel
from tracer.weather.reference import finest
from tracer.weather.water import Water

meet_each, focused_each = Each(kernel.meet), Each(kernel.focused)


def meet(water: Water, origins: Tensor, directions: Tensor, t: Tensor, end: Tensor) -> Tensor:
    """See `tracer.weather.reference.meet`."""
    found, waves = torch.empty_like(t), water.waves
    rays = [x.contiguous() for x in (origins, directions, t, end)]
    numbers = waves.amplitude, waves.frequency, water.shift
    meet_each(len(t), *rays, water.lattice.numbers, water.eye, *map(float, numbers), found)
    return found


def focused(water: Water, points: Tensor, normals: Tensor, levels: Tensor, sun: Tensor) -> Tensor:
    """See `tracer.weather.reference.focused`."""
    found, waves = torch.empty_like(levels), water.waves
    given = [x.contiguous() for x in (points, normals, levels)]
    numbers = waves.amplitude, waves.frequency, water.shift, finest(water)
    focused_each(len(levels), *given, water.lattice.numbers, sun, water.eye, *map(float, numbers), found)
    return found
