"""Schematics and structures without what no block needs: their bytes are gone through before nbtlib makes objects."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np

from tracer.formats.minecraft.nbt import Tags, bytes_of, parse_nbt

UNREAD = frozenset(
    (b"TileEntities", b"Entities", b"entities", b"BlockEntities", b"PendingBlockTicks", b"PendingFluidTicks")
)
"""What chests hold and who stands about: many values that are not blocks."""
MOST_STEPS = 1 << 22  # values that are gone through, in seconds; a file of `limit` bytes can hold more
FIXED = {1: 1, 2: 2, 3: 4, 4: 8, 5: 4, 6: 8}  # bytes of numbers by their kind
ARRAYS = {7: 1, 11: 4, 12: 8}
TEXT, LIST, COMPOUND = 8, 9, 10
POS, STATE = rb"\x09\x00\x03pos\x03\x00\x00\x00\x03(.{12})", rb"\x03\x00\x05state(.{4})"
LISTED = [re.compile(first + second + rb"\x00", re.DOTALL) for first, second in ((POS, STATE), (STATE, POS))]


def read_skimmed(path: Path, *, limit: int) -> Tags:
    """The root of a file without what is `UNREAD`; a structure's ``blocks`` are ``(N, 4)`` int32: x, y, z, state.

    Raises:
        ValueError: see `tracer.formats.minecraft.nbt.read_nbt`; names the file.
    """
    data = bytes_of(path, limit=limit)
    try:
        skimmer = _Skimmer(data)
        try:
            skimmer.root()
        except (IndexError, struct.error, RecursionError):
            skimmer = _Skimmer(b"")  # nbtlib says what is wrong
        tags = parse_nbt(skimmer.rest() if skimmer.data else data)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return tags if skimmer.blocks is None else {**tags, "blocks": skimmer.blocks}


class _Skimmer:
    def __init__(self, data: bytes) -> None:
        self.data, self.at, self.steps = data, 0, 0
        self.blocks: np.ndarray | None = None
        self.dropped: list[tuple[int, int]] = []

    def rest(self) -> bytes:
        """All bytes but those that were dropped."""
        ends = [0, *(n for span in self.dropped for n in span), len(self.data)]
        return b"".join(self.data[a:b] for a, b in zip(ends[::2], ends[1::2], strict=True))

    def root(self) -> None:
        if self.data[:1] != bytes([COMPOUND]):
            raise IndexError("no compound")
        self.at = 1
        self._text()
        self._compound(keep=True, top=True)

    def _number(self, form: str) -> int:
        (value,) = struct.unpack_from(form, self.data, self.at)
        self.at += struct.calcsize(form)
        return value

    def _text(self) -> bytes:
        size = self._number(">H")
        self.at += size
        return self.data[self.at - size : self.at]

    def _compound(self, *, keep: bool, top: bool = False) -> None:
        """``keep``: note what is to be dropped in it."""
        while True:
            start, kind = self.at, self._number(">B")
            if kind == 0:
                return
            name = self._text()
            if top and kind == LIST and name == b"blocks" and self.data[self.at] == COMPOUND:
                self._listed()
            else:
                self._value(kind, keep=keep and name not in UNREAD)
            if keep and (name in UNREAD or (top and name == b"blocks" and self.blocks is not None)):
                self.dropped.append((start, self.at))

    def _value(self, kind: int, *, keep: bool) -> None:
        self.steps += 1
        if self.steps > MOST_STEPS:
            raise ValueError(f"NBT holds more than the {MOST_STEPS} values allowed")
        if kind in FIXED:
            self.at += FIXED[kind]
        elif kind == TEXT:
            self._text()
        elif kind in ARRAYS:
            self._skip(ARRAYS[kind], self._number(">i"))
        elif kind == COMPOUND:
            self._compound(keep=keep)
        elif kind == LIST:
            inner, count = self._number(">B"), self._number(">i")
            if inner in FIXED:
                self._skip(FIXED[inner], count)
            else:
                for _ in range(count):
                    self._value(inner, keep=False)
        else:
            raise IndexError(f"no kind {kind}")

    def _skip(self, size: int, count: int) -> None:
        if count < 0 or self.at + size * count > len(self.data):
            raise IndexError("array beyond the end")
        self.at += size * count

    def _listed(self) -> None:
        """The blocks of a structure of the game."""
        self.at += 1
        found, count = bytearray(), self._number(">i")
        for _ in range(count):
            for pattern, first in zip(LISTED, (1, 2), strict=True):
                if match := pattern.match(self.data, self.at):
                    found += match[first] + match[3 - first]
                    self.at = match.end()
                    break
            else:
                found += self._block()
        self.blocks = np.frombuffer(bytes(found), ">i4").reshape(-1, 4).astype(np.int32)

    def _block(self) -> bytes:
        """Place and state of a block that has more, such as a chest's contents."""
        start, told = self.at, dict[bytes, bytes]()
        while kind := self._number(">B"):
            name, begin = self._text(), self.at
            self._value(kind, keep=False)
            told[name] = bytes([kind]) + self.data[begin : self.at]
        place, state = told.get(b"pos", b""), told.get(b"state", b"")
        if place[:6] != b"\x09\x03\x00\x00\x00\x03" or state[:1] != b"\x03":
            raise IndexError(f"no block at {start}")
        return place[6:] + state[1:]
