"""A scalar body over many independent items, on the CPU or on a GPU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import prange
from torch import Tensor

from gbufrt.compute.dispatch import simulated
from gbufrt.compute.kernel import CPU, Kernel, array, in_lanes, inlined, replaced, scalar, tensors_of, threads

Argument = Tensor | float | tuple[Any, ...]
ROWS = 64  # items handed to a thread at a time
STRIP = 4  # rows; 32 threads then read 32 bytes of each


def item(i: int, *arguments: Any) -> None:
    """Placeholder for the body in the loop below."""


@scalar
def _items(begin, end, arguments):
    """A helper of its own, so that references to arrays are counted once for all of its items."""
    for i in range(begin, end):
        item(i, *arguments)


def _each(count, lanes, arguments):
    for lane in prange(lanes):
        for begin in range(lane * ROWS, count, lanes * ROWS):
            _items(begin, min(begin + ROWS, count), arguments)


@scalar
def parted(i, size):
    """Quotient and remainder, of less than 2^32: GPUs take 32 bits several times as fast as 64."""
    i, size = np.uint32(i), np.uint32(size)
    return np.int64(i // size), np.int64(i % size)


@scalar
def _pixel_in_strips(i, height, width):
    """As `pixel_of`, down and along strips of `STRIP` rows: a GPU's threads that run together lie close together."""
    picture, place = parted(i, height * width)
    strip, within = parted(place, STRIP * width)
    first = STRIP * strip
    column, row = parted(within, min(STRIP, height - first))
    return picture, first + row, column


@in_lanes(_pixel_in_strips)
def pixel_of(i, height, width):
    """Picture, row and column of an item that is a pixel of one of several pictures."""
    row, column = parted(i, width)
    return *parted(row, height), column


@inlined
def _one(count):
    return 1


@in_lanes(_one)
@inlined
def pixels(count):
    """How many pixels a part of a row has, which must have one, and begins and ends with its item.

    A GPU's threads have a pixel each. If their compiler knows, it makes no loop of it, and keeps in registers what rows
    of scratch hold.
    """
    return count


def counted(number: int) -> tuple[int, ...]:
    """As many numbers as there are channels, radii or the like: a body that takes them instead of their number is
    compiled for it, and a GPU's thread keeps its sums over them in registers."""
    return (0,) * number


class Each:
    """``body(i, *arguments)`` for every i below a count.

    Args:
        body: marked `scalar`; takes the index of its item, then flat arrays, numbers, and tuples of them.
    """

    def __init__(self, body: Callable[..., Any]) -> None:
        self.body = body
        self.on_cpu = Kernel(_each, CPU, item=body)

    def __call__(self, count: int, *arguments: Argument) -> None:
        """Run the body where the tensors lie.

        Args:
            count: the number of items.
            arguments: of the body, after the index of the item. Tensors that it writes to must be contiguous.
        """
        if simulated() or any(x.is_cuda for x in tensors_of(arguments)):
            self.on_cuda(count, *arguments)
        else:
            self.on_cpu(count, threads(), replaced(arguments, array))

    def on_cuda(self, count: int, *arguments: Argument) -> None:
        """As `__call__`, on the GPU or in numba's simulator, which takes CPU tensors."""
        from gbufrt.compute.cuda import launch

        launch(self.body, count, arguments)
