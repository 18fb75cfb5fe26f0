"""Schematics: Sponge's ``.schem``, MCEdit's ``.schematic``, Litematica's ``.litematic``, the game's own ``.nbt``."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.build import Blocks, Builder
from tracer.formats.minecraft.joined import joined
from tracer.formats.minecraft.legacy import AIR, legacy_state
from tracer.formats.minecraft.nbt import Tags, part
from tracer.formats.minecraft.pack.archive import PackError
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.save import tell_unknown
from tracer.formats.minecraft.sections import Section
from tracer.formats.minecraft.structures.grid import Structure, checked
from tracer.formats.minecraft.structures.litematic import extents, litematic
from tracer.formats.minecraft.structures.skim import read_skimmed
from tracer.formats.minecraft.structures.template import size_of, template
from tracer.scene.grids import BRICK
from tracer.scene.placement import place
from tracer.scene.scene import Scene

MAX_FILE = 1 << 26  # bytes, decompressed
SIGNS = frozenset(("Regions", "size", "blocks", "Width", "Height", "Length"))  # of any kind that is read

Numbers = NDArray[np.int32]
Named = tuple[list[str], Numbers]
PLAINS: Named = ["minecraft:plains"], np.zeros((1, 1, 1), np.int32)


def load_schematic(path: str | PathLike[str], pack: str | PathLike[str] | None = None) -> Scene:
    """A schematic on ground under the sky; see `read_schematic` for errors, and `tracer.scene.placement.place`."""
    blocks = read_schematic(path, pack)
    return place(blocks.world, blocks.instances)


def read_schematic(path: str | PathLike[str], pack: str | PathLike[str] | None = None) -> Blocks:
    """The blocks of a schematic, its low corner at the origin, with the textures of a ``pack`` if one is given.

    Raises:
        ValueError: damaged, of an unknown version, too large, or nothing but air; names the file.
        FileNotFoundError: there is no such file.
    """
    path, builder = Path(path), Builder(None if pack is None else Pack(pack))
    root = root_of(path)
    try:
        if (structure := structure_of(root)) is not None:
            (names, grid), biomes = structure, PLAINS
            named, sides = (names, grid.reshape(-1)), [*grid.shape]
        else:
            sides = [int(part(root, side, int)) & 0xFFFF for side in ("Height", "Length", "Width")]
            checked(sides)
            named, biomes = _sponge(root, sides) if "Version" in root else (_mcedit(root, sides), PLAINS)
        blocks = _built(builder, named, biomes, sides)
    except PackError:
        raise
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    tell_unknown(path, blocks)
    return blocks


def root_of(path: Path) -> Tags:
    """The tags that tell of a schematic, of whatever version; raises as `read_schematic`."""
    tags = read_skimmed(path, limit=MAX_FILE)
    root = part(tags, "Schematic", dict) if "Schematic" in tags else tags
    if SIGNS.isdisjoint(root):
        held = ", ".join([*root][:5]) or "nothing"
        raise ValueError(f"{path}: it is neither a schematic nor a structure: it holds {held}")
    return root


def structure_of(root: Tags) -> Structure | None:
    """The blocks of a Litematica schematic or of a structure of the game; None where it is neither.

    Raises:
        ValueError: something in it breaks the format, or it is too large.
    """
    if "Regions" in root:
        return litematic(root)
    return template(root) if "size" in root and "blocks" in root else None


def structure_sides(root: Tags) -> list[int] | None:
    """The sides along y, z and x of what `structure_of` would read, without its blocks; raises as that."""
    if "Regions" in root:
        corners, sizes = extents(root)
        return [int(n) for n in np.add(corners, sizes).max(axis=0) - np.min(corners, axis=0)]
    return size_of(root) if "size" in root and "blocks" in root else None


def _sponge(root: Tags, sides: list[int]) -> tuple[Named, Named]:
    """Blocks and biomes, in the order y, z, x."""
    version, volume = int(part(root, "Version", int)), math.prod(sides)
    if version not in (1, 2, 3):
        raise ValueError(f"Version must be 1, 2 or 3, got {version}")
    where = part(root, "Blocks", dict) if version == 3 else root
    blocks = _palette(where, "Palette", "Data" if version == 3 else "BlockData", (volume,), "blocks")
    holder, key = (root.get("Biomes", {}), "Data") if version == 3 else (root, "BiomeData")
    if not isinstance(holder, dict) or key not in holder:
        return blocks, PLAINS
    columns = sides[1] * sides[2]  # in version 2; some programs write those of all blocks there too
    sizes = (volume,) if version == 3 else (columns, volume)
    names, numbers = _palette(holder, "Palette" if version == 3 else "BiomePalette", key, sizes, "biomes")
    return blocks, (names, numbers.reshape(-1, *sides[1:]))


def _palette(where: Tags, palette: str, key: str, sizes: tuple[int, ...], what: str) -> Named:
    """The names that are used, and which of them is where."""
    names = {int(n): str(name) for name, n in part(where, palette, dict).items() if isinstance(n, int)}
    numbers = varints(np.asarray(part(where, key, np.ndarray)).view(np.uint8))
    if numbers.size not in sizes:
        raise ValueError(f"{key} holds {numbers.size} {what}, but the sides make {sizes[0]}")
    used, which = np.unique(numbers, return_inverse=True)
    if missing := [int(n) for n in used if int(n) not in names]:
        raise ValueError(f"the palette of {what} lacks number {missing[0]}")
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


def _mcedit(root: Tags, sides: list[int]) -> Named:
    volume = math.prod(sides)
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
    states = [legacy_state(int(n) >> 4, int(n) & 15) for n in used]
    names, blocks = joined(states, which.reshape(sides))
    return names, blocks.reshape(-1).astype(np.int32)


def _built(builder: Builder, blocks: Named, biomes: Named, sides: list[int]) -> Blocks:
    """Blocks in the order y, z, x, cut into sections and filled up with air."""
    rest = [(0, -side % BRICK) for side in sides]
    padded = np.pad(blocks[1].reshape(sides), rest, constant_values=len(blocks[0]))
    climate = np.pad(np.broadcast_to(biomes[1], sides), rest)
    names = [*blocks[0], AIR]
    for y, z, x in np.ndindex(*(side // BRICK for side in padded.shape)):
        place = tuple(slice(BRICK * n, BRICK * (n + 1)) for n in (y, z, x))
        used, which = np.unique(padded[place], return_inverse=True)
        near, biome = np.unique(climate[place], return_inverse=True)
        section = Section(
            y=y,
            states=tuple(names[n] for n in used),
            blocks=which.reshape(-1),
            biomes=tuple(biomes[0][n] for n in near),
            biome=biome.reshape((BRICK,) * 3) if len(near) > 1 else None,
        )
        builder.add(x, z, section)
    return builder.build()
