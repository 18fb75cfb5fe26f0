"""Tables of an atmosphere, made from its numbers.

Source: Bruneton and Neyret 2008: light is gathered from all sides, scattered by phase functions, and gathered again,
order by order. Hillaire 2020: orders that are not gathered are a geometric series.
"""

from __future__ import annotations

import math
from functools import lru_cache

import torch
from torch import Tensor

from gbufrt.atmosphere.medium import Atmosphere, mie_phase, rayleigh_phase
from gbufrt.atmosphere.rays import STEPS, gathered
from gbufrt.atmosphere.reference import steps_of
from gbufrt.atmosphere.scales import azimuth_at, rise_at, sun_at
from gbufrt.atmosphere.tables import DTYPE, Tables, to_horizon

TRANSMITTANCE = (64, 256)  # heights, directions
AGAIN = (40, 16, 15, 10)  # heights of the sun, heights, cosines to the zenith, azimuths to the sun
WAYS = (16, 8)  # directions that light is gathered from to be scattered again: cosines, azimuths
WITHIN = 4  # places in each of them, along both, that phase functions are averaged over
FEW = 16  # steps along rays that only fill a table
ORDERS = 3  # of scattering that are gathered one by one
DARK = 1e-12  # radiance that has a logarithm
CPU = torch.device("cpu")


@lru_cache(maxsize=8)
def tables_of(atmosphere: Atmosphere, device: torch.device = CPU) -> Tables:
    """The tables of an atmosphere: made once, in less than a second.

    After the last gathering each order is taken to fade as the last did from the one before.
    """
    tables = Tables(atmosphere, _transmittance(atmosphere, device))
    found: list[tuple[Tensor, Tensor, Tensor]] = []
    sides = Sides(atmosphere, device)
    for _ in range(ORDERS):
        found.append(sides.scattered(tables))
        again, below, _ = found[-1]
        tables = Tables(atmosphere, tables.transmittance, _log(again), _log(below))
    (_, _, first), (second, below, mean), (third, below_now, mean_now) = found[-3:]
    kept = ((mean_now - mean) / (mean - first).clamp_min(DARK)).clamp(0.0, 0.9)
    further = kept / (1 - kept)
    again = third + (third - second) * further.repeat(1, 1, 2)[:, :, None, None]
    return Tables(atmosphere, tables.transmittance, _log(again), _log(below_now + (below_now - below) * further[:, 0]))


def _log(light: Tensor) -> Tensor:
    return light.clamp_min(DARK).log()


def _transmittance(air: Atmosphere, device: torch.device) -> Tensor:
    rows, columns = TRANSMITTANCE
    whole = to_horizon(air, torch.tensor(air.thickness, dtype=DTYPE, device=device))
    rho = (torch.linspace(0, 1, rows, dtype=DTYPE, device=device) * whole)[:, None]
    height = rho * rho / ((rho * rho + air.radius**2).sqrt() + air.radius)
    least = air.thickness - height
    away = least + torch.linspace(0, 1, columns, dtype=DTYPE, device=device) * (rho + whole - least)
    squares = whole * whole - rho * rho - away * away
    up = torch.where(away > 0, squares / (2 * (air.radius + height) * away.clamp_min(1e-9)), 1.0).clamp(-1.0, 1.0)
    depth = torch.zeros(rows, columns, 3, dtype=DTYPE, device=device)
    for at, step in steps_of(away, 4 * STEPS):
        depth += air.extinction(air.height_after(height, up, at).clamp(0.0, air.thickness)) * step[..., None]
    return torch.exp(-depth)


class Sides:
    """Light from all sides, at all heights and for all heights of the sun, and how it is scattered.

    Directions are cells between cosines to the zenith and between azimuths to the sun, of which one half is like the
    other.
    """

    def __init__(self, air: Atmosphere, device: torch.device) -> None:
        suns, heights, rises, azimuths = (torch.linspace(0, 1, n, dtype=DTYPE, device=device) for n in AGAIN)
        self.sun, self.height = sun_at(suns), heights * heights * air.thickness
        edges, turns = (torch.linspace(0, 1, n + 1, dtype=DTYPE, device=device) for n in WAYS)
        edges, turns = rise_at(edges), azimuth_at(turns).acos()
        self.up, self.azimuth = (edges[1:] + edges[:-1]) / 2, (turns[1:] + turns[:-1]) / 2
        self.angles = 2 * (edges.diff()[:, None] * turns.diff()).flatten()  # with the other half
        inner = (torch.arange(WITHIN, dtype=DTYPE, device=device) + 0.5) / WITHIN
        fine = (edges[:-1, None] + edges.diff()[:, None] * inner).flatten()
        round_ = (turns[:-1, None] + turns.diff()[:, None] * inner).flatten()
        out_up, out_azimuth = rise_at(rises), azimuth_at(azimuths).acos()
        slope = ((1 - out_up * out_up)[:, None] * (1 - fine * fine)).clamp_min(0.0).sqrt()
        phases = []
        for turn in (out_azimuth[:, None] - round_, out_azimuth[:, None] + round_):
            cosine = (out_up[:, None] * fine)[:, None, :, None] + slope[:, None, :, None] * turn.cos()[:, None]
            cosine = cosine.clamp(-1.0, 1.0)
            phases.append(torch.stack([rayleigh_phase(cosine), mie_phase(cosine, air.mie_asymmetry)]))
        phase = ((phases[0] + phases[1]) / 2).unflatten(3, (-1, WITHIN)).unflatten(5, (-1, WITHIN)).mean(dim=(4, 6))
        phase = phase.flatten(3).flatten(1, 2) * self.angles
        self.phase = phase / phase.sum(dim=-1, keepdim=True)  # (2, directions out, directions in)

    def scattered(self, tables: Tables) -> tuple[Tensor, Tensor, Tensor]:
        """What the light of tables is scattered to, as `Tables` has it, its irradiance of the ground, and its mean."""
        shape = len(self.sun), len(self.height), *WAYS
        sun, height = self.sun.view(-1, 1, 1, 1).expand(shape), self.height.view(-1, 1, 1).expand(shape)
        up, azimuth = self.up.view(-1, 1).expand(shape), self.azimuth.expand(shape)
        between = up * sun + ((1 - up * up) * (1 - sun * sun)).clamp_min(0.0).sqrt() * azimuth.cos()
        light = gathered(tables, height, up, sun, between, steps=FEW)[0].flatten(2, 3)
        again = torch.einsum("poi,shic->shopc", self.phase, light).flatten(-2).unflatten(2, AGAIN[2:])
        down = up[0, 0].flatten().clamp_min(0.0) * self.angles
        mean = torch.einsum("i,shic->shc", self.angles / (4 * math.pi), light)
        return again.contiguous(), torch.einsum("i,sic->sc", down, light[:, 0]), mean
