"""Run `tracer.traversal.kernel` over many rays, on the CPU or on a GPU."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from gbufrt.compute.each import Each
from tracer.traversal import kernel

surface_each, transmit_each, runs_each = Each(kernel.surface), Each(kernel.transmit), Each(kernel.runs)


def surface(rays: Sequence[Tensor], grids: Sequence[Tensor], left: Tensor, mask: int) -> tuple[Tensor, Tensor]:
    """See `tracer.traversal.op.surface`."""
    count = len(rays[0])
    numbers = rays[0].new_zeros(count, 4, dtype=torch.float32)
    ids = rays[0].new_zeros(count, 7, dtype=torch.int32)
    surface_each(count, *rays, *grids, left, mask, numbers, ids)
    return numbers, ids


def transmit(rays: Sequence[Tensor], grids: Sequence[Tensor], mask: int) -> Tensor:
    """See `tracer.traversal.op.transmit`."""
    passed = rays[0].new_empty(len(rays[0]), 3, dtype=torch.float32)
    transmit_each(len(passed), *rays, *grids, mask, passed)
    return passed


def runs(rays: Sequence[Tensor], grids: Sequence[Tensor], starts: Tensor) -> Tensor:
    """See `tracer.traversal.op.runs`."""
    lengths = rays[0].new_zeros(len(starts), 2, dtype=torch.float32)
    runs_each(len(starts), *rays, *grids, starts, lengths)
    return lengths
