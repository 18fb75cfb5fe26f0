"""Run `tracer.traversal.kernel` over many rays, on the CPU or on a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from numba import prange
from torch import Tensor

from gbufrt.compute.dispatch import simulated
from gbufrt.compute.each import Each
from gbufrt.compute.kernel import array, driver, scalar, threads
from tracer.traversal import batch_kernel, kernel, run_kernel
from tracer.traversal.lane_kernel import BATCH, new_lanes

surface_each, transmit_each, runs_each = Each(kernel.surface), Each(kernel.transmit), Each(kernel.runs)


@scalar
def _batches(rays, pictures):
    """How many batches all rays make, when each holds rays of one of ``pictures`` alone."""
    return pictures * ((rays // pictures + BATCH - 1) // BATCH)


@scalar
def _batch(n, rays, pictures):
    """The picture of a batch, its first ray, and the one after its last."""
    each = rays // pictures
    batches = (each + BATCH - 1) // BATCH
    picture, begin = n // batches, n % batches * BATCH
    return picture, picture * each + begin, picture * each + min(begin + BATCH, each)


@scalar
def _nearest_of(lanes, begin, end, own, grids, rays, left, mask, numbers, ids):
    origins, directions, spans = rays
    some = origins[begin:end], directions[begin:end], spans[begin:end]
    batch_kernel.nearest(lanes, own, grids, some, left[begin:end], mask, numbers[begin:end], ids[begin:end])


@scalar
def _transmitted_of(lanes, begin, end, own, grids, rays, mask, passed):
    origins, directions, spans = rays
    some = origins[begin:end], directions[begin:end], spans[begin:end]
    batch_kernel.transmitted(lanes, own, grids, some, mask, passed[begin:end])


@driver
def transmitted_all(rays, transforms, grids, mask, passed, lanes):
    count, pictures = len(passed), len(transforms)
    for lane in prange(lanes):
        scratch = new_lanes()
        for n in range(lane, _batches(count, pictures), lanes):
            picture, begin, end = _batch(n, count, pictures)
            _transmitted_of(scratch, begin, end, transforms[picture], grids, rays, mask, passed)


@scalar
def _runs_of(lanes, begin, end, own, grids, rays, starts, lengths):
    origins, directions, spans = rays
    some = origins[begin:end], directions[begin:end], spans[begin:end]
    run_kernel.run_lengths(lanes, own, grids, some, starts[begin:end], lengths[begin:end])


@driver
def runs_all(rays, transforms, grids, starts, lengths, lanes):
    count, pictures = len(lengths), len(transforms)
    for lane in prange(lanes):
        scratch = new_lanes()
        for n in range(lane, _batches(count, pictures), lanes):
            picture, begin, end = _batch(n, count, pictures)
            _runs_of(scratch, begin, end, transforms[picture], grids, rays, starts, lengths)


@driver
def nearest_all(rays, transforms, grids, left, mask, numbers, ids, lanes):
    count, pictures = len(numbers), len(transforms)
    for lane in prange(lanes):
        scratch = new_lanes()
        for n in range(lane, _batches(count, pictures), lanes):
            picture, begin, end = _batch(n, count, pictures)
            _nearest_of(scratch, begin, end, transforms[picture], grids, rays, left, mask, numbers, ids)


def surface(rays: Sequence[Tensor], grids: Sequence[Tensor], left: Tensor, mask: int) -> tuple[Tensor, Tensor]:
    """See `tracer.traversal.op.surface`."""
    count = len(rays[0])
    numbers = rays[0].new_zeros(count, 4, dtype=torch.float32)
    ids = rays[0].new_zeros(count, 7, dtype=torch.int32)
    if simulated() or numbers.is_cuda:
        surface_each(count, *rays, *grids, left, mask, numbers, ids)
    elif count:
        nearest_all(*_arrays(rays, grids), array(left), mask, array(numbers), array(ids), threads())
    return numbers, ids


def transmit(rays: Sequence[Tensor], grids: Sequence[Tensor], mask: int) -> Tensor:
    """See `tracer.traversal.op.transmit`."""
    passed = rays[0].new_empty(len(rays[0]), 3, dtype=torch.float32)
    if simulated() or passed.is_cuda:
        transmit_each(len(passed), *rays, *grids, mask, passed)
    elif len(passed):
        transmitted_all(*_arrays(rays, grids), mask, array(passed), threads())
    return passed


def runs(rays: Sequence[Tensor], grids: Sequence[Tensor], starts: Tensor) -> Tensor:
    """See `tracer.traversal.op.runs`."""
    lengths = rays[0].new_zeros(len(starts), 2, dtype=torch.float32)
    if simulated() or lengths.is_cuda:
        runs_each(len(starts), *rays, *grids, starts, lengths)
    elif len(starts):
        runs_all(*_arrays(rays, grids), array(starts), array(lengths), threads())
    return lengths


def _arrays(rays: Sequence[Tensor], grids: Sequence[Tensor]) -> tuple[Any, ...]:
    """Origins, directions and spans; transforms; grids."""
    return tuple(array(x) for x in rays[:3]), array(rays[3]), tuple(array(x) for x in grids)
