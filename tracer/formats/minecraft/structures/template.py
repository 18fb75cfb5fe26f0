"""The game's own ``.nbt`` structures, as its structure blocks save them: a list of blocks with their places."""

from __future__ import annotations

from tracer.formats.minecraft.nbt import Tags, part
from tracer.formats.minecraft.sections import state_name
from tracer.formats.minecraft.structures.grid import Structure, checked, empty, number_of


def template(root: Tags) -> Structure:
    """The blocks; of several palettes, of which the game chooses by chance, the first.

    Raises:
        ValueError: something in it breaks the format, or it is too large.
    """
    width, height, length = _whole(root, "size")
    checked([height, length, width])
    entries = part(root, "palette", list) if "palette" in root else next(iter(part(root, "palettes", list)), [])
    if not isinstance(entries, list):
        raise ValueError(f"palettes must hold lists, got {type(entries).__name__}")
    names, whole = empty([height, length, width])
    numbers = [number_of(state_name(entry), names) for entry in entries]
    for block in part(root, "blocks", list):
        (x, y, z), state = _whole(block, "pos"), int(part(block, "state", int))
        if not (0 <= x < width and 0 <= y < height and 0 <= z < length):
            raise ValueError(f"a block lies at {x}, {y}, {z}, outside {width} x {height} x {length}")
        if not 0 <= state < len(numbers):
            raise ValueError(f"a palette of {len(numbers)} entries has no entry {state}")
        whole[y, z, x] = numbers[state]
    return list(names), whole


def _whole(tags: Tags, key: str) -> list[int]:
    found = part(tags, key, list)
    if len(found) != 3 or not all(isinstance(number, int) for number in found):
        raise ValueError(
            f"{key} must be three whole numbers, got {len(found)} of {type(next(iter(found), 0)).__name__}"
        )
    return [int(number) for number in found]
