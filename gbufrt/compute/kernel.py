"""How a scalar kernel body becomes a CPU operator.

A marching loop (a voxel traversal, a screen-space ray) is written once as plain scalar Python over flat arrays, marked
`scalar`; a short driver marked `driver` hands out its items to threads; a `torch.library.custom_op` with a fake wraps
the driver. Beside each stands a torch reference: the definition, the oracle of the tests, and what runs on devices for
which there is no compiled form.

numba caches machine code beside the source file, so a second process compiles nothing. Two traps: the cache notices
changes in the file of the driver only, so where bodies lie in other files, the driver closes over their `checksum`; and
asking numba for its thread count inside a kernel switches the cache off, so it is an argument.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
import torch
from torch import Tensor


def scalar(function: Callable[..., Any]) -> Any:
    """A helper or body that works on one item; it is cached as part of its driver."""
    return numba.njit(nogil=True, error_model="numpy")(function)


def driver(function: Callable[..., Any]) -> Any:
    """A loop over items: ``for t in prange(threads): for i in range(t, n, threads): body(i, ...)``.

    Give each thread cyclic rows: contiguous blocks leave one thread with the sky and the other with the ground.
    """
    return numba.njit(cache=True, nogil=True, parallel=True, error_model="numpy")(function)


def checksum(*modules: ModuleType) -> int:
    """A number that changes with the source of modules: what a driver closes over is part of its key in the cache."""
    total = 0
    for module in modules:
        total = zlib.crc32(Path(str(module.__file__)).read_bytes(), total)
    return total


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
