"""Pages of memory: large ones, and how what is freed goes back to the system. Does not import torch."""

from __future__ import annotations

import ctypes
import os
import sys
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

LARGE = 8_000_000  # bytes of a plane: a little less than one of 1920x1080
OWN = 0.2  # planes; blocks of more are mapped on their own: so are masks, of a quarter of a plane
M_MMAP_THRESHOLD = -3  # glibc's malloc.h
HIGHEST = 32 << 20  # bytes; glibc maps blocks of more on their own by itself
LARGE_PAGES = "THP_MEM_ALLOC_ENABLE"  # torch's own switch


def ask_for_large_pages() -> None:
    """Let torch ask the system for large pages for its large tensors, unless the environment says otherwise.

    torch reads this with its first tensor, which may be there where torch was imported before gbufrt: nothing is done
    then (set ``THP_MEM_ALLOC_ENABLE=1`` there). Processes that this one starts inherit it.
    """
    if "torch" not in sys.modules:
        os.environ.setdefault(LARGE_PAGES, "1")


def return_freed(plane: Tensor) -> None:
    """Give memory that is free back to the system, where planes are as large as this one and large enough.

    glibc keeps freed blocks of up to 32 MB. Tensors of one, two and three planes leave holes that fit no others: after
    a few frames of 1920x1080, 0.7 GB of them. Fresh pages in their place, once a frame, take less of its time than can
    be measured, but after each of four branches several percent. Small pictures are not worth it.

    Where torch asks for large pages, a block's pages are cheap enough to be fresh each time. From the first large frame
    on, all but the smallest blocks, down to masks, are then mapped on their own and leave no holes: with single planes
    in the heap 1920x1080 took 0.1 GB more.

    Args:
        plane: ``(B, 1, H, W)``, such as a frame's depth.
    """
    if plane.device.type == "cpu" and plane.nbytes >= LARGE and (libc := _glibc()) is not None:
        if os.environ.get(LARGE_PAGES, "0") not in ("", "0"):  # without them it takes a tenth more time
            libc.mallopt(M_MMAP_THRESHOLD, int(min(OWN * plane.nbytes, HIGHEST)))
        libc.malloc_trim(0)


@cache
def _glibc() -> Any:
    """The C library where it is glibc, None elsewhere."""
    library = ctypes.CDLL(None) if sys.platform == "linux" else None
    return library if hasattr(library, "malloc_trim") and hasattr(library, "mallopt") else None
