"""Files that appear whole or not at all, and how large pictures may be."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from glob import escape
from pathlib import Path

MAX_PIXELS = 1 << 26  # 8192 x 8192, of a picture that is read or made


def check_ending(path: str | Path, ending: str, otherwise: str) -> None:
    """Raise ValueError unless a path has the ending of what is written to it; ``otherwise`` says what writes others."""
    if Path(path).suffix.lower() != ending:
        raise ValueError(f"path must end in {ending}, got {Path(path).name!r}; {otherwise}")


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path`` to write to; it takes the name ``path`` when the block ends without error.

    Missing folders are made. Each process has a temporary name of its own: of two that write to one folder the last
    wins, and no file is of both. What killed processes of this machine left behind is removed.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    machine = f".{path.name}.{platform.node()}-"
    _remove_left(path.parent, machine)
    part = path.with_name(f"{machine}{os.getpid()}.part")
    try:
        yield part
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _remove_left(folder: Path, beginning: str) -> None:
    """Remove temporary files that begin so and whose process is no more."""
    if os.name == "nt":  # where to ask for a process ends it
        return
    for old in folder.glob(f"{escape(beginning)}*.part"):
        number = old.name.removeprefix(beginning).removesuffix(".part")
        if number.isdecimal() and not _runs(int(number)):
            old.unlink(missing_ok=True)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # another user's
        return True
    return True


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with atomic(path) as part:
        part.write_text(text, encoding="utf-8")
