"""A place in the bytes of a MagicaVoxel file that never reads past its end."""

from __future__ import annotations

import struct
from typing import NoReturn, final

Attributes = dict[str, str]


@final
class Cursor:
    """A place in the bytes of a file that never reads past ``stop``.

    Raises:
        ValueError: from every method, where the bytes end or break the format: file, offset and what was wrong.
    """

    def __init__(self, data: bytes, name: str, *, at: int = 0, stop: int | None = None) -> None:
        self.data, self.name, self.at = data, name, at
        self.stop = len(data) if stop is None else stop

    def fail(self, what: str, *, at: int | None = None) -> NoReturn:
        """Raise the one error that a broken file gives."""
        raise ValueError(f"{self.name}, byte {self.at if at is None else at}: {what}")

    @property
    def left(self) -> int:
        """Bytes until ``stop``."""
        return self.stop - self.at

    def take(self, count: int, what: str) -> bytes:
        """The next ``count`` bytes."""
        if count < 0 or count > self.left:
            self.fail(f"{what} needs {count} bytes, but {self.left} are left; the file is truncated or corrupt")
        self.at += count
        return self.data[self.at - count : self.at]

    def int32(self, what: str) -> int:
        """A signed number of four bytes."""
        return int(struct.unpack("<i", self.take(4, what))[0])

    def float32(self, what: str) -> float:
        """A real number of four bytes."""
        return float(struct.unpack("<f", self.take(4, what))[0])

    def count(self, what: str, *, bytes_each: int) -> int:
        """The number of items that follow, of at least ``bytes_each`` bytes each."""
        n = self.int32(what)
        if not 0 <= n * bytes_each <= self.left:
            self.fail(f"{what} is {n}, more than the {self.left} bytes left can hold", at=self.at - 4)
        return n

    def text(self, what: str) -> str:
        """A string after its length."""
        return self.take(self.count(f"length of {what}", bytes_each=1), what).decode("ascii", "replace")

    def attributes(self, what: str) -> Attributes:
        """Pairs of strings after their number."""
        n = self.count(f"number of attributes of {what}", bytes_each=8)
        return {self.text(f"a key of {what}"): self.text(f"a value of {what}") for _ in range(n)}
