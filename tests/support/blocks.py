"""Blocks of a section by their states, what they fill and what of them glows."""

from __future__ import annotations

import numpy as np

from tracer.formats.minecraft.build import Builder
from tracer.formats.minecraft.sections import Section


def cubes_of(*states: str) -> Builder:
    """A section whose first blocks have these states; the rest is air."""
    builder = Builder()
    blocks = np.zeros(4096, np.int64)
    blocks[: len(states)] = np.arange(1, len(states) + 1)
    builder.add(0, 0, Section(y=0, states=("minecraft:air", *states), blocks=blocks, biomes=("plains",), biome=None))
    return builder


def shape_and_glow(state: str) -> tuple[np.ndarray, np.ndarray]:
    """Which eighths of a block are filled, and which glow."""
    blocks = cubes_of(f"minecraft:{state}").build()
    assert blocks.shaped is not None
    ids = blocks.shaped.model.bricks.max(dim=0).values[:8, :8, :8]
    return (ids > 0).numpy(), (blocks.shaped.model.materials.emission.amax(dim=1) > 0)[ids.long()].numpy()
