"""What is looked up while light is gathered along a ray: transmittance to space, and light scattered many times.

Source: Bruneton and Neyret 2008 for the first table; Hillaire 2020, "A Scalable and Production Ready Sky and
Atmosphere Rendering Technique", for the second.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from gbufrt.atmosphere.medium import Atmosphere, mie_moments, mie_phase, rayleigh_phase
from gbufrt.sampling import sample

TRANSMITTANCE = (64, 256)  # heights, directions
MULTIPLE = (16, 32)  # heights, heights of the sun
STEPS = 40  # along a ray; half as many where rays only fill a table
ORDERS = 3  # of scattering that are gathered one by one
WAYS = (20, 6)  # directions that light is gathered from to be scattered again: cosines, azimuths
MOMENTS = 6  # of light from all sides: its mean, two of first and three of second order
SUN_RADIUS = 0.0047  # radians: the horizon takes the sun away over its disc
DTYPE = torch.float64
CPU = torch.device("cpu")


@dataclass(frozen=True, eq=False)
class Tables:
    """Of an atmosphere, on one device, for a sun of unit irradiance.

    Args:
        atmosphere: whose.
        transmittance: ``(1, 3, h, w)`` from a height, in a direction, to space.
        moments: ``(1, 18, h, w)`` of the light that is there to be scattered again, by height and the sun's height;
            None while it is made.
        arriving: ``(1, 3, 1, w)`` irradiance of the ground by the sky, by the sun's height; likewise.
    """

    atmosphere: Atmosphere
    transmittance: Tensor
    moments: Tensor | None = None
    arriving: Tensor | None = None

    def to_space(self, height: Tensor, cosine: Tensor) -> Tensor:
        """``(..., 3)`` transmittance of rays that do not meet the ground."""
        air = self.atmosphere
        rho, whole = _rho(air, height), _rho(air, height.new_tensor(air.thickness))
        least = air.thickness - height
        column = ((air.to_top(height, cosine) - least) / (rho + whole - least)).clamp(0.0, 1.0)
        return _read(self.transmittance, column, rho / whole)

    def to_sun(self, height: Tensor, cosine: Tensor) -> Tensor:
        """``(..., 3)`` share of the sun's light that arrives, 0 where the ground hides its disc."""
        horizon = -_rho(self.atmosphere, height) / (self.atmosphere.radius + height)
        shown = ((cosine - horizon) / (2 * SUN_RADIUS) + 0.5).clamp(0.0, 1.0)
        shown = shown * shown * (3 - 2 * shown)
        return self.to_space(height, torch.maximum(cosine, horizon)) * shown[..., None]

    def to_ground(self, sun: Tensor) -> Tensor:
        """``(..., 3)`` irradiance of the ground."""
        direct = self.to_sun(torch.zeros_like(sun), sun) * sun.clamp_min(0.0)[..., None]
        return direct if self.arriving is None else direct + _read(self.arriving, _column(sun), torch.zeros_like(sun))

    def scattered_again(self, height: Tensor, sun: Tensor, up: Tensor, between: Tensor) -> tuple[Tensor, Tensor]:
        """Radiance, ``(..., 3)`` each, that molecules and aerosols send back along a ray, out of light from all sides.

        Args:
            height: ``(...)`` kilometres.
            sun: cosine between the sun and the zenith.
            up: between the ray and the zenith.
            between: between the ray and the sun.
        """
        assert self.moments is not None
        row = (height / self.atmosphere.thickness).clamp(0.0, 1.0).sqrt()
        moments = _read(self.moments, _column(sun), row).unflatten(-1, (MOMENTS, 3))
        basis = torch.stack(_basis(sun, up, between), dim=-1)[..., None]
        mean, first, second = (part.sum(-2) for part in (moments * basis).split((1, 2, 3), dim=-2))
        kept = mie_moments(0.0), mie_moments(self.atmosphere.mie_asymmetry)  # without asymmetry they are molecules
        by_molecules, by_aerosols = (mean + a * first + b * second for a, b in kept)
        return by_molecules, by_aerosols.clamp_min(0.0)


@lru_cache(maxsize=8)
def tables_of(atmosphere: Atmosphere, device: torch.device = CPU) -> Tables:
    """The tables of an atmosphere: made once, in about a second."""
    return _often(Tables(atmosphere, _transmittance(atmosphere, device)))


def gathered(
    tables: Tables,
    height: Tensor,
    up: Tensor,
    sun: Tensor,
    between: Tensor,
    *,
    steps: int = STEPS,
) -> tuple[Tensor, Tensor]:
    """Light that a ray gathers, for a sun of unit irradiance, and the share of what is behind that gets through.

    It ends where it leaves the air, or at the ground, which is lit.

    Args:
        tables: of the atmosphere; without moments only light that is scattered once is gathered.
        height: ``(...)`` where the ray begins, kilometres.
        up: cosine between the ray and the zenith there.
        sun: between the sun and the zenith there.
        between: between the ray and the sun.
        steps: along the ray.

    Returns:
        ``(..., 3)`` each: radiance, and transmittance.
    """
    air = tables.atmosphere
    stop, grounded = air.ends(height, up)
    light, clear = deque(marched(tables, height, up, sun, between, stop, steps), maxlen=1).pop()
    sun_here = ((air.radius + height) * sun + stop * between) / air.radius
    below = clear * tables.to_ground(sun_here) * (air.ground_albedo / math.pi)
    light = light + torch.where(grounded[..., None], below, 0.0)
    return light, torch.where(grounded[..., None], 0.0, clear)


def marched(
    tables: Tables, height: Tensor, up: Tensor, sun: Tensor, between: Tensor, stop: Tensor, steps: int
) -> Iterator[tuple[Tensor, Tensor]]:
    """As `gathered`, from the air alone, up to each of the places ``stop * (k / steps) ** 2``."""
    air = tables.atmosphere
    light = torch.zeros(*height.shape, 3, dtype=height.dtype, device=height.device)
    clear = torch.ones_like(light)
    phases = rayleigh_phase(between)[..., None], mie_phase(between, air.mie_asymmetry)[..., None]
    for at, step in _steps(stop, steps):
        here = air.height_after(height, up, at).clamp(0.0, air.thickness)
        sun_here = ((air.radius + height) * sun + at * between) / (air.radius + here)
        arriving = tables.to_sun(here, sun_here)
        by_molecules, by_aerosols = arriving * phases[0], arriving * phases[1]
        if tables.moments is not None:
            up_here = ((air.radius + height) * up + at) / (air.radius + here)
            again = tables.scattered_again(here, sun_here, up_here, between)
            by_molecules, by_aerosols = by_molecules + again[0], by_aerosols + again[1]
        molecules, aerosols = air.scattering(here)
        gain, clear_after = _through(air, here, step, clear)
        light = light + gain * (molecules * by_molecules + aerosols * by_aerosols)
        clear = clear_after
        yield light, clear


def _steps(stop: Tensor, count: int) -> Iterator[tuple[Tensor, Tensor]]:
    """Middles and lengths of steps along rays, shorter where they begin, because there the air is dense."""
    for k in range(count):
        near, far = (k / count) ** 2, ((k + 1) / count) ** 2
        yield stop * (0.5 * (near + far)), stop * (far - near)


def _through(air: Atmosphere, height: Tensor, step: Tensor, clear: Tensor) -> tuple[Tensor, Tensor]:
    """What a source along a step adds to a ray, a unit of it, and the ray's transmittance behind the step."""
    lost = air.extinction(height)
    passed = torch.exp(-lost * step[..., None])
    return clear * ((1 - passed) / lost.clamp_min(1e-12)), clear * passed


def _transmittance(air: Atmosphere, device: torch.device) -> Tensor:
    rows, columns = TRANSMITTANCE
    whole = _rho(air, torch.tensor(air.thickness, dtype=DTYPE, device=device))
    rho = (torch.linspace(0, 1, rows, dtype=DTYPE, device=device) * whole)[:, None]
    height = rho * rho / ((rho * rho + air.radius**2).sqrt() + air.radius)
    least = air.thickness - height
    away = least + torch.linspace(0, 1, columns, dtype=DTYPE, device=device) * (rho + whole - least)
    squares = whole * whole - rho * rho - away * away
    up = torch.where(away > 0, squares / (2 * (air.radius + height) * away.clamp_min(1e-9)), 1.0).clamp(-1.0, 1.0)
    clear = torch.ones(rows, columns, 3, dtype=DTYPE, device=device)
    for at, step in _steps(away, 4 * STEPS):
        here = air.height_after(height.expand_as(away), up, at).clamp(0.0, air.thickness)
        clear = _through(air, here, step, clear)[1]
    return clear.permute(2, 0, 1)[None].contiguous()


def _often(tables: Tables) -> Tables:
    """The tables with light that is scattered more than once.

    Light is gathered from all sides, and kept as moments up to the second order, which is all that molecules see of it:
    first what was scattered once, then what that is scattered to, and so on. After the last gathering each order is
    taken to fade as the last did from the one before.
    """
    found = [(torch.zeros((), dtype=DTYPE), torch.zeros((), dtype=DTYPE))]  # light scattered at most so many times
    for _ in range(ORDERS):
        found.append(_moments(tables))
        tables = Tables(tables.atmosphere, tables.transmittance, *found[-1])
    (first, _), (second, below), (third, below_now) = found[-3:]
    kept = (third - second)[:, :3] / (second - first)[:, :3].clamp_min(1e-30)
    further = kept.clamp(0.0, 0.9) / (1 - kept.clamp(0.0, 0.9))
    moments = third + (third - second) * further.repeat(1, MOMENTS, 1, 1)
    arriving = below_now + (below_now - below) * further[:, :, :1]
    return Tables(tables.atmosphere, tables.transmittance, moments, arriving)


def _moments(tables: Tables) -> tuple[Tensor, Tensor]:
    """``(1, 18, h, w)`` moments of light from all sides, and ``(1, 3, 1, w)`` irradiance of the ground by the sky."""
    air, device = tables.atmosphere, tables.transmittance.device
    rows, columns = MULTIPLE
    height = torch.linspace(0, 1, rows, dtype=DTYPE, device=device) ** 2 * air.thickness
    place = torch.linspace(-1, 1, columns, dtype=DTYPE, device=device)
    up = (torch.arange(WAYS[0], dtype=DTYPE, device=device) + 0.5) / WAYS[0] * 2 - 1
    azimuth = (torch.arange(WAYS[1], dtype=DTYPE, device=device) + 0.5) / WAYS[1] * math.pi
    shape = rows, columns, *WAYS
    height, sun = height.view(-1, 1, 1, 1).expand(shape), (place.sign() * place * place).view(1, -1, 1, 1).expand(shape)
    up, azimuth = up.view(1, 1, -1, 1).expand(shape), azimuth.view(1, 1, 1, -1).expand(shape)
    between = up * sun + ((1 - up * up) * (1 - sun * sun)).clamp_min(0.0).sqrt() * azimuth.cos()
    light, _ = gathered(tables, height, up, sun, between, steps=STEPS // 2)
    moments = torch.stack([(light * b[..., None]).mean(dim=(2, 3)) for b in _basis(sun, up, between)], dim=2)
    moments = moments * moments.new_tensor([1, 3, 3, 5, 5, 5])[:, None]
    arriving = 4 * math.pi * (light[0] * up[0, ..., None].clamp_min(0.0)).mean(dim=(1, 2))
    return moments.flatten(2).permute(2, 0, 1)[None].contiguous(), arriving.T[None, :, None].contiguous()


def _basis(sun: Tensor, up: Tensor, between: Tensor) -> tuple[Tensor, ...]:
    """Harmonics of a direction up to the second order, that are even about the plane of zenith and sun."""
    flat = (1 - sun * sun).clamp_min(1e-9).sqrt()
    ahead = ((between - up * sun) / flat).clamp(-1.0, 1.0)  # toward the sun, along the ground
    aside = (1 - up * up - ahead * ahead).clamp_min(0.0)  # squared
    second = 1.5 * up * up - 0.5, 3**0.5 * up * ahead, 3**0.5 / 2 * (ahead * ahead - aside)
    return torch.ones_like(up), up, ahead, *second


def _rho(air: Atmosphere, height: Tensor) -> Tensor:
    """Distance to the horizon, kilometres."""
    return (height * (2 * air.radius + height)).clamp_min(0.0).sqrt()


def _column(sun: Tensor) -> Tensor:
    """Place of a sun's height in tables: most of them is for dusk."""
    return 0.5 + 0.5 * sun.sign() * sun.abs().sqrt()


def _read(table: Tensor, column: Tensor, row: Tensor) -> Tensor:
    """``(..., C)`` of a table whose first and last texels lie at 0 and 1."""
    channels, height, width = table.shape[1:]
    px = torch.stack([0.5 + column * (width - 1), 0.5 + row * (height - 1)])
    return sample(table, px.reshape(1, 2, 1, -1))[0, :, 0].T.reshape(*column.shape, channels)
