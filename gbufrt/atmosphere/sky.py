"""The light of the sky seen from a place: a picture of all directions, and the air before what a camera sees."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from gbufrt.atmosphere.medium import Atmosphere
from gbufrt.atmosphere.rays import gathered
from gbufrt.atmosphere.scattering import tables_of
from gbufrt.atmosphere.tables import DTYPE
from gbufrt.specular import DIELECTRIC_F0, schlick

DEEP = (0.010, 0.030, 0.045)  # albedo of deep water without what its surface mirrors
AROUND = 96  # columns from the sun's azimuth to the opposite one: the sky is the same on both sides of it


def sun_transmittance(atmosphere: Atmosphere, direction: Sequence[float], *, height: float = 0.05) -> Tensor:
    """Share of the light of the sun, or moon, that arrives.

    Args:
        atmosphere: the air.
        direction: toward the sun, world space, y up, of any length.
        height: of the place above the ground, kilometres.

    Returns:
        ``(3,)`` float32; 0 where the sun has set.
    """
    sun = unit_direction(direction)
    at = torch.tensor(height, dtype=DTYPE)
    return tables_of(atmosphere).to_sun(at.clamp(0.0, atmosphere.thickness), sun[1]).float()


def sky_picture(
    atmosphere: Atmosphere,
    direction: Sequence[float],
    *,
    irradiance: Sequence[float] = (1.0, 1.0, 1.0),
    height: float = 0.05,
    ground: Sequence[float] | None = None,
    water: float = 0.0,
    size: tuple[int, int] = (256, 512),
) -> Tensor:
    """Radiance of the sky by direction, without the sun's disc, as `gbufrt.environment` lays it out.

    Args:
        atmosphere: the air.
        direction: toward the sun, world space, y up, of any length; below the horizon it is dusk, then dark.
        irradiance: of the sun above the air, on a surface that faces it, linear RGB.
        height: of the place above the ground, kilometres; above the air the planet is seen from space.
        ground: albedo of the ground that is seen, linear RGB; the atmosphere's by default, which in any case is what
            the air is lit by.
        water: share of that ground that is calm deep water.
        size: ``(h, w)``.

    Returns:
        ``(1, 3, h, w)`` float32 linear radiance. Below the horizon it is the lit ground, behind the air before it.

    Raises:
        ValueError: ``direction`` has no length, ``height`` is negative, ``water`` lies outside 0..1, or one of the
            last two is given above the air.

    Source: Hillaire 2020; Schlick 1994 for what water mirrors.
    """
    if not height >= 0:
        raise ValueError(f"height must be at least 0 kilometres, got {height}")
    if height > atmosphere.thickness and (ground is not None or water > 0):
        raise ValueError(f"ground and water are seen from below {atmosphere.thickness} kilometres, got height {height}")
    if not 0 <= water <= 1:
        raise ValueError(f"water must lie in 0..1, got {water}")
    sun = unit_direction(direction)
    rows, columns = size
    up = ((torch.arange(rows, dtype=DTYPE) + 0.5) * (math.pi / rows)).cos()[:, None]
    azimuth = (torch.arange(AROUND, dtype=DTYPE) * (math.pi / (AROUND - 1)))[None]
    between = up * sun[1] + ((1 - up * up) * (1 - sun[1] ** 2)).clamp_min(0.0).sqrt() * azimuth.cos()
    half = _seen(atmosphere, height, up.expand_as(between), sun[1].expand_as(between), between)
    if ground is not None or water > 0:
        albedo = [atmosphere.ground_albedo] * 3 if ground is None else list(ground)
        half = _over(atmosphere, half, height, up, sun[1], between, half.new_tensor(albedo), water)
    away = (torch.arange(columns, dtype=DTYPE) + 0.5) * (2 * math.pi / columns) - math.pi - torch.atan2(sun[0], -sun[2])
    place = torch.remainder(away + math.pi, 2 * math.pi) - math.pi
    place = place.abs() * ((AROUND - 1) / math.pi)
    first = place.floor().long().clamp(0, AROUND - 2)
    share = (place - first)[None, :, None]
    whole = half[:, first] * (1 - share) + half[:, first + 1] * share
    return (whole * whole.new_tensor(list(irradiance))).float().permute(2, 0, 1)[None].contiguous()


def _seen(air: Atmosphere, height: float, up: Tensor, sun: Tensor, between: Tensor) -> Tensor:
    """``(..., 3)`` radiance along rays from a height; from space they are followed from where they enter the air."""
    tables = tables_of(air)
    start = torch.full_like(up, height)
    if height <= air.thickness:
        return gathered(tables, start, up, sun, between)[0]
    along = (air.radius + start) * up
    square = along * along - (start - air.thickness) * (2 * air.radius + start + air.thickness)
    meets = (square >= 0) & (up < 0)
    enters = torch.where(meets, -along - square.clamp_min(0.0).sqrt(), 0.0)
    top = torch.full_like(up, air.thickness)
    cosine = ((air.radius + start) * up + enters) / (air.radius + top)
    lit = ((air.radius + start) * sun + enters * between) / (air.radius + top)
    return torch.where(meets[..., None], gathered(tables, top, cosine, lit, between)[0], 0.0)


def _over(
    air: Atmosphere, sky: Tensor, height: float, up: Tensor, sun: Tensor, between: Tensor, albedo: Tensor, water: float
) -> Tensor:
    """A sky with another ground under it: land of an albedo and a share of water, which mirrors the rows above."""
    tables, below = tables_of(air), slice(len(sky) // 2, None)
    up, between = up[below].expand_as(between[below]), between[below]
    leaving = from_ground(up, tables.to_ground(sun) / math.pi, sky.flip(0)[below], albedo, water)
    start = torch.full_like(up, height)
    land = gathered(tables, start, up, sun.expand_as(up), between, leaving=leaving)[0]
    return torch.cat([sky[: below.start], land])


def from_ground(up: Tensor, lit: Tensor, mirrored: Tensor, albedo: Tensor, water: float) -> Tensor:
    """Radiance that flat ground sends to who looks down at it.

    Args:
        up: ``(...)`` cosine between the view and the zenith.
        lit: ``(..., 3)`` irradiance of the ground over pi.
        mirrored: ``(..., 3)`` radiance of the sky that water mirrors there.
        albedo: ``(3,)`` of what is no water.
        water: the share that is.

    Returns:
        ``(..., 3)``.

    Source: Schlick 1994.
    """
    mirrors = schlick(up.abs(), DIELECTRIC_F0)[..., None]
    wet = torch.lerp(lit * lit.new_tensor(DEEP), mirrored, mirrors)
    return torch.lerp((lit * albedo).expand_as(wet), wet, water)


def unit_direction(direction: Sequence[float]) -> Tensor:
    """``(3,)`` float64 of unit length."""
    toward = torch.tensor(list(direction), dtype=DTYPE)
    length = toward.norm()
    if not (length > 0 and bool(torch.isfinite(length))):
        raise ValueError(f"direction must be finite and have a length, got {tuple(direction)}")
    return toward / length
