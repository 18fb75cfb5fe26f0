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
from functools import cache, partial
from types import FunctionType
from typing import Any

import numba
import numpy as np
import torch
from torch import Tensor

from gbufrt.compute.bodies import Target, fingerprint, scalar

__all__ = ["CPU", "Kernel", "array", "driver", "parallel", "scalar", "threads"]

CPU = Target(numba.njit(nogil=True, error_model="numpy"))  # helpers are cached as part of their driver


parallel = partial(numba.njit, cache=True, nogil=True, parallel=True, error_model="numpy")
"""Compiles a driver for the CPU."""


class Kernel:
    """A driver as machine code, which is made, or read from numba's cache, at its first call.

    Args:
        loop: the driver: plain Python that calls bodies marked `scalar`.
        target: of its helpers.
        compiler: of the driver itself, to what is called and has numba's ``stats``.
        item: what the driver calls by this name, if it serves every body.
    """

    def __init__(
        self,
        loop: Callable[..., Any],
        target: Target,
        compiler: Callable[[FunctionType], Any],
        *,
        item: Callable[..., Any] | None = None,
    ) -> None:
        assert isinstance(loop, FunctionType)
        self._loop, self._target, self._compiler = loop, target, compiler
        self._replaced = {} if item is None else {"item": item}
        self.name = loop.__qualname__ if item is None else f"{item.__module__}.{item.__qualname__}"
        self._compiled: Any = None

    def __call__(self, *arguments: Any) -> None:
        if self._compiled is None:
            self._first_call(*arguments)
        else:
            self._compiled(*arguments)

    @property
    def compiled(self) -> Any:
        """The driver for its target, under a name that says what it does: by its name numba finds machine code."""
        if self._compiled is None:
            loop = self._target.bind(self._loop, **self._replaced)
            loop.__qualname__ = f"{self.name}-{fingerprint(self._loop, **self._replaced)}"
            self._compiled = self._compiler(loop)
        return self._compiled

    @property
    def misses(self) -> int:
        """How often it was compiled in this process, rather than read from the cache."""
        return sum(self.compiled.stats.cache_misses.values())

    def _first_call(self, *arguments: Any) -> None:
        """The one place from which a kernel is made and first called in a process."""
        self.compiled(*arguments)


def driver(loop: Callable[..., Any]) -> Kernel:
    """A loop over items: ``for t in prange(threads): for i in range(t, n, threads): body(i, ...)``.

    Give each thread cyclic rows: contiguous blocks leave one thread with the sky and the other with the ground.
    """
    return Kernel(loop, CPU, parallel)


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
