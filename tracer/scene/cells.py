"""A world from a list of voxels, and back: memory is proportional to the voxels, not to their bounding box."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.scene.material import MaterialTable
from tracer.scene.world import BRICK, World

Cells = NDArray[np.int64]
Ids = NDArray[np.int16]

MAX_BRICK_CELLS = 1 << 24  # index entries: 64 MiB


def world_of_cells(cells: Cells, ids: Ids, materials: MaterialTable) -> World:
    """A world that holds the given voxels and no more.

    Args:
        cells: ``(N, 3)`` voxel coordinates, y up. If a cell occurs twice, the later one wins.
        ids: ``(N,)`` voxel ids, 0 being air.
        materials: what the ids mean.

    Raises:
        ValueError: no voxel, ids outside the table, or a box too large for an index grid.
    """
    if len(cells) == 0:
        raise ValueError("cells must hold at least one voxel, got none")
    if int(ids.min()) < 0 or int(ids.max()) >= len(materials):
        raise ValueError(f"ids must lie in 0..{len(materials) - 1}, got {int(ids.min())}..{int(ids.max())}")
    brick, inner = np.divmod(cells, BRICK)
    low = brick.min(axis=0)
    shape = brick.max(axis=0) - low + 1
    if float(np.prod(shape.astype(np.float64))) > MAX_BRICK_CELLS:
        raise ValueError(
            f"cells must fit {MAX_BRICK_CELLS} bricks of {BRICK} voxels cubed, got a box of {tuple(shape)}"
        )
    flat = np.ravel_multi_index(tuple((brick - low).T), tuple(shape))
    used, number = np.unique(flat, return_inverse=True)
    bricks = np.zeros((len(used) + 1, BRICK, BRICK, BRICK), np.int16)
    bricks[number + 1, inner[:, 0], inner[:, 1], inner[:, 2]] = ids
    index = np.zeros(int(np.prod(shape)), np.int32)
    index[used] = np.arange(1, len(used) + 1)
    x, y, z = (int(v) * BRICK for v in low)
    return World(
        bricks=torch.from_numpy(bricks),
        index=torch.from_numpy(index.reshape(tuple(shape))),
        origin=(x, y, z),
        materials=materials,
    )


def blocks_of_world(world: World, side: int) -> Cells:
    """``(N, 3)`` the cubes of ``side`` voxels that hold any, counted in cubes; ``side`` divides a brick's."""
    index, bricks, each = world.index.cpu().numpy(), world.bricks.cpu().numpy(), BRICK // side
    there = bricks.reshape(-1, each, side, each, side, each, side).max(axis=(2, 4, 6)) > 0
    where = np.argwhere(index > 0)
    n, x, y, z = np.nonzero(there[index[tuple(where.T)]])
    return where[n] * each + np.stack([x, y, z], axis=1) + np.asarray(world.origin) // side


def cells_of_world(world: World) -> tuple[Cells, Ids]:
    """The voxels of a world that are not air: ``(N, 3)`` coordinates and ``(N,)`` ids."""
    index, bricks = world.index.cpu().numpy(), world.bricks.cpu().numpy()
    where = np.argwhere(index > 0)
    chosen = bricks[index[tuple(where.T)]]
    n, x, y, z = np.nonzero(chosen)
    cells = where[n] * BRICK + np.stack([x, y, z], axis=1) + np.asarray(world.origin)
    return cells.astype(np.int64), chosen[n, x, y, z]
