"""What a ray gathers in the air, in torch: the definition of `gbufrt.atmosphere.kernel`."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from gbufrt.atmosphere.medium import Atmosphere, mie_phase, rayleigh_phase
from gbufrt.atmosphere.tables import Tables


def marched(
    tables: Tables, height: Tensor, up: Tensor, sun: Tensor, between: Tensor, stop: Tensor, steps: int
) -> Iterator[tuple[Tensor, Tensor]]:
    """See `gbufrt.atmosphere.rays.marched`: radiance and transmittance, ``(..., 3)`` each, behind one step a time."""
    air = tables.atmosphere
    light = torch.zeros(*height.shape, 3, dtype=height.dtype, device=height.device)
    clear = torch.ones_like(light)
    phases = rayleigh_phase(between)[..., None], mie_phase(between, air.mie_asymmetry)[..., None]
    for at, step in steps_of(stop, steps):
        here = air.height_after(height, up, at).clamp(0.0, air.thickness)
        sun_here = ((air.radius + height) * sun + at * between) / (air.radius + here)
        arriving = tables.to_sun(here, sun_here)
        by_molecules, by_aerosols = arriving * phases[0], arriving * phases[1]
        if tables.again is not None:
            up_here = ((air.radius + height) * up + at) / (air.radius + here)
            again = tables.scattered_again(here, sun_here, up_here, between)
            by_molecules, by_aerosols = by_molecules + again[0], by_aerosols + again[1]
        molecules, aerosols = air.scattering(here)
        gain, clear_after = through(air, here, step, clear)
        light = light + gain * (molecules * by_molecules + aerosols * by_aerosols)
        clear = clear_after
        yield light, clear


def steps_of(stop: Tensor, count: int) -> Iterator[tuple[Tensor, Tensor]]:
    """Middles and lengths of steps along rays, shorter where they begin, because there the air is dense."""
    for k in range(count):
        near, far = (k / count) ** 2, ((k + 1) / count) ** 2
        yield stop * (0.5 * (near + far)), stop * (far - near)


def through(air: Atmosphere, height: Tensor, step: Tensor, clear: Tensor) -> tuple[Tensor, Tensor]:
    """What a source along a step adds to a ray, a unit of it, and the ray's transmittance behind the step."""
    lost = air.extinction(height)
    passed = torch.exp(-lost * step[..., None])
    return clear * ((1 - passed) / lost.clamp_min(1e-12)), clear * passed
