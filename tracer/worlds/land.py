"""The valley's ground: heights, rock strata, soil, lake, river and waterfall."""

from __future__ import annotations

import numpy as np

from tracer.worlds.canvas import Canvas
from tracer.worlds.fields import Field, fractal_noise, smoothstep, terraces, value_noise

SIZE = (256, 96, 256)
WATER = 24  # the first voxel layer above the lake's surface
VILLAGE = 28  # the first voxel layer above the village's ground
FALL_Z = 62  # where the river drops over the cliff


def river_x(z: Field) -> Field:
    """The river's middle at ``z``."""
    return 104.0 + 9.0 * np.sin(np.asarray(z) / 17.0)


def _plan() -> tuple[Field, Field]:
    x, z = np.indices((SIZE[0], SIZE[2])).astype(np.float64) + 0.5
    return x, z


def _inside(low: tuple[float, float], high: tuple[float, float], soft: float, x: Field, z: Field) -> Field:
    """1 in a rectangle of the plan, falling to 0 over ``soft`` voxels outside."""
    dx = np.maximum(np.maximum(low[0] - x, x - high[0]), 0.0)
    dz = np.maximum(np.maximum(low[1] - z, z - high[1]), 0.0)
    return 1.0 - smoothstep(0.0, soft, np.hypot(dx, dz))


def heights(rng: np.random.Generator) -> Field:
    """``(256, 256)`` ground heights, in voxels."""
    x, z = _plan()
    plan = (SIZE[0], SIZE[2])
    rough, broad, warp = (fractal_noise(plan, c, rng) for c in (26.0, 70.0, 38.0))
    h = 28.5 + 2.2 * rough + 2.5 * broad
    north = smoothstep(88.0, 30.0, z + 15.0 * warp + 0.10 * np.abs(x - 128.0))
    h += north * (37.0 + 13.0 * broad + 7.0 * rough)
    h += smoothstep(216.0, 254.0, x + 9.0 * warp) * (22.0 + 10.0 * rough)
    h += smoothstep(34.0, 2.0, x + 9.0 * warp) * (20.0 + 10.0 * rough)
    h += smoothstep(232.0, 256.0, z + 7.0 * warp) * 13.0
    h = np.where(h > 31.0, terraces(h - 31.0, 7.0) + 31.0 + 0.6 * rough, h)
    hill = np.hypot((x - 44.0) / 30.0, (z - 112.0) / 27.0)
    h = np.maximum(h, 27.0 + 17.5 * (1.0 - smoothstep(0.22, 1.0, hill)))
    for low, high, level, soft in _AT_LEAST:
        h += np.maximum(level + 2.5 * rough - h, 0.0) * _inside(low, high, soft, x, z)
    for low, high, level, soft in _LEVELS:
        h += (level - h) * _inside(low, high, soft, x, z)
    return _carve(h, x, z, warp)


_LEVELS = (
    ((159.0, 98.0), (224.0, 182.0), VILLAGE, 10.0),
    ((163.0, 74.0), (212.0, 98.0), VILLAGE + 3, 7.0),
    ((145.0, 60.0), (156.0, 112.0), VILLAGE, 4.0),
    ((124.0, 101.0), (142.0, 117.0), VILLAGE, 6.0),
    ((36.0, 104.0), (52.0, 120.0), 44.0, 5.0),
)
"""Level places: low and high corner in x and z, height, and how softly they blend into the land."""

_AT_LEAST = (
    ((78.0, 0.0), (124.0, 58.0), 60.0, 9.0),
    ((112.0, 8.0), (166.0, 50.0), 56.0, 9.0),
)
"""As `_LEVELS`, for places that are only ever raised: the waterfall's plateau, the rock over the cave."""


def _carve(h: Field, x: Field, z: Field, warp: Field) -> Field:
    lake = np.hypot((x - 98.0) / 55.0, (z - 152.0) / 41.0) + 0.09 * warp
    beach = WATER + 0.4 + 5.0 * np.maximum(lake - 1.0, 0.0)
    h = h + (np.minimum(h, beach) - h) * (1.0 - smoothstep(1.02, 1.30, lake))
    h = np.where(lake < 1.0, np.minimum(h, WATER - 1.2 - 10.0 * np.maximum(1.0 - lake, 0.0) ** 0.8), h)
    away = np.abs(x - river_x(z)) + 1.2 * warp
    low = smoothstep(11.0, 5.0, away) * (z > FALL_Z) * (z < 130.0)
    h = h + (np.minimum(h, WATER - 3.0) - h) * low
    high = smoothstep(7.0, 4.0, away) * (z <= FALL_Z)
    return h + (np.minimum(h, UPPER - 2.0) - h) * high


UPPER = 56  # the first voxel layer above the upper river's surface


def paint(canvas: Canvas, height: Field, rng: np.random.Generator) -> None:
    """Fill rock, soil, turf, sand and water under and over ``height``."""
    top = np.clip(np.rint(height).astype(int), 4, SIZE[1] - 2)
    y = np.arange(SIZE[1])[None, :, None]
    strata = canvas.ids(("rock", "rock_dark", "rock", "rock_warm", "rock_pale", "rock_warm"))
    bend = value_noise((SIZE[0], SIZE[2]), 34.0, rng) * 5.0 + value_noise((SIZE[0], SIZE[2]), 9.0, rng) * 1.2
    layer = ((y + np.rint(bend)[:, None, :].astype(int)) // 3) % len(strata)
    cover, under = _cover(canvas, height, top, rng)
    under_water = top <= WATER
    depth = top[:, None, :] - y
    ids = np.where(depth > 3, strata[layer], under[:, None, :])
    ids = np.where(depth == 1, cover[:, None, :], ids)
    canvas.voxels[...] = np.where(depth > 0, ids, 0)
    wet = (depth <= 0) & (y < WATER) & under_water[:, None, :]
    canvas.voxels[wet] = canvas.id("water")
    _upper_river(canvas, top)


def _cover(canvas: Canvas, height: Field, top: Field, rng: np.random.Generator) -> tuple[Field, Field]:
    """Ids of the top layer and of the three below it."""
    plan = (SIZE[0], SIZE[2])
    gx, gz = np.gradient(height)
    steep = np.hypot(gx, gz)
    patch, fine = value_noise(plan, 17.0, rng), rng.uniform(-1.0, 1.0, plan)
    green = canvas.ids(("moss", "grass", "grass", "meadow"))
    cover = green[np.clip(((patch + 0.35 * fine) * 1.6 + 2.0).astype(int), 0, 3)]
    cover = np.where((top > 63) & (steep < 1.6), canvas.id("snow"), cover)
    bare = steep > 1.15
    stone = np.where(fine > 0.2, canvas.id("rock"), canvas.id("rock_warm"))
    cover = np.where(bare, stone, cover)
    sandy = (top <= WATER + 1) & ~bare
    cover = np.where(sandy, canvas.id("sand"), cover)
    cover = np.where(top < WATER - 4, canvas.ids(("silt", "sand"))[(fine > 0.5).astype(int)], cover)
    under = np.where(bare, stone, np.where(sandy, canvas.id("sand"), canvas.id("dirt")))
    return cover, under


def _upper_river(canvas: Canvas, top: Field) -> None:
    """The river on the plateau and the sheet of water that falls from it."""
    x, z = _plan()
    away = np.abs(x - river_x(z))
    bed = (away < 4.5) & (z <= FALL_Z) & (top < UPPER) & (top > WATER + 12)
    for i, k in np.argwhere(bed):
        canvas.box((i, int(top[i, k]), k), (i + 1, UPPER, k + 1), "water", into_air=True)
    lip = int(np.max(np.nonzero(bed.any(axis=0))[0])) + 1 if bed.any() else FALL_Z
    middle = int(river_x(np.array(float(lip))))
    for i in range(middle - 4, middle + 5):
        canvas.box((i, WATER - 2, lip), (i + 1, UPPER, lip + 1), "foam" if i % 4 == 1 else "water", into_air=True)
        canvas.box((i, WATER, lip + 1), (i + 1, WATER + 1 + (i * 5) % 3, lip + 2), "foam", into_air=True)
