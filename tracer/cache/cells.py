"""Cells of a cache: faces of voxels and of cubes of four voxels a side, and their keys."""

from __future__ import annotations

import torch
from torch import Tensor

SIDES = (1.0, 4.0)  # world units: a voxel, and what stands in for it where few paths come
FINE, COARSE = 0, 1  # their levels
BITS = 19  # of each coordinate of a cell: what lies half a million cells apart shares a key


def cells(positions: Tensor, normals: Tensor, side: float, level: int) -> Tensor:
    """``(N,)`` int64 keys of the cells of a level in which places lie: the face that the normal is nearest to, and the
    cube."""
    axis = normals.abs().argmax(dim=1)
    face = 2 * axis + (normals.gather(1, axis[:, None])[:, 0] > 0)
    return _packed(face + 6 * level, torch.floor(positions.double() / side).long())


def level_of(keys: Tensor) -> Tensor:
    """``(N,)`` level of each cell."""
    return (keys >> 3 * BITS) // 6


def around(keys: Tensor, side: int | None = None) -> Tensor:
    """``(N,)`` keys of the coarse cells that fine ones lie in; or of the cubes of a ``side``, a power of two of world
    units, that coarse cells lie in, whichever way they face."""
    half, mask = 1 << (BITS - 1), (1 << BITS) - 1
    places = torch.stack([((keys >> BITS * shift & mask) ^ half) - half for shift in (2, 1, 0)], dim=1)
    if side is None:
        return _packed((keys >> 3 * BITS) + 6, torch.div(places, round(SIDES[1] / SIDES[0]), rounding_mode="floor"))
    return _packed(torch.zeros_like(keys), torch.div(places, round(side / SIDES[1]), rounding_mode="floor"))


def _packed(first: Tensor, places: Tensor) -> Tensor:
    """``(N,)`` keys of ``first`` and three coordinates ``(N, 3)``."""
    for coordinate in places.unbind(dim=1):
        first = (first << BITS) + (coordinate & ((1 << BITS) - 1))
    return first
