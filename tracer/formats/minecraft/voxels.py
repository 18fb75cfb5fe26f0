"""Blocks as 8 x 8 x 8 voxels: boxes and plates of them."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

SIDE = 8  # voxels along a block
Mask = NDArray[np.bool_]
Shape = tuple[tuple[str, Mask], ...]
"""Parts: the block whose colour a part has, and its voxels ``(8, 8, 8)`` in the order x, y, z."""


@cache
def box(x0: int, y0: int, z0: int, x1: int, y1: int, z1: int) -> Mask:
    """A box of voxels, in eighths of a block."""
    mask = np.zeros((SIDE,) * 3, bool)
    mask[x0:x1, y0:y1, z0:z1] = True
    return mask


def beside(side: str, depth: int) -> Mask:
    """A plate on one side of a block, ``depth`` eighths thick; north is -z, east +x."""
    return {
        "west": box(0, 0, 0, depth, 8, 8),
        "east": box(8 - depth, 0, 0, 8, 8, 8),
        "north": box(0, 0, 0, 8, 8, depth),
    }.get(side, box(0, 0, 8 - depth, 8, 8, 8))
