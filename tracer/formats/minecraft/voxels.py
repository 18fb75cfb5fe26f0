"""Blocks as 8 x 8 x 8 voxels: boxes and plates of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

SIDE = 8  # voxels along a block
COMPASS = ("north", "east", "south", "west")  # each a quarter of a turn from the one before, seen from above
QUARTERS = {side: n for n, side in enumerate(COMPASS)} | {"x": 0, "z": 1}
"""Of a turn from facing north, or from axis x."""
ALONG = {"x": (0, 1), "east": (0, 1), "west": (0, 1), "z": (1, 2), "north": (1, 2), "south": (1, 2)}
"""Which axis changes places with the upright one where something lies along an axis or to a side."""
Mask = NDArray[np.bool_]
Shape = tuple[tuple[str, Mask], ...]
"""Parts: the block whose colour a part has, and its voxels ``(8, 8, 8)`` in the order x, y, z."""


@cache
def box(x0: int, y0: int, z0: int, x1: int, y1: int, z1: int) -> Mask:
    """A box of voxels, in eighths of a block."""
    mask = np.zeros((SIDE,) * 3, bool)
    mask[x0:x1, y0:y1, z0:z1] = True
    return mask


def boxes(corners: Iterable[Sequence[int]]) -> Mask:
    """All voxels of several boxes, each as for `box`."""
    return np.logical_or.reduce([box(*six) for six in corners])


def beside(side: str, depth: int) -> Mask:
    """A plate on one side of a block, ``depth`` eighths thick; north is -z, east +x."""
    return {
        "west": box(0, 0, 0, depth, 8, 8),
        "east": box(8 - depth, 0, 0, 8, 8, 8),
        "north": box(0, 0, 0, 8, 8, depth),
        "down": box(0, 0, 0, 8, depth, 8),
        "up": box(0, 8 - depth, 0, 8, 8, 8),
    }.get(side, box(0, 0, 8 - depth, 8, 8, 8))


def turned(mask: Mask, facing: str) -> Mask:
    """The voxels of what faces north, or is of axis x, when it faces another way."""
    return np.rot90(mask, QUARTERS.get(facing, 0), axes=(0, 2))


def laid(mask: Mask, along: str) -> Mask:
    """The voxels of what stands upright, when it lies along an axis, or from the side that ``along`` names."""
    return mask.swapaxes(*ALONG[along]) if along in ALONG else mask
