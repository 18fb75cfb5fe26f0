"""The open sea: land with a coast goes on as water, so that its end is not in sight."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.scene.grids import BRICK
from tracer.scene.world import World

REACH = 128  # bricks: seen from 18 blocks over it, the sea then ends half a degree below the horizon
COAST = 0.2  # of a file's border, which makes it a coast; a river leaves through less
DEEP = 32  # blocks below its surface that go on with it, the sea floor among them; lower ones nobody sees


class Shore(NamedTuple):
    """Where land ends in water."""

    bricks: NDArray[np.int64]
    """``(N, 2)`` columns of bricks that are water all over."""
    level: float
    """The water's height, world y."""
    water: int
    """Its material; those of other biomes differ by tint alone."""


def shore_of(top: NDArray[np.float64], kind: NDArray[np.int64], water: NDArray[np.bool_]) -> Shore | None:
    """Where land ends in water, if it has a coast: water of one height, and no end of it lower than that.

    Args:
        top: ``(X, Z)`` height of each column of voxels; -inf where there is none.
        kind: ``(X, Z)`` what lies there.
        water: ``(M,)`` which materials are.
    """
    ends = ends_of(np.isfinite(top))
    wet = ends & water[kind]
    levels = np.unique(top[wet])
    if len(levels) != 1 or top[ends].min() < levels[0] or wet.sum() < COAST * ends.sum():
        return None
    level = float(levels[0])
    flat = (water[kind] & (top == level)).reshape(len(top) // BRICK, BRICK, -1, BRICK).all(axis=(1, 3))
    bricks = np.unique(np.argwhere(wet) // BRICK, axis=0)
    bricks = bricks[flat[tuple(bricks.T)]]
    return Shore(bricks, level, int(kind[wet][0])) if len(bricks) else None


def ends_of(land: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """``(X, Z)`` which columns have none beside them."""
    near = np.pad(land, 1)
    return land & ~(near[:-2, 1:-1] & near[2:, 1:-1] & near[1:-1, :-2] & near[1:-1, 2:])


def in_open_sea(world: World, shore: Shore) -> World:
    """A world that goes on: each empty column of bricks becomes a copy of the deepest one of the shore.

    Copies of shallow water would show that they are copies.
    """
    nx, _, nz = world.index.shape
    x, z = _deepest(world, shore)
    index = world.index[x, :, z, None].repeat(nx + 2 * REACH, 1, nz + 2 * REACH)
    index[:, : max(int(shore.level - DEEP) - world.origin[1], 0) // BRICK] = 0
    inside = index[REACH : REACH + nx, :, REACH : REACH + nz]
    inside.copy_(torch.where(world.index.any(dim=1)[:, None], world.index, inside))
    ox, oy, oz = world.origin
    return replace(world, index=index, origin=(ox - REACH * BRICK, oy, oz - REACH * BRICK))


def _deepest(world: World, shore: Shore) -> tuple[int, int]:
    """The column of bricks with most water in it."""
    side, depth = torch.arange(BRICK), int(shore.level) - 1 - torch.arange(DEEP)
    cells = torch.stack(torch.meshgrid(side, depth, side, indexing="ij"), dim=-1)
    corners = torch.zeros(len(shore.bricks), 3, dtype=torch.int64)
    corners[:, ::2] = BRICK * torch.from_numpy(shore.bricks) + torch.tensor(world.origin[::2])
    places = cells + corners[:, None, None, None]
    water = world.materials.water[world.at(places.to(world.device)).long()]
    x, z = shore.bricks[int(water.flatten(1).sum(dim=1).argmax())]
    return int(x), int(z)
