"""How scalar bodies become operators: compiled for the CPU with numba, and for CUDA with numba-cuda.

A marching loop (a voxel traversal, a screen-space ray) is written once as plain scalar Python over flat arrays, marked
`scalar`, in a file that holds nothing else; see `gbufrt.compute.bodies`. Where items share nothing,
`gbufrt.compute.each` runs the body over many of them, on the device where their arrays lie. Where threads need room to
work in, a `driver` written by hand hands out the items, on the CPU. A `torch.library.custom_op` with a fake wraps them,
and `gbufrt.compute.dispatch` says which form runs. Beside each stands a torch reference: the definition, the oracle of
the tests, and what runs where there is no kernel.

numba caches machine code, so a second process compiles nothing. Its own key covers the file of the driver only; ours
covers all code and constants that a driver reaches. Asking numba for its thread count inside a kernel switches the
cache off, so it is an argument.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np
import torch
from torch import Tensor

from gbufrt.compute.bodies import Target, scalar

__all__ = ["CPU", "Kernel", "array", "driver", "scalar", "threads"]

_PLAIN = {"nogil": True, "error_model": "numpy"}
CPU = Target(
    numba.njit,
    helper=_PLAIN,  # cached as part of their driver
    entry=_PLAIN | {"forceinline": True},  # called in one place; the registers of ten arrays would pass through memory
    driver=_PLAIN | {"cache": True, "parallel": True},
)


class Kernel:
    """A driver as machine code, which is made, or read from numba's cache, at its first call.

    Args:
        loop: the driver: plain Python that calls bodies marked `scalar`.
        target: what it is compiled for.
        item: the body that the driver calls by this name, if it serves every body.
    """

    def __init__(self, loop: Callable[..., Any], target: Target, *, item: Callable[..., Any] | None = None) -> None:
        self._parts: Any = loop, item
        self._target = target
        body = loop if item is None else item
        self.name = f"{body.__module__}.{body.__qualname__}"
        self._compiled: Any = None

    def __call__(self, *arguments: Any, grid: tuple[Any, ...] | None = None) -> None:
        """Run the driver; ``grid`` is the blocks, threads and stream of a CUDA kernel."""
        if self._compiled is None:
            self._first_call(arguments, grid)
        else:
            self._run(arguments, grid)

    @property
    def misses(self) -> int:
        """How often it was compiled in this process, rather than read from the cache."""
        return 0 if self._compiled is None else sum(self._compiled.stats.cache_misses.values())

    def _first_call(self, arguments: tuple[Any, ...], grid: tuple[Any, ...] | None) -> None:
        """The one place where a kernel is made and, for the first time in a process, called."""
        loop, item = self._parts
        self._compiled = self._target.compile(loop, item, self.name)
        self._run(arguments, grid)

    def _run(self, arguments: tuple[Any, ...], grid: tuple[Any, ...] | None) -> None:
        run = self._compiled if grid is None else self._compiled[grid]
        run(*arguments)


def driver(loop: Callable[..., Any]) -> Kernel:
    """A loop over items: ``for t in prange(threads): for i in range(t, n, threads): body(i, ...)``.

    Give each thread cyclic rows: contiguous blocks leave one thread with the sky and the other with the ground.
    """
    return Kernel(loop, CPU)


def threads() -> int:
    """How many threads a driver may use: torch's own number, but no more than numba has.

    numba is told so as well. Threads that it wakes and has no work for spin while they wait: two processes of one
    thread each would slow one another down several times.
    """
    _start()
    count = max(1, min(torch.get_num_threads(), numba.config.NUMBA_NUM_THREADS))  # pyright: ignore
    numba.set_num_threads(count)
    return count


@cache
def _start() -> None:
    """Start numba's threads, once, as it would at the first kernel; but as it shares OpenMP with torch, and then sets
    the number of torch's threads too, put that back."""
    count = torch.get_num_threads()
    numba.get_num_threads()
    torch.set_num_threads(count)


def array(tensor: Tensor) -> np.ndarray:
    """The numbers of a CPU tensor as a contiguous array, without a copy where it already is."""
    return tensor.detach().contiguous().numpy()
