"""The compiled walks of `tracer.traversal.kernel` over many rays at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numba import prange
from torch import Tensor

from gbufrt import specular
from gbufrt.compute.kernel import array, checksum, driver, scalar, threads
from tracer.sampling import scatter_kernel
from tracer.scene import grids as layout
from tracer.traversal import kernel as walk_kernel
from tracer.traversal.kernel import nearest, run_length, transmitted, triple

ROWS = 64  # rays handed out at a time


@scalar
def _surface(i, batch, rays, grids, left, mask, numbers, ids):
    origins, directions, spans, transforms = rays
    before = (-1, 0, (0, 0, 0))
    if left.shape[0] > 0:
        before = (int(left[i, 1]), int(left[i, 0]), (int(left[i, 2]), int(left[i, 3]), int(left[i, 4])))
    origin, direction = triple(origins, i, 0), triple(directions, i, 0)
    t_begin, t_end = np.float64(spans[i, 0]), np.float64(spans[i, 1])
    t, entry, material, face, back, voxel, place = nearest(
        transforms[batch], grids, origin, direction, t_begin, t_end, before, mask
    )
    numbers[i, 0], ids[i, 0], ids[i, 1], ids[i, 2], ids[i, 3] = t, material, entry, face, back
    for k in range(3):
        numbers[i, 1 + k], ids[i, 4 + k] = place[k], voxel[k]


def _compiled(sources: int) -> tuple[Any, ...]:
    """The drivers, compiled anew when ``sources`` change; see `gbufrt.compute.kernel`."""

    @driver
    def surface_all(rays, grids, left, mask, lanes, numbers, ids):
        count = len(rays[0])
        each = count // len(rays[3])
        for lane in prange(lanes):
            for begin in range(lane * ROWS, count, lanes * ROWS):
                for i in range(begin, min(begin + ROWS, count)):
                    _surface(i, i // each, rays, grids, left, mask, numbers, ids)
        return sources

    @driver
    def transmit_all(rays, grids, mask, lanes, passed):
        count = len(rays[0])
        each = count // len(rays[3])
        for lane in prange(lanes):
            for begin in range(lane * ROWS, count, lanes * ROWS):
                for i in range(begin, min(begin + ROWS, count)):
                    origin, direction = triple(rays[0], i, 0), triple(rays[1], i, 0)
                    begins, ends = np.float64(rays[2][i, 0]), np.float64(rays[2][i, 1])
                    light = transmitted(rays[3][i // each], grids, origin, direction, begins, ends, mask)
                    passed[i, 0], passed[i, 1], passed[i, 2] = light
        return sources

    @driver
    def runs_all(rays, grids, starts, lanes, lengths):
        origins, directions, spans, transforms = rays
        each = len(origins) // len(transforms)
        for lane in prange(lanes):
            for begin in range(lane * ROWS, len(origins), lanes * ROWS):
                for i in range(begin, min(begin + ROWS, len(origins))):
                    if starts[i, 1] >= 0:
                        origin, direction = triple(origins, i, 0), triple(directions, i, 0)
                        t, t_end = np.float64(spans[i, 0]), np.float64(spans[i, 1])
                        voxel = (int(starts[i, 2]), int(starts[i, 3]), int(starts[i, 4]))
                        lengths[i, 0], lengths[i, 1] = run_length(
                            transforms[i // each], grids, origin, direction, t, t_end, starts[i, 1], starts[i, 0], voxel
                        )
        return sources

    return surface_all, transmit_all, runs_all


surface_all, transmit_all, runs_all = _compiled(checksum(walk_kernel, scatter_kernel, specular, layout))


def surface(rays: Sequence[Tensor], grids: Sequence[Tensor], left: Tensor, mask: int) -> tuple[Tensor, Tensor]:
    """See `tracer.traversal.op.surface`."""
    numbers, ids = torch.zeros(len(rays[0]), 4), torch.zeros(len(rays[0]), 7, dtype=torch.int32)
    surface_all(_arrays(rays), _arrays(grids), array(left), mask, threads(), array(numbers), array(ids))
    return numbers, ids


def transmit(rays: Sequence[Tensor], grids: Sequence[Tensor], mask: int) -> Tensor:
    """See `tracer.traversal.op.transmit`."""
    passed = torch.empty(len(rays[0]), 3)
    transmit_all(_arrays(rays), _arrays(grids), mask, threads(), array(passed))
    return passed


def runs(rays: Sequence[Tensor], grids: Sequence[Tensor], starts: Tensor) -> Tensor:
    """See `tracer.traversal.op.runs`."""
    lengths = torch.zeros(len(starts), 2)
    runs_all(_arrays(rays), _arrays(grids), array(starts), threads(), array(lengths))
    return lengths


def _arrays(tensors: Sequence[Tensor]) -> tuple[np.ndarray, ...]:
    return tuple(array(tensor) for tensor in tensors)
