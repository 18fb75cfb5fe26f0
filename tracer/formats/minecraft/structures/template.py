"""The game's own ``.nbt`` structures, as its structure blocks save them: a list of blocks with their places."""

from __future__ import annotations

import numpy as np

from tracer.formats.minecraft.nbt import Tags, part
from tracer.formats.minecraft.sections import state_name
from tracer.formats.minecraft.structures.grid import Structure, checked, empty, number_of


def template(root: Tags) -> Structure:
    """The blocks; of several palettes, of which the game chooses by chance, the first.

    Args:
        root: as `tracer.formats.minecraft.structures.skim.read_skimmed` gives it.

    Raises:
        ValueError: something in it breaks the format, or it is too large.
    """
    sides = size_of(root)
    checked(sides)
    height, length, width = sides
    entries = part(root, "palette", list) if "palette" in root else next(iter(part(root, "palettes", list)), [])
    if not isinstance(entries, list):
        raise ValueError(f"palettes must hold lists, got {type(entries).__name__}")
    names, whole = empty(sides)
    numbers = np.array([number_of(state_name(entry), names) for entry in entries], np.int32)
    blocks = root["blocks"]
    if not isinstance(blocks, np.ndarray):  # a list of nothing, or of what is no block
        blocks = _listed(part(root, "blocks", list))
    places, states = blocks[:, :3], blocks[:, 3]
    outside = ((places < 0) | (places >= np.array([width, height, length]))).any(axis=1)
    if outside.any():
        x, y, z = places[outside][0].tolist()
        raise ValueError(f"a block lies at {x}, {y}, {z}, outside {width} x {height} x {length}")
    unknown = (states < 0) | (states >= len(numbers))
    if unknown.any():
        raise ValueError(f"a palette of {len(numbers)} entries has no entry {int(states[unknown][0])}")
    x, y, z = places.T
    whole[y, z, x] = numbers[states]
    return list(names), whole


def size_of(root: Tags) -> list[int]:
    """Sides along y, z and x."""
    width, height, length = _whole(root, "size")
    return [height, length, width]


def _listed(blocks: list[Tags]) -> np.ndarray:
    told = [[*_whole(block, "pos"), int(part(block, "state", int))] for block in blocks]
    return np.array(told, np.int64).reshape(-1, 4)


def _whole(tags: Tags, key: str) -> list[int]:
    found = part(tags, key, list)
    if len(found) != 3 or not all(isinstance(number, int) for number in found):
        raise ValueError(
            f"{key} must be three whole numbers, got {len(found)} of {type(next(iter(found), 0)).__name__}"
        )
    return [int(number) for number in found]
