"""Litematica's ``.litematic``: regions of blocks, each with a palette, anywhere beside each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.nbt import Tags, part
from tracer.formats.minecraft.sections import state_name, unpack
from tracer.formats.minecraft.structures.grid import Structure, checked, empty, number_of

AXES = ("y", "z", "x")
LEAST_BITS = 2


def litematic(root: Tags) -> Structure:
    """The blocks of all regions; where regions overlap, a later one's blocks hide those of one before.

    Raises:
        ValueError: something in it breaks the format, or it is too large.

    Source: the public description of the format in Litematica's and litemapy's documentation.
    """
    regions = _regions(root)
    corners, sizes = extents(root)
    low = np.min(corners, axis=0)
    high = np.max(np.add(corners, sizes), axis=0)
    for size in (*sizes, high - low):
        checked([int(n) for n in size])
    names, whole = empty([int(n) for n in high - low])
    for region, corner, size in zip(regions, corners, sizes, strict=True):
        own, blocks = _blocks(region, [int(n) for n in size])
        place = tuple(slice(int(a), int(a + n)) for a, n in zip(corner - low, size, strict=True))
        numbers = np.array([number_of(name, names) for name in own], np.int32)[blocks]
        whole[place] = np.where(numbers > 0, numbers, whole[place])
    return list(names), whole


def extents(root: Tags) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """``(N, 3)`` low corners and sizes of all regions along y, z and x; raises as `litematic`."""
    corners, sizes = zip(*(_extent(region) for region in _regions(root)), strict=True)
    return np.array(corners), np.array(sizes)


def _regions(root: Tags) -> list[Tags]:
    regions = part(root, "Regions", dict)
    if not regions:
        raise ValueError("it holds no regions")
    return [part(regions, name, dict) for name in regions]


def _extent(region: Tags) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Low corner and size along y, z and x: sides may count down from the position."""
    position, size = (
        np.array([int(part(part(region, key, dict), axis, int)) for axis in AXES]) for key in ("Position", "Size")
    )
    return np.where(size < 0, position + size + 1, position), np.abs(size)


def _blocks(region: Tags, sides: list[int]) -> tuple[list[str], NDArray[np.int64]]:
    names = [state_name(entry) for entry in part(region, "BlockStatePalette", list)]
    bits = max(LEAST_BITS, (len(names) - 1).bit_length())
    count = int(np.prod(sides))
    numbers = unpack(part(region, "BlockStates", np.ndarray), bits, count, padded=False)
    if int(numbers.max()) >= len(names):
        raise ValueError(f"a palette of {len(names)} entries has no entry {int(numbers.max())}")
    return names, numbers.reshape(sides)
