"""NBT, the tree of named values that Minecraft's files hold: parsed by nbtlib, within bounds."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, TypeVar, final

from tracer.formats.minecraft.compression import GZIP, inflate

MAX_READS = 1 << 19  # a value takes one to three, a real chunk some 10,000: bounds time, and memory of nbtlib's objects

COMPOUND = b"\n"  # the tag of a tree's root

T = TypeVar("T")
Tags = dict[str, Any]


def read_nbt(path: Path, *, limit: int) -> Tags:
    """A whole file of NBT, gzipped or not.

    Raises:
        ValueError: larger than ``limit`` bytes, damaged, or no NBT; names the file.
    """
    data = bytes_of(path, limit=limit)
    try:
        return parse_nbt(data)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def bytes_of(path: Path, *, limit: int) -> bytes:
    """A whole file, unpacked if it is gzipped; raises as `read_nbt`."""
    with path.open("rb") as file:
        data = file.read(limit + 1)
    try:
        if len(data) > limit:
            raise ValueError(f"the file has more than the {limit} bytes allowed")
        return inflate(data, limit=limit) if data[:2] == GZIP else data
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_nbt(data: bytes) -> Tags:
    """The root of NBT data.

    Raises:
        ValueError: no NBT, truncated, nested too deep, or of too many values; or nbtlib is missing.
    """
    try:
        from nbtlib import File
    except ImportError:
        raise ValueError("Minecraft's files need nbtlib: pip install gbufrt[worlds]") from None
    if data[:1] != COMPOUND:
        raise ValueError(f"it is no NBT: it begins with {data[:4]!r}, in place of {COMPOUND!r}")
    try:
        return File.parse(_Reader(data))
    except RecursionError:
        raise ValueError("NBT is nested too deep") from None
    except (KeyError, TypeError, IndexError, AttributeError, OverflowError, struct.error) as error:
        raise ValueError(f"NBT is damaged ({type(error).__name__}: {error})") from None


def part(tags: Any, key: str, kind: type[T]) -> T:
    """The value of a key.

    Raises:
        ValueError: there is none, or it is of another kind.
    """
    value = tags.get(key) if isinstance(tags, dict) else None
    if not isinstance(value, kind):
        raise ValueError(f"{key} must be {kind.__name__}, got {'none' if value is None else type(value).__name__}")
    return value


@final
class _Reader:
    """The bytes of NBT as a file that ends with an error: nbtlib takes missing bytes for zeros.

    A list's element type and length are a byte and four bytes read one after the other. Nothing else in NBT is four
    bytes right after a byte of zero, so that a list of ends, which costs no bytes and can claim 2^31 of them, shows.
    """

    def __init__(self, data: bytes) -> None:
        self.data, self.at, self.reads, self.zero = data, 0, 0, False

    def read(self, count: int) -> bytes:
        """The next ``count`` bytes."""
        if not 0 <= count <= len(self.data) - self.at:
            raise ValueError(f"NBT ends at byte {len(self.data)}, but {count} more were to follow byte {self.at}")
        self.reads += 1
        if self.reads > MAX_READS:
            raise ValueError(f"NBT holds more than the {MAX_READS} values allowed")
        out = self.data[self.at : self.at + count]
        self.at += count
        if self.zero and count == 4 and out > b"\0\0\0\0" and out < b"\x80":
            raise ValueError("NBT holds a list of nothing with elements")
        self.zero = out == b"\0"
        return out
