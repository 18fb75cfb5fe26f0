"""Maps of heights: the ground plan of a world, with what lies on top."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracer.scene.grids import BRICK
from tracer.scene.scene import Instance
from tracer.scene.world import World

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class HeightMap:
    """Heights over the ground plan.

    Args:
        top: ``(X, Z)`` upper side of the highest voxel of each column; -inf where there is none.
        kind: ``(X, Z)`` its material.
        x0: of the first column.
        z0: of the first column.
        beyond: height and material where the map ends.
        roof: ``(X, Z)`` the underside of what lies over it, inf where nothing does; None under the open sky.
    """

    top: Floats
    kind: NDArray[np.int64]
    x0: int
    z0: int
    beyond: tuple[float, int] = (-math.inf, 0)
    roof: Floats | None = None

    def at(self, x: Floats, y: Floats, z: Floats) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Whether places lie in the ground, or in the roof, and the material of their column."""
        i, j = np.floor(x).astype(np.int64) - self.x0, np.floor(z).astype(np.int64) - self.z0
        inside = (i >= 0) & (j >= 0) & (i < self.top.shape[0]) & (j < self.top.shape[1])
        i, j = np.where(inside, i, 0), np.where(inside, j, 0)
        height, kind = self.beyond
        filled = y < np.where(inside, self.top[i, j], height)
        if self.roof is not None:
            filled |= inside & (y >= self.roof[i, j])
        return filled, np.where(inside, self.kind[i, j], kind)

    def going_on(self) -> HeightMap:
        """This map where what lies beyond is as high as most of it, and of its most common material."""
        land = np.isfinite(self.top)
        return replace(self, beyond=(float(np.median(self.top[land])), int(np.bincount(self.kind[land]).argmax())))

    def highest(self, i: int, j: int, reach: int) -> float:
        """The highest within ``reach`` columns of one; -inf where there is none."""
        return float(
            self.top[max(i - reach, 0) : i + reach + 1, max(j - reach, 0) : j + reach + 1].max(initial=-np.inf)
        )

    def lowest_roof(self, i: int, j: int, reach: int) -> float:
        """The lowest underside within ``reach`` columns of one; inf where nothing lies over them."""
        if self.roof is None:
            return math.inf
        return float(self.roof[max(i - reach, 0) : i + reach + 1, max(j - reach, 0) : j + reach + 1].min())

    def surface(self) -> Floats:
        """``(N, 3)`` corners of the highest voxel of each column."""
        x, z = np.nonzero(np.isfinite(self.top))
        low = np.stack([x + self.x0, self.top[x, z] - 1, z + self.z0], axis=1).astype(np.float64)
        return (low[:, None] + np.array(list(np.ndindex(2, 2, 2)))).reshape(-1, 3)


def heights_of(world: World) -> HeightMap:
    """The heights of a world's voxels."""
    bricks, index = world.bricks.cpu().numpy(), world.index.cpu().numpy()
    level = BRICK - 1 - np.argmax(bricks[:, :, ::-1] > 0, axis=2)  # of each column of each brick
    kind = np.take_along_axis(bricks, level[:, :, None], axis=2)[:, :, 0]
    nx, ny, nz = index.shape
    top, kinds = np.full((nx, nz, BRICK, BRICK), -np.inf), np.zeros((nx, nz, BRICK, BRICK), np.int64)
    for y in range(ny):  # from below: what is higher covers it
        layer = index[:, y]
        found = kind[layer] > 0
        top = np.where(found, level[layer] + (world.origin[1] + BRICK * y + 1.0), top)
        kinds = np.where(found, kind[layer], kinds)
    whole = (nx * BRICK, nz * BRICK)
    return HeightMap(
        top=top.transpose(0, 2, 1, 3).reshape(whole),
        kind=kinds.transpose(0, 2, 1, 3).reshape(whole),
        x0=world.origin[0],
        z0=world.origin[2],
    )


def full_blocks(shapes: Instance) -> tuple[NDArray[np.int64], NDArray[np.int16]]:
    """``(N, 3)`` blocks of an instance that fill their upper side, as leaves do and plants do not; their materials."""
    model, side = shapes.model, round(1 / shapes.scale)
    bricks, index, each = model.bricks.cpu().numpy(), model.index.cpu().numpy(), BRICK // side
    upper = bricks[:, :, side - 1 :: side].reshape(-1, each, side, each, each, side)  # x, y in blocks, z
    filled, kind = (upper > 0).mean(axis=(2, 5)) >= 0.5, upper.max(axis=(2, 5))
    cells = np.argwhere(index > 0)
    which = index[tuple(cells.T)]
    n, i, j, k = np.nonzero(filled[which])
    places = (np.array(model.origin) + BRICK * cells[n]) // side + np.stack([i, j, k], axis=1)
    return places, kind[which[n], i, j, k]


def raise_to(ground: HeightMap, shapes: Instance) -> None:
    """Raise a map to the blocks of an instance that fill their upper side."""
    places, kind = full_blocks(shapes)
    x, y, z = places.T
    inside = (x >= ground.x0) & (x < ground.x0 + len(ground.top)) & (z >= ground.z0)
    inside &= z < ground.z0 + ground.top.shape[1]
    upward = np.flatnonzero(inside)[np.argsort(y[inside], kind="stable")]  # what is higher is written later
    a, b, height = x[upward] - ground.x0, z[upward] - ground.z0, y[upward] + 1.0
    higher = height > ground.top[a, b]
    a, b = a[higher], b[higher]
    ground.top[a, b], ground.kind[a, b] = height[higher], kind[upward[higher]]


def caverns_of(world: World) -> HeightMap:
    """Floor and roof of the tallest closed space of each column."""
    bricks, index = world.bricks.cpu().numpy(), world.index.cpu().numpy()
    nx, ny, nz = index.shape
    shape = (nx, nz, BRICK, BRICK)
    under, run, height = np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape)  # of what is open so far
    top, kind = np.full(shape, -np.inf), np.zeros(shape, np.int64)
    for y in range(ny * BRICK):
        here = bricks[index[:, y // BRICK], :, y % BRICK]
        closes = (here > 0) & (run > height) & (under > 0)
        top, kind = np.where(closes, world.origin[1] + y - run, top), np.where(closes, under, kind)
        height = np.where(closes, run, height)
        under, run = np.where(here > 0, here, under), np.where(here > 0, 0.0, run + 1)
    top, kind, height = (a.transpose(0, 2, 1, 3).reshape(nx * BRICK, nz * BRICK) for a in (top, kind, height))
    roof = np.where(height > 0, top + height, np.inf)
    return HeightMap(top=top, kind=kind, x0=world.origin[0], z0=world.origin[2], roof=roof)
