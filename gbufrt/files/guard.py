"""Reading OpenEXR files that may be damaged or hostile: the one place that opens them.

The library prints warnings, leaves out parts that it cannot decode, and allocates what a header asks for. So the
header alone is read first and checked against limits; then the whole file, whose parts and channels must all be there.

What is accepted though damaged: pixels that carry no checksum. ZIP has one; DWAA's lossy blocks, PIZ, and blocks that
are stored as they are have none, so a flipped bit there is another number, as it may be in a header's names and values.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

MAX_GB = 4.0  # that a file may decode to, unless GBUFRT_MAX_GB says otherwise
MAX_RATIO = 1100  # deflate compresses by at most 1032 to 1
SLACK = 1 << 20  # bytes that even the smallest file may decode to
DEEP = "holds deep pixels, which gbufrt does not read; flatten it first"
MAGIC = b"\x76\x2f\x31\x01"

_fds = threading.Lock()


@dataclass(frozen=True, kw_only=True)
class Part:
    """One part of a file: its header, and its channels as ``(H, W)`` arrays (none where only headers were read).

    ``of_pass``: what its file is called by among those of one frame.
    """

    name: str
    header: Mapping[str, Any]
    size: tuple[int, int]
    names: tuple[str, ...]
    channels: Mapping[str, np.ndarray]
    of_pass: str = ""

    @property
    def display(self) -> tuple[int, int, int, int]:
        """Left, top, height and width of the display window: the whole picture, which pixels may not fill or pass."""
        (x0, y0), (x1, y1) = ([int(v) for v in c] for c in self.header.get("displayWindow", self.header["dataWindow"]))
        return x0, y0, y1 - y0 + 1, x1 - x0 + 1

    @property
    def whole(self) -> tuple[int, int]:
        """``(H, W)`` of the display window."""
        return self.display[2:]

    @property
    def pixel_aspect(self) -> float:
        """A pixel's width over its height; 1 where the header says none that can be."""
        aspect = self.header.get("pixelAspectRatio", 1.0)
        return float(aspect) if isinstance(aspect, int | float) and 0 < aspect < math.inf else 1.0


def read_parts(path: str | Path, *, header_only: bool = False) -> list[Part]:
    """Every part of an OpenEXR file.

    Args:
        path: the file.
        header_only: read no pixels.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not an OpenEXR file, or damaged, or claims more memory than `most_bytes` allows.
    """
    path = Path(path)
    _check_file(path)
    heads = [_part(path, part) for part in _open(path, header_only=True)]
    _check_limits(path, heads)
    if header_only:
        return heads
    parts = [_part(path, part) for part in _open(path, header_only=False)]
    if [(p.name, p.names) for p in parts] != [(h.name, h.names) for h in heads]:
        raise ValueError(f"{path} is damaged or cut short: its pixels cannot be decoded; write or copy it again")
    for part in parts:
        for name in part.names:
            pixels = part.channels.get(name)
            if pixels is None or pixels.shape != part.size:
                raise ValueError(f"{path} is damaged: channel {name!r} is not {part.size[1]}x{part.size[0]} pixels")
    return parts


def _check_file(path: Path) -> None:
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; check the path")
    if not path.is_file():
        raise ValueError(f"{path} is not a file")
    with path.open("rb") as file:
        start = file.read(4)
    if start != MAGIC:
        found = "is empty" if not start else f"starts with {start!r}"
        raise ValueError(f"{path} is not an OpenEXR file: it {found}")


def _open(path: Path, *, header_only: bool) -> list[Any]:
    threads = min(4, os.cpu_count() or 1)
    try:
        with silence():
            return OpenEXR.File(str(path), separate_channels=True, header_only=header_only, num_threads=threads).parts
    except Exception as error:  # the bindings raise whatever the damage makes them stumble over
        if "deepImageState" in str(error):  # a standard attribute, the only one that they do not know
            raise ValueError(f"{path} {DEEP}") from error
        what = f"its {'header' if header_only else 'pixel data'} cannot be read"
        raise ValueError(f"{path} is damaged or cut short: {what}; write or copy it again") from error


def _part(path: Path, part: Any) -> Part:
    try:
        header = dict(part.header)
        (x0, y0), (x1, y1) = ([int(v) for v in corner] for corner in header["dataWindow"])
        channels = header["channels"]
        if any(c.xSampling != 1 or c.ySampling != 1 for c in channels):
            raise ValueError(f"{path} has subsampled channels, which gbufrt does not read; save it as RGB")
        names = tuple(c.name for c in channels)
        pixels = {name: c.pixels for name, c in part.channels.items()}
        return Part(
            name=str(header.get("name", "")),
            header=header,
            size=(y1 - y0 + 1, x1 - x0 + 1),
            names=names,
            channels=pixels,
        )
    except (KeyError, TypeError, AttributeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is damaged: its header lacks a channel list or data window") from error


def _check_limits(path: Path, parts: list[Part]) -> None:
    if not parts:
        raise ValueError(f"{path} is damaged: it has no parts")
    decoded = filled = 0
    for part in parts:
        height, width = part.size
        if height < 1 or width < 1:
            raise ValueError(f"{path} is damaged: part {part.name!r} has a data window of {width}x{height} pixels")
        if part.header.get("type") in (OpenEXR.deepscanline, OpenEXR.deeptile):
            raise ValueError(f"{path} {DEEP}")
        decoded += height * width * 4 * len(part.names)
        filled += _window_pixels(path, part) * 4 * len(part.names)
    size = path.stat().st_size
    if decoded > MAX_RATIO * size + SLACK:
        raise ValueError(f"{path} is damaged: {size} bytes cannot hold the {decoded} that its header claims")
    if max(decoded, filled) > (most := most_bytes()):
        raise ValueError(
            f"{path} claims {max(decoded, filled) / 2**30:.1f} GB of pixels, more than the limit of {most / 2**30:g}; "
            "if true, set GBUFRT_MAX_GB"
        )


def _window_pixels(path: Path, part: Part) -> int:
    """How many pixels the whole picture has; a crop is filled up to it."""
    try:
        height, width = part.whole
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is damaged: its display window cannot be read") from error
    if height < 1 or width < 1:
        raise ValueError(f"{path} is damaged: its display window is {width}x{height} pixels")
    return height * width


def most_bytes() -> float:
    """Of the environment variable GBUFRT_MAX_GB, or `MAX_GB`."""
    text = os.environ.get("GBUFRT_MAX_GB", "")
    try:
        gigabytes = float(text or MAX_GB)
    except ValueError:
        gigabytes = -1.0
    if not gigabytes > 0:
        raise ValueError(f"GBUFRT_MAX_GB must be a positive number of gigabytes, got {text!r}")
    return gigabytes * 2**30


@contextmanager
def silence() -> Iterator[None]:
    """Keep what the library prints, from C++ as from Python, off the terminal."""
    with _fds, redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        saved: dict[int, int] = {}
        null = os.open(os.devnull, os.O_WRONLY)
        try:
            for fd in (1, 2):
                try:
                    saved[fd] = os.dup(fd)
                except OSError:  # closed, as in a daemon: nothing to keep quiet
                    continue
                os.dup2(null, fd)
            yield
        finally:
            for fd, copy in saved.items():
                os.dup2(copy, fd)
                os.close(copy)
            os.close(null)
