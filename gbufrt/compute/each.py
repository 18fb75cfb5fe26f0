"""A scalar body over many independent items, on the CPU or on a GPU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import prange
from torch import Tensor

from gbufrt.compute.dispatch import simulated
from gbufrt.compute.kernel import CPU, Kernel, array, replaced, scalar, tensors_of, threads

Argument = Tensor | float | tuple[Any, ...]
ROWS = 64  # items handed to a thread at a time


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
def pixel_of(i, height, width):
    """Picture, row and column of an item that is a pixel of one of several pictures."""
    return i // (height * width), i // width % height, i % width


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
