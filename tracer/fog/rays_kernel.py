"""Shadow rays from places in fog, which wait until there are enough of them to fill lanes; on a GPU none waits."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, in_lanes, scalar
from tracer.scene.scene import MASK_SHADOW
from tracer.traversal import kernel, waiting_kernel
from tracer.traversal.lane_kernel import BATCH, new_lanes

Shadows = namedtuple("Shadows", "rays colors rows light")
"""Scratch of one thread: rays that wait; the light that each would bring, and the row of ``light`` ``(N, 3)`` that it
goes to."""
Arriving = namedtuple("Arriving", "light")
"""The same for rays that do not wait."""


@allocating
def new_shadows(light):
    """Scratch memory of one thread."""
    return Shadows(waiting_kernel.new_waiting(new_lanes()), np.zeros((BATCH, 3)), np.zeros(BATCH, np.int32), light)


@scalar
def _shoot_alone(shadows, space, origin, direction, distance, color, row):
    transforms, bricks, index, entries, media = space
    grids = bricks, index, entries, media
    passed = kernel.transmitted(transforms, grids, origin, direction, 0.0, distance, MASK_SHADOW)
    for k in range(3):
        shadows.light[row, k] += np.float32(passed[k] * color[k])


@in_lanes(_shoot_alone)
def shoot(shadows, space, origin, direction, distance, color, row):
    """One shadow ray, along which light of a color comes to a row."""
    i = waiting_kernel.add(shadows.rays, origin, direction, distance)
    shadows.colors[i, 0], shadows.colors[i, 1], shadows.colors[i, 2] = color
    shadows.rows[i] = row
    if waiting_kernel.is_full(shadows.rays):
        finish(shadows, space)


@scalar
def finish(shadows, space):
    """Trace all rays that wait."""
    transforms, bricks, index, entries, media = space
    grids = bricks, index, entries, media
    for i in range(waiting_kernel.trace_all(shadows.rays, transforms, grids, MASK_SHADOW)):
        for k in range(3):
            shadows.light[shadows.rows[i], k] += np.float32(shadows.rays.passed[i, k] * shadows.colors[i, k])
