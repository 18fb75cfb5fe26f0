"""The lights of a scene as the flat tables of `tracer.lights.lit.Lit`, where the scene lies."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt.compute.resident import numbers
from tracer.lights import sky
from tracer.lights.lamp_table import LampTable
from tracer.lights.samples import Lights
from tracer.lights.sky_table import SkyTable
from tracer.scene.scene import Scene, Sun

NO_SUN = Sun(irradiance=(0.0, 0.0, 0.0))


def lit_tables(scene: Scene, lights: Lights | None, like: Tensor) -> tuple[Tensor, ...]:
    """The tables in the order of `Lit`: the sky, and sun and lamps where ``lights`` are wanted; ``like`` is float32."""
    lamps, table = (None, None) if lights is None else (lights.lamps, lights.sky)
    tables = (_picture(scene, like), _sky(scene, like.double()), *_lamps(lamps, like), *_sky_table(table, like))
    return tuple(table.contiguous() for table in tables)


def _picture(scene: Scene, like: Tensor) -> Tensor:
    if scene.sky.picture is None:
        return like.new_zeros(0, 0, 3)
    return scene.sky.picture[0].permute(1, 2, 0).float().to(like.device)


def _sky(scene: Scene, like: Tensor) -> Tensor:
    colors, sun = scene.sky, scene.sun
    has, sun = (0.0, NO_SUN) if sun is None else (1.0, sun)
    size = math.hypot(*sun.direction)
    toward = tuple(part / size for part in sun.direction)
    disc = math.sin(math.radians(sun.angular_radius)) * has, has, 0.0
    rows = colors.zenith, colors.horizon, colors.ground, toward, sun.irradiance, disc
    return numbers((*rows, *((*lobe, 0.0) for lobe in sky.GLOW)), like)


def _lamps(lamps: LampTable | None, like: Tensor) -> tuple[Tensor, ...]:
    if lamps is None:
        none = like.new_zeros(0, 1)
        return none, none[:, 0], none.int(), none.short(), like.new_zeros(7, dtype=torch.float64)
    half = (lamps.edge_u + lamps.edge_v) / 2
    columns = [lamps.corner + half, lamps.facing, half.norm(dim=1, keepdim=True), lamps.power[:, None]]
    columns += [lamps.corner, lamps.edge_u, lamps.edge_v, lamps.area[:, None], lamps.radiance]
    low = lamps.low.double()
    cells = torch.cat([low, numbers(((lamps.cell, *lamps.shape),), low)[0]])
    return torch.cat(columns, dim=1), lamps.power.cumsum(0), lamps.slots, lamps.counts, cells


def _sky_table(table: SkyTable | None, like: Tensor) -> tuple[Tensor, Tensor]:
    return (like.new_zeros(0), like.new_zeros(0)) if table is None else (table.upto, table.density)
