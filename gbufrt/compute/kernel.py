"""How a scalar kernel body becomes a CPU operator.

A marching loop (a voxel traversal, a screen-space ray) is written once as plain scalar Python over flat arrays, marked
`scalar`; a short driver marked `driver` hands out its items to threads; a `torch.library.custom_op` with a fake wraps
the driver. Beside each stands a torch reference: the definition, the oracle of the tests, and what runs on devices for
which there is no compiled form.

`gbufrt.compute.cache` keeps the machine code, so a second process compiles nothing. Two traps: the cache notices
changes in the file of the driver only, so where bodies lie in other files, the driver closes over their `checksum`; and
asking numba for its thread count inside a kernel switches the cache off, so it is an argument.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
from torch import Tensor

from gbufrt.compute.cache import kept
from gbufrt.compute.threads import threads as threads


def scalar(function: Callable[..., Any]) -> Any:
    """A helper or body that works on one item; it is cached as part of its driver."""
    return numba.njit(nogil=True, error_model="numpy")(function)


def driver(function: Callable[..., Any]) -> Any:
    """A loop over items: ``for t in prange(threads): for i in range(t, n, threads): body(i, ...)``.

    Give each thread cyclic rows: contiguous blocks leave one thread with the sky and the other with the ground.
    """
    return kept(numba.njit(nogil=True, parallel=True, error_model="numpy")(function))


def checksum(*modules: ModuleType) -> int:
    """A number that changes with the source of modules: what a driver closes over is part of its key in the cache."""
    total = 0
    for module in modules:
        total = zlib.crc32(Path(str(module.__file__)).read_bytes(), total)
    return total


def array(tensor: Tensor) -> np.ndarray:
    """The numbers of a CPU tensor as a contiguous array, without a copy where it already is."""
    return tensor.detach().contiguous().numpy()
