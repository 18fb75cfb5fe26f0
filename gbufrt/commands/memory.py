"""Memory of a process that is gbufrt's own: large pages, and free memory given back between passes.

C's allocator keeps what passes have freed. Tensors of many sizes come and go, so of 1080p frames it keeps a gigabyte
that fits nothing. To give it back costs page faults later. Large pages make them few where tensors are large; where
they are small, that would take a third of the time. Both concern the whole process, so the library alone does neither.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

from torch import nn

from gbufrt.frame import Frame
from gbufrt.pipeline import Pipeline

LARGE = 1_500_000  # pixels: frames whose channels fill several large pages of 2 MB each


@contextmanager
def giving_back(pipeline: Pipeline) -> Iterator[None]:
    """Inside, memory that is free goes back to the system before each pass over a large frame, where C has glibc."""
    trim = _trim()

    def before(_: nn.Module, arguments: tuple[Frame, ...]) -> None:
        if trim is not None and arguments[0].gbuffer.depth.numel() >= LARGE:
            trim()

    hooks = [stage.register_forward_pre_hook(before) for _, stage in pipeline.passes()]
    try:
        yield
    finally:
        for hook in hooks:
            hook.remove()


@cache
def _trim() -> Callable[[], None] | None:
    """glibc's ``malloc_trim``, which returns free pages amid the heap too; None where there is none."""
    if sys.platform != "linux" or not hasattr(library := ctypes.CDLL(None), "malloc_trim"):
        return None
    trim = library.malloc_trim

    def run() -> None:
        trim(ctypes.c_size_t(0))

    return run
