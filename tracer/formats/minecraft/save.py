"""Region files and save folders: which chunks to take, and the blocks in them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np

from gbufrt.numeric import check_counts, check_wholes
from tracer.formats.minecraft.build import Blocks, Builder
from tracer.formats.minecraft.joined import joined_chunk
from tracer.formats.minecraft.legacy import mod_names
from tracer.formats.minecraft.nbt import Tags, part, read_nbt
from tracer.formats.minecraft.pack.archive import PackError
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.region import Place, Region, region_files
from tracer.formats.minecraft.sections import FLATTENED, Section, sections, version_of

WIDTH = 16  # blocks along a chunk
CHUNKS = 24  # along each side of what is taken of a save folder, unless told
MAX_CHUNKS = 64
MAX_PLAYER = 1 << 26
FURTHEST = 30_000_000  # blocks from the middle: the game's own limit
NAMED = 3  # of what is damaged; the rest is counted
LISTED = 8  # names of blocks
PLAYERS = ("players/data", "playerdata")
OVERWORLD = ("minecraft:overworld", 0)

Box = tuple[int, int, int, int, int, int]
Keep = tuple[slice, slice, slice]


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Which part of a world to take, in blocks; by default all of a region, or what is round a save's player.

    Args:
        box: x0, y0, z0, x1, y1, z1, the last three not included.
        around: x, z.
        chunks: how many chunks along each side are taken, with ``around`` or round the player.

    Raises:
        TypeError: there are other numbers, or none.
        ValueError: a side of the box is not positive, a number is out of range, or both ways are used.
    """

    box: Box | None = None
    around: tuple[int, int] | None = None
    chunks: int | None = None

    def __post_init__(self) -> None:
        check_wholes(6, "x0, y0, z0, x1, y1, z1", box=self.box)
        check_wholes(2, "x, z", around=self.around)
        check_counts(chunks=CHUNKS if self.chunks is None else self.chunks)
        if self.box is not None and (self.around is not None or self.chunks is not None):
            raise ValueError("box and around or chunks exclude each other; give one of them")
        if self.box is not None and not all(a < b for a, b in zip(self.box[:3], self.box[3:], strict=True)):
            raise ValueError(f"box must be x0,y0,z0,x1,y1,z1 with each first below its second, got {self.box}")
        if self.chunks is not None and not 1 <= self.chunks <= MAX_CHUNKS:
            raise ValueError(f"chunks must lie in 1..{MAX_CHUNKS}, got {self.chunks}")
        if not all(abs(n) <= FURTHEST for n in (*(self.box or ()), *(self.around or ()))):
            raise ValueError(f"coordinates must lie within {FURTHEST} blocks of 0, got {self.box or self.around}")

    def chunk_range(self, middle: Place) -> tuple[Place, Place]:
        """First chunk and the one after the last, along x and z; ``middle`` is used where no place is told."""
        if self.box is not None:
            x0, _, z0, x1, _, z1 = self.box
            return (x0 // WIDTH, z0 // WIDTH), (-(-x1 // WIDTH), -(-z1 // WIDTH))
        x, z = middle if self.around is None else self.around
        count = CHUNKS if self.chunks is None else self.chunks
        first = round(x / WIDTH - count / 2), round(z / WIDTH - count / 2)
        return first, (first[0] + count, first[1] + count)

    def in_whole_chunks(self) -> Selection:
        """The same with the sides of the box along x and z moved out to those of chunks."""
        if self.box is None:
            return self
        (_, y0, _), (_, y1, _) = self.box[:3], self.box[3:]
        (x0, z0), (x1, z1) = self.chunk_range((0, 0))
        return Selection(box=(WIDTH * x0, y0, WIDTH * z0, WIDTH * x1, y1, WIDTH * z1))

    def takes(self, place: Place) -> bool:
        """Whether a chunk lies in the part: all do where neither a box nor a place is told."""
        if self.box is None and self.around is None:
            return True
        low, high = self.chunk_range((0, 0))
        return all(a <= p < b for a, p, b in zip(low, place, high, strict=True))


def read_minecraft(
    path: str | PathLike[str], selection: Selection | None = None, pack: str | PathLike[str] | None = None
) -> Blocks:
    """The blocks of a region file (``.mca``) or of a save folder.

    Chunks that are missing are empty. Damaged ones are left out, and a warning names them.

    Args:
        path: of the file, or of a folder with region files in it or in its ``region``.
        selection: which part; by default all of a region file, and of a save what is round its player.
        pack: a resource pack with textures; see `tracer.formats.minecraft.pack.pack.Pack` for its errors.

    Raises:
        ValueError: no region file, nothing but air, or all chunks damaged; names the file and what to do.
        FileNotFoundError: there is no such file.
    """
    path, chosen = Path(path), selection or Selection()
    regions = [Region.of(file) for file in region_files(path)]
    there = [place for region in regions for place in region.sectors]
    if not there:
        raise ValueError(f"{path} holds no chunks, as the game leaves some regions; give another, or the save's folder")
    everything = path.is_file() and chosen == Selection()
    low, high = ((-FURTHEST,) * 2, (FURTHEST,) * 2) if everything else chosen.chunk_range(_middle(path, there))
    builder, damaged, found = Builder(None if pack is None else Pack(pack)), list[str](), 0
    for region in regions:
        for place in region.sectors:
            if all(a <= p < b for a, p, b in zip(low, place, high, strict=True)):
                found += 1
                try:
                    _add(builder, region, place, chosen.box)
                except PackError:
                    raise
                except ValueError as error:
                    damaged.append(f"chunk {place[0]},{place[1]} of {region.path.name}: {error}")
    if not found:
        (x0, z0), (x1, z1) = (np.min(there, axis=0) * WIDTH, (np.max(there, axis=0) + 1) * WIDTH)
        lie = f"its chunks lie in x {x0}..{x1} and z {z0}..{z1}"
        raise ValueError(f"{path} has no chunks in that part; {lie}: choose another (around, or --around X,Z)")
    return _finished(path, builder, damaged, found, len(there) - found)


def _finished(path: Path, builder: Builder, damaged: list[str], found: int, others: int) -> Blocks:
    told = "; ".join(damaged[:NAMED]) + (f"; and {len(damaged) - NAMED} more" if len(damaged) > NAMED else "")
    if len(damaged) == found:
        count = "1 other chunk lies" if others == 1 else f"{others} other chunks lie"
        elsewhere = f"{count} elsewhere: choose another part (around, on the command line --around X,Z)"
        remedy = elsewhere if others else "give another region, or restore it from a backup"
        raise ValueError(f"{path}: no chunk can be read: {told}; {remedy}")
    try:
        blocks = builder.build()
    except ValueError as error:
        raise ValueError(f"{path}: {error}{f' ({told})' if told else ''}") from None
    if damaged:
        warnings.warn(f"{path}: {len(damaged)} of {found} chunks are damaged and left out: {told}", stacklevel=3)
    tell_unknown(path, blocks)
    return blocks


def tell_unknown(path: Path, blocks: Blocks) -> None:
    """Warn of blocks that the colour table does not know, and of those that the pack has no texture of."""
    for told in (unknown_told(blocks.unknown), untextured_told(blocks.untextured)):
        if told:
            warnings.warn(f"{path}: {told}", stacklevel=4)


def unknown_told(names: Sequence[str]) -> str:
    """The message about blocks that the colour table does not know; empty where there are none."""
    return _told(names, "unknown block is drawn grey", "unknown blocks are drawn grey")


def untextured_told(names: Sequence[str]) -> str:
    """The message about blocks that the pack has no texture of; empty where there are none."""
    return _told(names, "block has no texture in the pack", "blocks have no texture in the pack")


def _told(names: Sequence[str], one: str, many: str) -> str:
    listed = ", ".join(names[:LISTED]) + (", ..." if len(names) > LISTED else "")
    return f"{len(names)} {one if len(names) == 1 else many}: {listed}" if names else ""


def _middle(path: Path, there: Iterable[Place]) -> Place:
    """Where the player is, in blocks; else in the middle of the chunks."""
    for x, z in _players(path) if path.is_dir() else ():
        return x, z
    x, z = np.median(np.array(list(there)), axis=0).tolist()
    return round((x + 0.5) * WIDTH), round((z + 0.5) * WIDTH)


def _players(path: Path) -> Iterator[Place]:
    """Places of the players of a save in its overworld: the one of a game alone, then those of a server."""
    level = _tags_of(path / "level.dat").get("Data")
    data = level if isinstance(level, dict) else {}
    alone = _uuid(data.get("singleplayer_uuid"))
    files = [file for folder in PLAYERS for file in sorted((path / folder).glob("*.dat"))]
    for file in (None, *sorted(files, key=lambda file: file.stem != alone)):
        try:
            tags = data.get("Player", {}) if file is None else _tags_of(file)
            x, _, z = (float(number) for number in part(tags, "Pos", list))
            here = tags.get("Dimension", OVERWORLD[0]) in OVERWORLD
            if here and max(abs(x), abs(z)) <= FURTHEST:
                yield int(x // 1), int(z // 1)
        except (ValueError, TypeError):
            continue  # a server's level.dat has no player


def _tags_of(file: Path) -> Tags:
    """The tags of a file; none where it is missing or damaged, which must not hide the world."""
    try:
        return read_nbt(file, limit=MAX_PLAYER) if file.is_file() else {}
    except ValueError:
        return {}


def _uuid(words: Any) -> str | None:
    """Four integers as the name of a player's file."""
    if not isinstance(words, np.ndarray) or words.shape != (4,):
        return None
    return str(UUID(bytes=words.astype(">i4").tobytes()))


def _add(builder: Builder, region: Region, place: Place, box: Box | None) -> None:
    """Add the sections of a chunk that the box touches; all of a damaged chunk are left out."""
    for section, keep in chunk_sections(region, place, box):
        builder.add(place[0], place[1], section, keep)


def chunk_sections(region: Region, place: Place, box: Box | None) -> list[tuple[Section, Keep | None]]:
    """The sections of a chunk that the box touches, and which of their blocks are kept; None for all.

    Raises:
        ValueError: the chunk is damaged.
    """
    kept, chunk = list[tuple[Section, Keep | None]](), region.chunk(place)
    found = list(sections(chunk))
    if len({section.y for section in found}) < len(found):
        raise ValueError("a section comes twice")
    if version_of(chunk) < FLATTENED:
        names = mod_names(region.path)
        named = [replace(section, states=tuple(names.get(s, s) for s in section.states)) for section in found]
        found = joined_chunk(named)
    for section in found:
        at = (place[0], section.y, place[1])
        keep = None if box is None else _kept(at, box)
        if keep is None or all(part.start < part.stop for part in keep):
            kept.append((section, None if keep == (slice(0, WIDTH),) * 3 else keep))
    return kept


def _kept(at: tuple[int, int, int], box: Box) -> Keep:
    x, y, z = (
        slice(min(max(box[axis] - WIDTH * at[axis], 0), WIDTH), max(min(box[axis + 3] - WIDTH * at[axis], WIDTH), 0))
        for axis in range(3)
    )
    return x, y, z
