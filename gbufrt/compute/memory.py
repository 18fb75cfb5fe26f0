"""How memory that is freed goes back to the system."""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from typing import Any

from torch import Tensor

LARGE = 8_000_000  # bytes of a plane: a little less than one of 1920x1080


def return_freed(plane: Tensor) -> None:
    """Give memory that is free back to the system, where planes are as large as this one and large enough.

    glibc keeps freed blocks of up to 32 MB. Tensors of one, two and three planes leave holes that fit no others: after
    a few frames of 1920x1080, 0.7 GB of them. Fresh pages in their place, once a frame, take less of its time than can
    be measured, but after each of four branches several percent. Small pictures are not worth it.

    Args:
        plane: ``(B, 1, H, W)``, such as a frame's depth.
    """
    if plane.device.type == "cpu" and plane.nbytes >= LARGE and (trim := _trim()) is not None:
        trim(0)


@cache
def _trim() -> Any:
    """glibc's ``malloc_trim``, None elsewhere."""
    return getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
