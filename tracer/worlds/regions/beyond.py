"""What lies where a file ends: land with a coast goes on as the open sea, other land as its own mirror image, so that
the end of neither is in sight."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from tracer.scene.grids import BRICK
from tracer.scene.scene import Instance
from tracer.scene.world import World
from tracer.worlds.regions.height_map import full_blocks

REACH = 128  # bricks: seen from 18 blocks over it, the sea then ends half a degree below the horizon
LAND = 32  # bricks that land goes on for: as far as the game shows, with haze before the end
COAST = 0.2  # of a file's border, which makes it a coast; a river leaves through less
DEEP = 32  # blocks below its surface that go on with it, the sea floor among them; lower ones nobody sees
PIECE = 64  # columns of bricks, 128 x 128 blocks: smaller pieces show that what goes on is their mirror image
NARROW = 4  # bricks: strips of less do so as well
WHOLE = 0.75  # of all columns of bricks lie in the rectangle that goes on


class Span(NamedTuple):
    """A rectangle of columns of bricks, all of which have land: from the first up to the last, this not included."""

    x: tuple[int, int]
    z: tuple[int, int]


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
    """A world that goes on: each empty column of bricks becomes the deepest column of voxels of the shore.

    Copies of shallow water, and of a floor that is not even, would show that they are copies.
    """
    nx, _, nz = world.index.shape
    x, z = _deepest(world, shore)
    column = world.index[x, :, z]
    bricks = world.bricks[column.long()]
    wet = world.materials.water[bricks.long()].sum(dim=(0, 2)).flatten().argmax()
    even = bricks[:, wet // BRICK, :, wet % BRICK, None].unsqueeze(1).expand_as(bricks)
    level = int(shore.level - DEEP) - world.origin[1]
    index = torch.arange(len(column), dtype=torch.int32, device=column.device) + len(world.bricks)
    index = torch.where((column > 0) & (torch.arange(len(column)) >= max(level, 0) // BRICK), index, 0)
    index = index[None, :, None].repeat(nx + 2 * REACH, 1, nz + 2 * REACH)
    return _around(replace(world, bricks=torch.cat([world.bricks, even]), shining=None), index, REACH)


def _around(world: World, index: Tensor, reach: int) -> World:
    """A world within an index grid that is so many bricks wider on all sides; its own columns stay as they are."""
    nx, _, nz = world.index.shape
    inside = index[reach : reach + nx, :, reach : reach + nz]
    inside.copy_(torch.where(world.index.any(dim=1)[:, None], world.index, inside))
    ox, oy, oz = world.origin
    return replace(world, index=index, origin=(ox - reach * BRICK, oy, oz - reach * BRICK))


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


def span_of(top: NDArray[np.float64]) -> Span | None:
    """The largest rectangle of land, if it is large and most of the land, whose border is one of bricks everywhere.

    Args:
        top: ``(X, Z)`` height of each column of voxels; -inf where there is none.
    """
    there = np.isfinite(top).reshape(len(top) // BRICK, BRICK, -1, BRICK)
    land: NDArray[np.bool_] = np.any(there, axis=(1, 3))
    if (ends_of(land) & ~np.all(there, axis=(1, 3))).any():
        return None
    size, span = 0, Span((0, 0), (0, 0))
    for first in range(len(land)):
        filled = np.ones(land.shape[1], np.bool_)
        for last in range(first, len(land)):
            filled &= land[last]
            ends = np.flatnonzero(np.diff(filled, prepend=False, append=False)).reshape(-1, 2)
            if not len(ends):
                break
            z0, z1 = map(int, max(ends, key=np.ptp))
            if (found := (last + 1 - first) * (z1 - z0)) > size:
                size, span = found, Span((first, last + 1), (z0, z1))
    narrow = min(span.x[1] - span.x[0], span.z[1] - span.z[0])
    return span if size >= max(PIECE, WHOLE * land.sum()) and narrow >= NARROW else None


def in_open_land(world: World, instances: tuple[Instance, ...], span: Span, top: NDArray[np.float64]) -> World:
    """A world that goes on: what lies outside is its mirror image, so that heights go on without a step.

    Of instances, blocks that fill their upper side go on as cubes, leaves with holes among them, and others do not.

    Args:
        world: the land, on the CPU.
        instances: what else there is.
        span: the part that is mirrored.
        top: ``(X, Z)`` heights of the world's columns of voxels.
    """
    whole = world
    for shapes in instances:
        whole = _with_cubes(whole, *full_blocks(shapes))
    (x, turned_x), (z, turned_z) = (_mirrored(ends, n) for ends, n in zip(span, world.index.shape[::2], strict=True))
    index = _seen(whole, top)[x][:, :, z]
    turned = (turned_x[:, None] + 2 * turned_z)[:, None].expand_as(index)
    bricks = [whole.bricks]
    for turn, sides in ((1, (1,)), (2, (3,)), (3, (1, 3))):
        there = (turned == turn) & (index > 0)
        used, number = torch.unique(index[there], return_inverse=True)
        index[there] = (sum(map(len, bricks)) + number).int()
        bricks.append(whole.bricks[used.long()].flip(sides))
    wider = _around(replace(world, bricks=torch.cat(bricks), shining=None), index, LAND)
    used, number = torch.unique(torch.cat([index.new_zeros(1), wider.index.flatten()]), return_inverse=True)
    return replace(wider, bricks=wider.bricks[used.long()], index=number[1:].view_as(index).int())


def _mirrored(ends: tuple[int, int], count: int) -> tuple[Tensor, Tensor]:
    """Of each place along a side of the wider grid: the one within the ends that it shows, and whether turned round."""
    low, high = ends
    place = (torch.arange(-LAND, count + LAND) - low) % (2 * (high - low))
    turned = place >= high - low
    return low + torch.where(turned, 2 * (high - low) - 1 - place, place), turned.int()


def _seen(world: World, top: NDArray[np.float64]) -> Tensor:
    """``(X, Y, Z)`` the index grid without bricks that lie under all that is near by."""
    nx, ny, nz = world.index.shape
    heights = torch.from_numpy(top).reshape(nx, BRICK, nz, BRICK).amin(dim=(1, 3))[None, None]
    lowest = -torch.nn.functional.max_pool2d(-heights, 3, stride=1, padding=1)[0, 0]
    level = (lowest - DEEP - world.origin[1]) / BRICK
    kept = torch.arange(1, ny + 1)[:, None] > level[:, None]
    return torch.where(kept, world.index, 0)


def _with_cubes(world: World, places: NDArray[np.int64], ids: NDArray[np.int16]) -> World:
    """A world with more voxels where it had none: ``(N, 3)`` world coordinates and ``(N,)`` what they are."""
    cells, inner = np.divmod(places - np.array(world.origin), BRICK)
    inside = ((cells >= 0) & (cells < np.array(world.index.shape))).all(axis=1)
    cells, inner, ids = cells[inside], inner[inside], ids[inside]
    used, number = np.unique(np.ravel_multi_index(tuple(cells.T), tuple(world.index.shape)), return_inverse=True)
    index = world.index.flatten().clone()
    more = world.bricks[index[torch.from_numpy(used)].long()].cpu().numpy()
    there = (number, *inner.T)
    more[there] = np.where(more[there] > 0, more[there], ids)
    index[torch.from_numpy(used)] = torch.arange(len(used), dtype=torch.int32) + len(world.bricks)
    bricks = torch.cat([world.bricks, torch.from_numpy(more)])
    return replace(world, bricks=bricks, index=index.view_as(world.index), shining=None)
