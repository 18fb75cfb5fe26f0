"""How scalar bodies become operators: compiled for the CPU with numba, and for CUDA with numba-cuda.

A marching loop (a voxel traversal, a screen-space ray) is written once as plain scalar Python over flat arrays, marked
`scalar`, in a file that holds nothing else; see `gbufrt.compute.bodies`. `gbufrt.compute.each` runs the body over many
independent items, on the device of their arrays. Where threads need scratch memory, a hand-written `driver`
distributes the items, on the CPU. `gbufrt.compute.operators` registers what calls them, with a fake, and
`gbufrt.compute.dispatch` says which form runs. Each has a torch reference: the definition, the oracle of the tests, and
the form that runs where there is no kernel.

`gbufrt.compute.cache` keeps the machine code, so a second process compiles nothing; its key covers all code and
constants that a driver reaches, see `gbufrt.compute.fingerprint`. Asking numba for its thread count inside a kernel
switches the cache off, so it is an argument.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from functools import cached_property
from typing import Any

import numba
import numpy as np
from torch import Tensor

from gbufrt.compute.bodies import WIDTH, Lanes, allocating, contracted, in_lanes, inlined, scalar, specialized
from gbufrt.compute.cache import kept, missing, notice
from gbufrt.compute.parts import DriverCompiler, HelperCompiler
from gbufrt.compute.target import Target
from gbufrt.compute.threads import threads

__all__ = [
    "CPU", "WIDTH", "Kernel", "Lanes", "allocating", "array", "contracted", "driver", "in_lanes", "inlined", "replaced",
    "scalar", "specialized", "tensors_of", "threads",
]  # fmt: skip

_DRIVER = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "pipeline_class": DriverCompiler}
_PLAIN = _DRIVER | {"no_cpython_wrapper": True, "pipeline_class": HelperCompiler}
_BORROWING = _PLAIN | {"_nrt": False}
CPU = Target(
    numba.njit,
    helper=_BORROWING,  # cached as part of their driver
    owner=_PLAIN | {"_nrt": True},  # said, because it is inherited from callers otherwise
    within=_BORROWING | {"forceinline": True},
    entry=_BORROWING
    | {"forceinline": True},  # called in one place; the registers of ten arrays would pass through memory
    driver=_DRIVER | {"parallel": True},
    contract={"fastmath": {"contract"}},
)


class Kernel:
    """A driver as machine code, compiled or read from numba's cache at its first call.

    Args:
        loop: the driver: plain Python that calls bodies marked `scalar`.
        target: what it is compiled for.
        item: the body that the driver calls by this name, if it serves every body.
    """

    def __init__(self, loop: Callable[..., Any], target: Target, *, item: Callable[..., Any] | None = None) -> None:
        self._parts: Any = loop, item
        self._target, self._launched = target, False
        body = loop if item is None else item
        self.name = f"{body.__module__}.{body.__qualname__}"

    def __call__(self, *arguments: Any, grid: tuple[Any, ...] | None = None) -> None:
        """Run the driver; ``grid`` is the blocks, threads and stream of a CUDA kernel."""
        if grid is not None:
            with nullcontext() if self._launched else notice.compiling():  # which numba-cuda does not report
                self.dispatcher[grid](*arguments)
            self._launched = True
            return
        before = len(self.dispatcher.overloads)
        if np.float32 in map(type, arguments):  # a user's number: of another type, it would be compiled for
            arguments = tuple(float(x) if type(x) is np.float32 else x for x in arguments)
        self.dispatcher(*arguments)
        if len(self.dispatcher.overloads) > before:
            self._target.check(self._parts[0])

    @cached_property
    def dispatcher(self) -> Any:
        """numba's dispatcher; called with new types, it compiles or reads the cache."""
        loop, item = self._parts
        compiled = self._target.compile(loop, item, self.name)
        return kept(compiled) if self._target is CPU else compiled

    @property
    def misses(self) -> int:
        """How often it was compiled in this process, rather than read from the cache."""
        return sum(self.dispatcher.stats.cache_misses.values())

    @property
    def missing(self) -> bool:
        """Whether the cache holds no compiled form of it."""
        return missing(self.dispatcher)


def driver(loop: Callable[..., Any]) -> Kernel:
    """A loop over items: ``for t in prange(threads): for i in range(t, n, threads): body(i, ...)``.

    Give each thread cyclic rows: contiguous blocks leave one thread with the sky and the other with the ground. Where
    an item is small, give a helper some of them at a time: a driver counts references to arrays at every call, and its
    threads wait for each other there.
    """
    return Kernel(loop, CPU)


def array(tensor: Tensor) -> np.ndarray:
    """The numbers of a CPU tensor as a contiguous array, without a copy where it already is."""
    plain = tensor.detach() if tensor.requires_grad else tensor  # seven hundred times a frame
    return plain.contiguous().numpy()


def tensors_of(arguments: Sequence[Any]) -> Iterator[Tensor]:
    """The tensors among arguments, and in tuples of them."""
    for value in arguments:
        if isinstance(value, Tensor):
            yield value
        elif isinstance(value, tuple):
            yield from tensors_of(value)


def replaced(arguments: Sequence[Any], of: Callable[[Tensor], Any]) -> tuple[Any, ...]:
    """Arguments whose tensors, also those in tuples, are what a function makes of them."""
    return tuple(of(x) if isinstance(x, Tensor) else replaced(x, of) if isinstance(x, tuple) else x for x in arguments)
