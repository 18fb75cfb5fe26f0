"""Chunks as sections of 16 x 16 x 16 block states and biomes, in every packing from 1.8 to 26.3."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.legacy import legacy_biome, legacy_state
from tracer.formats.minecraft.nbt import Tags, part

FLATTENED = 1451  # data version of 17w47a: before it blocks are numbers
PADDED = 2529  # data version of 20w17a: from there on no value spans two longs
COUNT = 4096
PART = 1 << 16  # numbers that are unpacked at a time; they begin with a long
LOWEST, HIGHEST = -128, 127  # a section's Y is a byte

Numbers = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Section:
    """16 x 16 x 16 blocks.

    Args:
        y: in sections; blocks from ``16 y``.
        states: S block states, such as ``minecraft:oak_log[axis=y]``.
        blocks: ``(4096,)`` in the order y, z, x: which state; or one number for all.
        biomes: B names.
        biome: ``(16, 16, 16)`` in the order y, z, x, which biome; None where all is the first.
    """

    y: int
    states: tuple[str, ...]
    blocks: Numbers
    biomes: tuple[str, ...]
    biome: Numbers | None


def sections(chunk: Tags) -> Iterator[Section]:
    """The sections of a chunk that hold blocks, in the file's order.

    Raises:
        ValueError: something in it breaks the format.
    """
    version = version_of(chunk)
    level, name = level_of(chunk)
    for tags in part(level, name, list) if name in level else []:
        y = int(part(tags, "Y", int))
        if not LOWEST <= y <= HIGHEST:
            raise ValueError(f"Y of a section must lie in {LOWEST}..{HIGHEST}, got {y}")
        found = _blocks(tags, version)
        if found is not None:
            biomes, biome = _biomes(level, tags, y)
            yield Section(y=y, states=found[0], blocks=found[1], biomes=biomes, biome=biome)


def level_of(chunk: Tags) -> tuple[Tags, str]:
    """The part of a chunk that may hold sections of blocks, and the name that they have in it.

    Raises:
        ValueError: it is of the game's folders entities or poi, or its level is no compound.
    """
    level = part(chunk, "Level", dict) if "Level" in chunk else chunk
    name = "sections" if "sections" in level else "Sections"
    if "Entities" in chunk or isinstance(level.get(name), dict):
        raise ValueError("it holds entities or points of interest, no blocks; give the file of that name in region")
    return level, name


def version_of(tags: Tags) -> int:
    """The game's data version that wrote a chunk or schematic; 0 from before 1.9, which did not write it.

    Raises:
        ValueError: it is no whole number.
    """
    return int(part(tags, "DataVersion", int)) if "DataVersion" in tags else 0


def unpack(longs: Any, bits: int, count: int, *, padded: bool) -> Numbers:
    """Numbers of ``bits`` bits, the lowest first, from longs.

    Args:
        longs: an array of 64-bit integers.
        bits: 1 to 32.
        count: how many there are.
        padded: whether a long holds whole numbers only, its highest bits being unused; else numbers go on in the next.

    Raises:
        ValueError: there are not as many longs as that takes.
    """
    words = np.asarray(longs).astype(np.int64).view(np.uint64)
    each = 64 // bits
    needed = -(-count // each) if padded else -(-count * bits // 64)
    if words.size != needed:
        raise ValueError(f"{count} numbers of {bits} bits take {needed} longs, got {words.size}")
    if padded:
        shifts = np.arange(each, dtype=np.uint64) * np.uint64(bits)
        return ((words[:, None] >> shifts) & np.uint64((1 << bits) - 1)).reshape(-1)[:count].astype(np.int64)
    numbers, places = np.empty(count, np.int64), 1 << np.arange(bits, dtype=np.int64)
    for first in range(0, count, PART):  # each bit takes eight bytes on the way
        some = words[first * bits // 64 : -(-(first + PART) * bits // 64)].astype("<u8").view(np.uint8)
        here = numbers[first : first + PART]
        here[:] = np.unpackbits(some, bitorder="little")[: len(here) * bits].reshape(len(here), bits) @ places
    return numbers


def nibbles(packed: Any) -> Numbers:
    """4096 numbers of four bits, the low half of each byte first.

    Raises:
        ValueError: not 2048 bytes.
    """
    pairs = np.asarray(packed).view(np.uint8)
    if pairs.size != COUNT // 2:
        raise ValueError(f"4096 half bytes take 2048 bytes, got {pairs.size}")
    return np.stack([pairs & 15, pairs >> 4], axis=1).reshape(-1).astype(np.int64)


def state_name(entry: Any) -> str:
    """A palette entry as one string; see `state_of`.

    Since 26.3 an entry is a name alone where all properties have their defaults, which NBT wraps in a compound where
    others of the list are compounds, or tells the properties that have not.
    """
    if isinstance(entry, dict) and "" in entry:
        entry = entry[""]
    if isinstance(entry, str):
        return str(entry)
    name, told = ("id", "properties") if isinstance(entry, dict) and "id" in entry else ("Name", "Properties")
    properties = entry.get(told) if isinstance(entry, dict) else None
    return state_of(str(part(entry, name, str)), properties if isinstance(properties, dict) else {})


def state_of(name: str, properties: Mapping[str, Any]) -> str:
    """A block state as one string: ``minecraft:oak_log[axis=y]``, properties in alphabetic order."""
    listed = ",".join(f"{key}={properties[key]}" for key in sorted(properties))
    return f"{name}[{listed}]" if listed else name


def _blocks(tags: Tags, version: int) -> tuple[tuple[str, ...], Numbers] | None:
    if "Blocks" in tags:
        return _numeric(tags)
    where = part(tags, "block_states", dict) if "block_states" in tags else tags
    names = [key for key in ("palette", "Palette") if key in where]
    if not names:
        return None  # the game keeps light above the highest block in sections of their own
    states = tuple(state_name(entry) for entry in part(where, names[0], list))
    data = where.get("data", where.get("BlockStates"))
    if not 0 < len(states) <= COUNT:
        raise ValueError(f"a palette must have 1 to {COUNT} entries, got {len(states)}")
    if data is None:
        return states, np.zeros(1, np.int64)
    bits = max(4, (len(states) - 1).bit_length())
    blocks = unpack(part({"data": data}, "data", np.ndarray), bits, COUNT, padded=version >= PADDED)
    return states, _within(blocks, len(states))


def _numeric(tags: Tags) -> tuple[tuple[str, ...], Numbers]:
    """Before 1.13: a number and four bits of data for each block, and four more bits of the number from mods."""
    low = np.asarray(part(tags, "Blocks", np.ndarray)).view(np.uint8).astype(np.int64)
    if low.size != COUNT:
        raise ValueError(f"Blocks must have 4096 bytes, got {low.size}")
    high = nibbles(part(tags, "Add", np.ndarray)) if "Add" in tags else 0
    full = (high << 12) | (low << 4) | nibbles(part(tags, "Data", np.ndarray))
    numbers, blocks = _told_apart(full)
    return tuple(legacy_state(int(n) >> 4, int(n) & 15) for n in numbers), blocks


def _biomes(level: Tags, tags: Tags, y: int) -> tuple[tuple[str, ...], Numbers | None]:
    """Names and numbers: by 4 x 4 x 4 blocks since 1.15, by columns before."""
    if "biomes" in tags:
        own = part(tags, "biomes", dict)
        names = tuple(str(name) for name in part(own, "palette", list))
        if len(names) < 2 or "data" not in own:
            return names[:1] or ("minecraft:plains",), None
        numbers = unpack(part(own, "data", np.ndarray), (len(names) - 1).bit_length(), 64, padded=True)
        return names, _spread(_within(numbers, len(names)).reshape(4, 4, 4))
    stored = level.get("Biomes")
    numbers = np.asarray(stored).astype(np.int64) & 255 if isinstance(stored, np.ndarray) else np.zeros(0, np.int64)
    if numbers.size == 256:
        columns = np.broadcast_to(numbers.reshape(1, 16, 16), (16, 16, 16))
    elif numbers.size == 1024 and 0 <= y < 16:
        columns = _spread(numbers.reshape(-1, 4, 4)[4 * y : 4 * y + 4])
    else:
        return ("minecraft:plains",), None
    used, which = _told_apart(columns.reshape(-1))
    return tuple(legacy_biome(int(n)) for n in used), which.reshape(16, 16, 16)


def _told_apart(numbers: Numbers) -> tuple[Numbers, Numbers]:
    """`np.unique` of small numbers, with inverse, without sorting."""
    there = np.bincount(numbers) > 0
    return np.flatnonzero(there), (np.cumsum(there) - 1)[numbers]


def _spread(coarse: Numbers) -> Numbers:
    return coarse.repeat(4, axis=0).repeat(4, axis=1).repeat(4, axis=2)


def _within(numbers: Numbers, count: int) -> Numbers:
    if int(numbers.max()) >= count:
        raise ValueError(f"a palette of {count} entries has no entry {int(numbers.max())}")
    return numbers
