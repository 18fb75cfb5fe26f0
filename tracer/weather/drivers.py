"""Run `tracer.weather.kernel` over many rays, on the CPU or on a GPU."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.each import Each
from tracer.weather import kernel
from tracer.weather.water import Water

meet_each = Each(kernel.meet)


def meet(water: Water, origins: Tensor, directions: Tensor, t: Tensor, end: Tensor) -> Tensor:
    """See `tracer.weather.reference.meet`."""
    found, waves, eye = torch.empty_like(t), water.waves, water.eye.tolist()
    rays = [x.contiguous() for x in (origins, directions, t, end)]
    numbers = waves.amplitude, waves.frequency, water.shift
    meet_each(len(t), *rays, water.lattice.numbers, eye[0], eye[2], *map(float, numbers), found)
    return found
