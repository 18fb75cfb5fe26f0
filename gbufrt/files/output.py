"""Files that appear whole or not at all, and how large pictures may be."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MAX_PIXELS = 1 << 26  # 8192 x 8192, of a picture that is read or made


def check_ending(path: str | Path, ending: str, otherwise: str) -> None:
    """Raise ValueError unless a path has the ending of what is written to it; ``otherwise`` says what writes others."""
    if Path(path).suffix.lower() != ending:
        raise ValueError(f"path must end in {ending}, got {Path(path).name!r}; {otherwise}")


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path`` to write to; it takes the name ``path`` when the block ends without error.

    Missing folders are made. The temporary name is always the same for a ``path``, so that what a killed process
    left behind is overwritten by the next one.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.part")
    try:
        yield part
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with atomic(path) as part:
        part.write_text(text, encoding="utf-8")
