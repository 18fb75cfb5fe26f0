"""Shadow rays from places in fog, which wait until there are enough of them to fill lanes; on a GPU none waits.

See `tracer.traversal.batch_kernel`."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, in_lanes, scalar
from tracer.scene.scene import MASK_SHADOW
from tracer.traversal import batch_kernel, kernel
from tracer.traversal.lane_kernel import BATCH, new_lanes

Waiting = namedtuple("Waiting", "lanes origins directions spans passed colors rows used light")
"""Scratch of one thread: a batch of rays, what passes along each, the light that it would bring, and the row of
``light`` ``(N, 3)`` that it goes to; and how many rays there are."""
Arriving = namedtuple("Arriving", "light")
"""The same for rays that do not wait."""


@allocating
def new_waiting(light):
    """Scratch memory of one thread."""
    return Waiting(
        new_lanes(),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 2)),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 3)),
        np.zeros(BATCH, np.int32),
        np.zeros(1, np.int64),
        light,
    )


@scalar
def _shoot_alone(waiting, space, origin, direction, distance, color, row):
    transforms, bricks, index, entries, media = space
    grids = bricks, index, entries, media
    passed = kernel.transmitted(transforms, grids, origin, direction, 0.0, distance, MASK_SHADOW)
    for k in range(3):
        waiting.light[row, k] += np.float32(passed[k] * color[k])


@in_lanes(_shoot_alone)
def shoot(waiting, space, origin, direction, distance, color, row):
    """One shadow ray, along which light of a color comes to a row."""
    i = waiting.used[0]
    for k in range(3):
        waiting.origins[i, k], waiting.directions[i, k], waiting.colors[i, k] = origin[k], direction[k], color[k]
    waiting.spans[i, 1], waiting.rows[i] = distance, row
    waiting.used[0] = i + 1
    if i + 1 == BATCH:
        finish(waiting, space)


@scalar
def finish(waiting, space):
    """Trace all rays that wait."""
    transforms, bricks, index, entries, media = space
    count = waiting.used[0]
    rays = waiting.origins[:count], waiting.directions[:count], waiting.spans[:count]
    passed = waiting.passed[:count]
    batch_kernel.transmitted(waiting.lanes, transforms, (bricks, index, entries, media), rays, MASK_SHADOW, passed)
    for i in range(count):
        for k in range(3):
            waiting.light[waiting.rows[i], k] += np.float32(passed[i, k] * waiting.colors[i, k])
    waiting.used[0] = 0
