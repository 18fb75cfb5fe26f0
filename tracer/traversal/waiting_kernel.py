"""Rays that wait until there are enough of them to fill lanes, then find together what passes along each.

See `tracer.traversal.batch_kernel`. What a ray is for, its owner keeps beside it, by the ray's number. On a GPU no ray
waits.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, inlined, scalar
from tracer.traversal import batch_kernel
from tracer.traversal.lane_kernel import BATCH

Waiting = namedtuple("Waiting", "lanes origins directions spans passed used")
"""Scratch of one thread: at most `BATCH` rays, what passes along each, and how many there are."""


@allocating
def new_waiting(lanes):
    """Scratch memory of one thread, whose lanes may serve several batches."""
    return Waiting(
        lanes,
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 2)),
        np.zeros((BATCH, 3)),
        np.zeros(1, np.int64),
    )


@inlined
def add(waiting, origin, direction, t_end):
    """Add a ray from 0 to ``t_end``; its number."""
    i = waiting.used[0]
    for k in range(3):
        waiting.origins[i, k], waiting.directions[i, k] = origin[k], direction[k]
    waiting.spans[i, 1] = t_end
    waiting.used[0] = i + 1
    return i


@inlined
def is_full(waiting):
    """Whether there is no room for another ray."""
    return waiting.used[0] == BATCH


@scalar
def trace_all(waiting, transforms, grids, mask):
    """Fill ``passed`` for all rays, which wait no longer; how many they were."""
    count = waiting.used[0]
    rays = waiting.origins[:count], waiting.directions[:count], waiting.spans[:count]
    batch_kernel.transmitted(waiting.lanes, transforms, grids, rays, mask, waiting.passed[:count])
    waiting.used[0] = 0
    return count
