"""A save of hills by a lake with torches on poles, wide enough to fly over."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from writers.region import chunk, section, write_region

STATES = (
    "minecraft:air",
    "minecraft:stone",
    "minecraft:grass_block",
    "minecraft:water",
    "minecraft:oak_fence",
    "minecraft:torch",
    "minecraft:poppy",
    "minecraft:glass",
)
AIR, STONE, GRASS, WATER, FENCE, TORCH, POPPY, GLASS = range(8)
LONG, WIDE, LEVEL = 40, 6, 9  # chunks along x, chunks along z, and the lake's height in blocks


def save_of_hills(folder: Path, *, lamps: bool = True) -> Path:
    """A save whose chunks lie in x 0..640 and z 0..96, in two regions; the ground is 4 to 16 blocks high."""
    for region in range(2):
        places = [(x, z) for x in range(32 * region, min(32 * region + 32, LONG)) for z in range(WIDE)]
        chunks = {place: chunk("1.18", *place, [_section(*place, lamps)]) for place in places}
        write_region(folder / "region" / f"r.{region}.0.mca", chunks)
    return folder


def _section(x: int, z: int, lamps: bool):
    i, k = np.arange(16) + 16 * x, np.arange(16) + 16 * z
    top = np.round(9 + 3 * np.sin(i / 11.0)[None, :] + 2.5 * np.cos(k / 7.0)[:, None]).astype(int)  # (z, x)
    y = np.arange(16)[:, None, None]
    blocks = np.where(y < top - 1, STONE, np.where(y < top, GRASS, np.where(y < LEVEL - 2, WATER, AIR)))
    blocks[15, 8, 8] = GLASS
    for n, kind in enumerate((POPPY, POPPY, TORCH if lamps and (x + z) % 3 == 0 else POPPY)):
        h = top[3 + 5 * n, 5]
        blocks[h, 3 + 5 * n, 5] = FENCE if kind == TORCH else kind
        if kind == TORCH:
            blocks[min(h + 1, 15), 3 + 5 * n, 5] = TORCH
    return section("1.18", 0, blocks, STATES)
