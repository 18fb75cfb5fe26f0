"""Memory of a process that is gbufrt's own: large pages, and free memory given back between passes.

C's allocator keeps what passes have freed. Tensors of many sizes come and go, so of 1080p frames it keeps a gigabyte
that fits nothing. To give it back costs page faults later, so that is done only where much is held; large pages make
them fewer. Both concern the whole process, so the library alone does neither.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from gbufrt.pipeline import Pipeline

IDLE = 700_000_000  # bytes that a process may hold beyond what is allocated; the libraries are 300 million of them


@contextmanager
def giving_back(pipeline: Pipeline) -> Iterator[None]:
    """Inside, before each pass, free memory goes back to the system if there is much of it, where C has glibc."""
    trim = _trim()

    def before(*_: object) -> None:
        if trim is not None and _idle() > IDLE:
            trim()

    hooks = [stage.register_forward_pre_hook(before) for _, stage in pipeline.passes()]
    try:
        yield
    finally:
        for hook in hooks:
            hook.remove()


@cache
def _trim() -> Callable[[], None] | None:
    """glibc's ``malloc_trim``, which returns free pages amid the heap too; None without it or ``mallinfo2``."""
    if sys.platform != "linux" or not hasattr(library := ctypes.CDLL(None), "mallinfo2"):
        return None
    trim = library.malloc_trim

    def run() -> None:
        trim(ctypes.c_size_t(0))

    return run


class _Info(ctypes.Structure):
    """glibc's ``struct mallinfo2``."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    )


def _idle() -> int:
    """Bytes in memory beyond what is allocated."""
    info = ctypes.CDLL(None).mallinfo2
    info.restype = _Info
    found = info()
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return resident - found.uordblks - found.hblkhd
