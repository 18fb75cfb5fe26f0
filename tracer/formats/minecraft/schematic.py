"""Schematics: Sponge's ``.schem``, versions 1 to 3, and MCEdit's ``.schematic``."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.build import Blocks, Builder
from tracer.formats.minecraft.legacy import AIR, legacy_state
from tracer.formats.minecraft.nbt import Tags, part, read_nbt
from tracer.formats.minecraft.pack.archive import PackError
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.save import tell_unknown
from tracer.formats.minecraft.sections import Section
from tracer.scene.grids import BRICK
from tracer.scene.placement import place
from tracer.scene.scene import Scene

MAX_FILE = 1 << 26  # bytes, decompressed
MAX_BLOCKS = 1 << 25
BIOME = ("minecraft:plains",)

Numbers = NDArray[np.int32]


def load_schematic(path: str | PathLike[str], pack: str | PathLike[str] | None = None) -> Scene:
    """A schematic on ground under the sky; see `read_schematic` for errors, and `tracer.scene.placement.place`."""
    blocks = read_schematic(path, pack)
    return replace(place(blocks.world), instances=blocks.instances)


def read_schematic(path: str | PathLike[str], pack: str | PathLike[str] | None = None) -> Blocks:
    """The blocks of a schematic, its low corner at the origin, with the textures of a ``pack`` if one is given.

    Raises:
        ValueError: damaged, of an unknown version, too large, or nothing but air; names the file.
        FileNotFoundError: there is no such file.
    """
    path, builder = Path(path), Builder(None if pack is None else Pack(pack))
    try:
        root = root_of(path)
        sides = [int(part(root, side, int)) & 0xFFFF for side in ("Height", "Length", "Width")]
        volume = sides[0] * sides[1] * sides[2]
        if not 0 < volume <= MAX_BLOCKS:
            raise ValueError(f"it must have 1 to {MAX_BLOCKS} blocks, got {sides[2]} x {sides[0]} x {sides[1]}")
        states, numbers = _sponge(root, volume) if "Version" in root else _mcedit(root, volume)
        blocks = _built(builder, states, numbers.reshape(sides))
    except PackError:
        raise
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    tell_unknown(path, blocks)
    return blocks


def root_of(path: Path) -> Tags:
    """The tags that tell of a schematic, of whatever version; raises as `read_schematic`."""
    tags = read_nbt(path, limit=MAX_FILE)
    return part(tags, "Schematic", dict) if "Schematic" in tags else tags


def _sponge(root: Tags, volume: int) -> tuple[list[str], Numbers]:
    version = int(part(root, "Version", int))
    if version not in (1, 2, 3):
        raise ValueError(f"Version must be 1, 2 or 3, got {version}")
    where, key = (part(root, "Blocks", dict), "Data") if version == 3 else (root, "BlockData")
    palette = part(where, "Palette", dict)
    names = {int(number): str(state) for state, number in palette.items() if isinstance(number, int)}
    numbers = varints(np.asarray(part(where, key, np.ndarray)).view(np.uint8))
    if numbers.size != volume:
        raise ValueError(f"{key} holds {numbers.size} blocks, but the sides make {volume}")
    used, which = np.unique(numbers, return_inverse=True)
    if missing := [int(n) for n in used if int(n) not in names]:
        raise ValueError(f"the palette lacks number {missing[0]}")
    return [names[int(n)] for n in used], which.astype(np.int32)


def varints(data: NDArray[np.uint8]) -> Numbers:
    """Numbers of seven bits a byte, the lowest first; the highest bit says that more follow.

    Raises:
        ValueError: one has more than four bytes, or the last one does not end.
    """
    last = data < 128
    if data.size and not last[-1]:
        raise ValueError("block numbers are truncated")
    ends = np.flatnonzero(last)
    starts = np.concatenate([[0], ends[:-1] + 1]) if len(ends) else ends
    if np.any(ends - starts > 3):
        raise ValueError("a block number has more than four bytes")
    place = np.arange(data.size) - starts.repeat(ends - starts + 1)
    values = (data & 127).astype(np.int32) << (7 * place).astype(np.int32)
    return np.add.reduceat(values, starts) if len(starts) else values


def _mcedit(root: Tags, volume: int) -> tuple[list[str], Numbers]:
    low, data = (np.asarray(part(root, key, np.ndarray)).view(np.uint8) for key in ("Blocks", "Data"))
    if low.size != volume or data.size != volume:
        raise ValueError(f"Blocks and Data hold {low.size} and {data.size} blocks, but the sides make {volume}")
    full = low.astype(np.int32) << 4 | (data & 15)
    if "AddBlocks" in root:
        pairs = np.asarray(part(root, "AddBlocks", np.ndarray)).view(np.uint8)
        high = np.stack([pairs >> 4, pairs & 15], axis=1).reshape(-1)[:volume].astype(np.int32)
        if high.size != volume:
            raise ValueError(f"AddBlocks holds {high.size} blocks, but the sides make {volume}")
        full |= high << 12
    used, which = np.unique(full, return_inverse=True)
    return [legacy_state(int(n) >> 4, int(n) & 15) for n in used], which.astype(np.int32)


def _built(builder: Builder, states: list[str], blocks: Numbers) -> Blocks:
    """Blocks in the order y, z, x, cut into sections and filled up with air."""
    padded = np.pad(blocks, [(0, -side % BRICK) for side in blocks.shape], constant_values=len(states))
    names = [*states, AIR]
    for y, z, x in np.ndindex(*(side // BRICK for side in padded.shape)):
        cut = padded[tuple(slice(BRICK * n, BRICK * (n + 1)) for n in (y, z, x))]
        used, which = np.unique(cut, return_inverse=True)
        section = Section(y=y, states=tuple(names[n] for n in used), blocks=which.reshape(-1), biomes=BIOME, biome=None)
        builder.add(x, z, section)
    return builder.build()
