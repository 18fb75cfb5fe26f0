"""Region files: where they lie in a save, where each of their 32 x 32 chunks lies, and its bytes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gbufrt.names import other_save
from tracer.formats.minecraft.compression import inflate, unpack_lz4
from tracer.formats.minecraft.nbt import Tags, parse_nbt

SECTOR = 4096
SIDE = 32  # chunks along a region
EXTERNAL = 128  # the chunk has a file of its own, because it is larger than 255 sectors
MAX_EXTERNAL = 1 << 23
NAME = re.compile(r"r\.(-?\d{1,7})\.(-?\d{1,7})\.mca", re.IGNORECASE)
FOLDERS = ("dimensions/minecraft/overworld/region", "region", "")  # of a save since 26.1 and before; of a dimension

COMPRESSIONS = {1: inflate, 2: inflate, 3: bytes, 4: unpack_lz4}  # by the number before a chunk's data

Place = tuple[int, int]


def region_place(path: Path) -> Place:
    """Which region a file is by its name, ``r.X.Z.mca``; another name stands for 0, 0."""
    named = NAME.fullmatch(path.name)
    return (int(named[1]), int(named[2])) if named else (0, 0)


def region_files(path: Path) -> list[Path]:
    """The region files of a save folder, or the one that ``path`` is.

    Raises:
        ValueError: a folder without such files.
        FileNotFoundError: there is no such file or folder.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise FileNotFoundError(f"{path} does not exist")
    files = files_within(path)
    if not files and (kind := other_save(path)):
        raise ValueError(f"{path} is {kind}")
    if not files:
        raise ValueError(f"{path} holds no region files (region/r.X.Z.mca); give a save folder or a .mca file")
    return files


def files_within(folder: Path) -> list[Path]:
    """The region files of a save's overworld, or of one of its dimensions; none of another folder."""
    found = ([file for file in (folder / at).glob("*.mca") if NAME.fullmatch(file.name)] for at in FOLDERS)
    return sorted(next((files for files in found if files), []))


@dataclass(frozen=True, kw_only=True)
class Region:
    """A region file's table of contents.

    Args:
        path: of the file.
        sectors: chunk coordinates (x, z) to the first sector of a chunk; missing chunks are missing here too.
    """

    path: Path
    sectors: dict[Place, int]

    @staticmethod
    def of(path: Path) -> Region:
        """The region of a file, whose name says where it is; see `region_place`.

        Raises:
            ValueError: the file is shorter than its table.
        """
        with path.open("rb") as file:
            table = file.read(SECTOR)
        if not table:
            return Region(path=path, sectors={})  # the game leaves empty files behind
        if len(table) < SECTOR:
            raise ValueError(f"{path} has {len(table)} bytes, but a region begins with a table of {SECTOR}; no region?")
        x0, z0 = (SIDE * number for number in region_place(path))
        entries = np.frombuffer(table, ">u4").astype(np.int64)
        used = np.flatnonzero(entries >> 8)
        return Region(
            path=path,
            sectors={(x0 + int(n) % SIDE, z0 + int(n) // SIDE): int(entries[n]) >> 8 for n in used},
        )

    def chunk(self, place: Place) -> Tags:
        """The NBT of a chunk that is there.

        Raises:
            ValueError: it is damaged, truncated, too large, or compressed in a way that is not read; or lz4 is missing.
        """
        with self.path.open("rb") as file:
            file.seek(self.sectors[place] * SECTOR)
            head = file.read(5)
            length = int.from_bytes(head[:4], "big") - 1
            if len(head) < 5:
                raise ValueError("it begins after the end of the file, which is truncated")
            if not 0 <= length <= 256 * SECTOR:
                raise ValueError(f"its length is {length}, more than a chunk may have")
            data = file.read(length)
        if len(data) < length:
            raise ValueError(f"{length} bytes were to follow, but {len(data)} are left; the file is truncated")
        kind = head[4]
        if kind & EXTERNAL:
            data = self._external(place)
        unpack = COMPRESSIONS.get(kind & ~EXTERNAL)
        if unpack is None:
            raise ValueError(f"compression must be 1 to 4 (gzip, zlib, none, LZ4), got {kind & ~EXTERNAL}")
        return parse_nbt(unpack(data))

    def _external(self, place: Place) -> bytes:
        path = self.path.with_name(f"c.{place[0]}.{place[1]}.mcc")
        if not path.is_file():
            raise ValueError(f"it lies in {path.name}, which does not exist")
        with path.open("rb") as file:
            data = file.read(MAX_EXTERNAL + 1)
        if len(data) > MAX_EXTERNAL:
            raise ValueError(f"{path.name} has more than the {MAX_EXTERNAL} bytes allowed")
        return data
