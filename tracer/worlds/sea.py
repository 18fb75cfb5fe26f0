"""The open sea: land that water surrounds goes on as water, so that its end is not in sight."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.scene.grids import BRICK
from tracer.scene.world import World

REACH = 128  # bricks: seen from 18 blocks over it, the sea then ends half a degree below the horizon
DEEP = 32  # blocks below its surface that go on with it, the sea floor among them; lower ones nobody sees


class Shore(NamedTuple):
    """Where land ends in water."""

    bricks: NDArray[np.int64]
    """``(N, 2)`` columns of bricks."""
    level: float
    """The water's height, world y."""
    water: int
    """Its material; those of other biomes differ by tint alone."""


def shore_of(top: NDArray[np.float64], kind: NDArray[np.int64], water: NDArray[np.bool_]) -> Shore | None:
    """Where land ends, if it does so in water of one height everywhere.

    Args:
        top: ``(X, Z)`` height of each column of voxels; -inf where there is none.
        kind: ``(X, Z)`` what lies there.
        water: ``(M,)`` which materials are.
    """
    land: NDArray[np.bool_] = np.isfinite(top)
    ends = ends_of(land)
    levels, kinds = np.unique(top[ends]), kind[ends]
    bricks = np.unique(np.argwhere(ends) // BRICK, axis=0)
    whole = np.asarray(land.reshape(len(land) // BRICK, BRICK, -1, BRICK).all(axis=(1, 3)))
    if len(levels) != 1 or not water[kinds].all() or not whole[tuple(bricks.T)].all():
        return None
    return Shore(bricks, float(levels[0]), int(kinds[0]))


def ends_of(land: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """``(X, Z)`` which columns have none beside them."""
    near = np.pad(land, 1)
    return land & ~(near[:-2, 1:-1] & near[2:, 1:-1] & near[1:-1, :-2] & near[1:-1, 2:])


def in_open_sea(world: World, shore: Shore) -> World:
    """A world that goes on: each empty column of bricks becomes a copy of the nearest one of the shore."""
    nx, _, nz = world.index.shape
    x, z = torch.meshgrid(torch.arange(-REACH, nx + REACH), torch.arange(-REACH, nz + REACH), indexing="ij")
    places, bricks = torch.stack([x, z], dim=-1).view(-1, 2).float(), torch.from_numpy(shore.bricks)
    nearest = bricks[torch.cdist(places, bricks.float()).argmin(dim=1)].to(world.device)
    index = world.index[nearest[:, 0], :, nearest[:, 1]].view(*x.shape, -1).transpose(1, 2).contiguous()
    index[:, : max(int(shore.level - DEEP) - world.origin[1], 0) // BRICK] = 0
    inside = index[REACH : REACH + nx, :, REACH : REACH + nz]
    inside.copy_(torch.where(world.index.any(dim=1)[:, None], world.index, inside))
    ox, oy, oz = world.origin
    return replace(world, index=index, origin=(ox - REACH * BRICK, oy, oz - REACH * BRICK))
