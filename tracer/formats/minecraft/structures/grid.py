"""A grid of blocks to put structures into: what is not told is air."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.legacy import AIR

MAX_BLOCKS = 1 << 25
NOTHING = (AIR, "minecraft:cave_air", "minecraft:void_air", "minecraft:structure_void")

Structure = tuple[list[str], NDArray[np.int32]]
"""Names of block states, and which of them is where, ``(Y, Z, X)``."""


def checked(sides: Sequence[int]) -> None:
    """Raise ValueError where sides along y, z and x make no grid, or one that is too large."""
    if not all(side > 0 for side in sides) or math.prod(sides) > MAX_BLOCKS:
        raise ValueError(f"it must have 1 to {MAX_BLOCKS} blocks, got {sides[2]} x {sides[0]} x {sides[1]}")


def empty(sides: Sequence[int]) -> tuple[dict[str, int], NDArray[np.int32]]:
    """Numbers of names, those of nothing being 0, and a grid of nothing."""
    return {AIR: 0}, np.zeros(tuple(sides), np.int32)


def number_of(name: str, names: dict[str, int]) -> int:
    """The number of a name, which is new if need be; all names of nothing have that of air."""
    return names.setdefault(AIR if name in NOTHING else name, len(names))
