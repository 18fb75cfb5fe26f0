"""Light that rays gather in the air."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt.atmosphere import reference
from gbufrt.atmosphere.tables import Tables
from gbufrt.compute.dispatch import Form, form_of

STEPS = 40  # along a ray


def gathered(
    tables: Tables,
    height: Tensor,
    up: Tensor,
    sun: Tensor,
    between: Tensor,
    *,
    leaving: Tensor | None = None,
    steps: int = STEPS,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor]:
    """Light that a ray gathers, for a sun of unit irradiance, and the share of what is behind that gets through.

    It ends where it leaves the air, or at the ground, which is lit.

    Args:
        tables: of the atmosphere; without light scattered again only what is scattered once is gathered.
        height: ``(...)`` where the ray begins, kilometres.
        up: cosine between the ray and the zenith there.
        sun: between the sun and the zenith there.
        between: between the ray and the sun.
        leaving: ``(..., 3)`` radiance that the ground sends back along the ray; by default what lights it, times the
            atmosphere's albedo.
        steps: along the ray.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(..., 3)`` each: radiance, and transmittance.
    """
    air = tables.atmosphere
    stop, grounded = air.ends(height, up)
    light, clear = marched(tables, height, up, sun, between, stop, steps, slices=1, compiled=compiled)
    light, clear = light[..., 0, :], clear[..., 0, :]
    if leaving is None:
        sun_here = ((air.radius + height[grounded]) * sun[grounded] + (stop * between)[grounded]) / air.radius
        sent = tables.to_ground(sun_here) * (air.ground_albedo / math.pi)
    else:
        sent = leaving[grounded]
    lit = light[grounded] + clear[grounded] * sent
    return light.masked_scatter(grounded[..., None], lit), clear.masked_fill(grounded[..., None], 0.0)


def marched(
    tables: Tables,
    height: Tensor,
    up: Tensor,
    sun: Tensor,
    between: Tensor,
    stop: Tensor,
    steps: int,
    *,
    slices: int,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor]:
    """As `gathered`, from the air alone, up to each of the places ``stop * (k / steps) ** 2``, k from 1 on.

    Args:
        tables: see there.
        height: see there.
        up: see there.
        sun: see there.
        between: see there.
        stop: ``(...)`` kilometres.
        steps: along the ray.
        slices: of those places, the first ones and the last; 1 for the last alone.
        compiled: see there.

    Returns:
        ``(..., slices, 3)`` each: radiance, and transmittance, float64.
    """
    out = torch.empty(height.numel(), slices, 6, device=height.device)
    form = form_of(out, compiled=compiled, cuda=True)
    if form is Form.REFERENCE:
        behind = list(reference.marched(tables, height, up, sun, between, stop, steps))
        behind = behind[: slices - 1] + behind[-1:]
        return torch.stack([light for light, _ in behind], -2), torch.stack([clear for _, clear in behind], -2)
    from gbufrt.atmosphere import drivers

    rays = torch.stack([x.flatten() for x in torch.broadcast_tensors(height, up, sun, between, stop)], dim=1)
    drivers.through_air(tables, rays, steps, out)
    light, clear = out.to(rays).view(*height.shape, slices, 6).split(3, dim=-1)
    return light, clear
