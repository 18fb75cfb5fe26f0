"""Run `gbufrt.atmosphere.kernel` over many rays, on the CPU or on a GPU."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.atmosphere import kernel
from gbufrt.atmosphere.tables import Tables
from gbufrt.compute.each import Each

each_ray = Each(kernel.through_air)


def through_air(tables: Tables, rays: Tensor, steps: int, out: Tensor) -> None:
    """See `gbufrt.atmosphere.rays.marched`.

    Args:
        tables: of the atmosphere.
        rays: ``(N, 5)`` float64: height, cosines of the ray to the zenith, of the sun to it and of both, end.
        steps: along each.
        out: ``(N, slices, 6)`` float32, is written: radiance and transmittance.
    """
    again = rays.new_empty(0, 0, 0, 0, 6) if tables.again is None else tables.again
    shape, numbers = torch.tensor(again.shape[:4], device=rays.device), rays.new_tensor(tables.atmosphere.numbers())
    each_ray(len(rays), rays, numbers, tables.transmittance, again.flatten(0, 3), shape, steps, out)
