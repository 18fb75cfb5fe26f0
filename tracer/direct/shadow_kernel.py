"""Shadow rays of direct light, which wait until there are enough of them to fill lanes.

A ray adds what it finds to a row of sums, as `tracer.lights.shadows.ShadowRays`
counts it, or to the light of a pixel. On a GPU no ray waits.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, in_lanes, scalar
from tracer.lights.shadows import LEAST, MOST, WEIGHT
from tracer.scene.scene import MASK_SHADOW
from tracer.traversal import kernel, waiting_kernel
from tracer.traversal.kernel import triple
from tracer.traversal.lane_kernel import BATCH, new_lanes

Shadows = namedtuple("Shadows", "rays rows numbers weights sums light")
"""Scratch of one thread: rays that wait, and what the row, source and weight of each are; and where their light goes:
rows of sums, or for a row below 0 the pixel ``~row`` of ``light`` ``(3, N)``."""
Arrivals = namedtuple("Arrivals", "sums light")
"""The same for rays that do not wait."""


@allocating
def new_shadows(sums, light):
    """Scratch memory of one thread."""
    return Shadows(
        waiting_kernel.new_waiting(new_lanes()),
        np.zeros(BATCH, np.int32),
        np.zeros(BATCH, np.int32),
        np.zeros(BATCH),
        sums,
        light,
    )


@scalar
def _shoot_alone(shadows, space, sources, origin, direction, distance, weight, row, number):
    transforms, bricks, index, entries, media = space
    grids = bricks, index, entries, media
    light = kernel.transmitted(transforms, grids, origin, direction, 0.0, distance, MASK_SHADOW)
    _arrive(shadows, sources, light, weight, row, number)


@in_lanes(_shoot_alone)
def shoot(shadows, space, sources, origin, direction, distance, weight, row, number):
    """One shadow ray to a source."""
    i = waiting_kernel.add(shadows.rays, origin, direction, distance)
    shadows.rows[i], shadows.numbers[i], shadows.weights[i] = row, number, weight
    if waiting_kernel.is_full(shadows.rays):
        finish(shadows, space, sources)


@scalar
def finish(shadows, space, sources):
    """Trace all rays that wait."""
    transforms, bricks, index, entries, media = space
    grids, rays = (bricks, index, entries, media), shadows.rays
    for i in range(waiting_kernel.trace_all(rays, transforms, grids, MASK_SHADOW)):
        _arrive(shadows, sources, triple(rays.passed, i, 0), shadows.weights[i], shadows.rows[i], shadows.numbers[i])


@scalar
def _arrive(shadows, sources, light, weight, row, number):
    """What a ray to a source lets through goes to where it counts."""
    if row < 0:
        for k in range(3):
            shadows.light[k, ~row] += np.float32(light[k] * weight * sources.colors[number, k])
    else:
        _count(shadows.sums[row], light, weight)


@scalar
def _count(sums, light, weight):
    shade = (light[0] + light[1] + light[2]) / 3
    for k in range(3):
        sums[1 + k] += light[k] * weight
    sums[WEIGHT] += weight
    sums[LEAST] = min(sums[LEAST], shade)
    sums[MOST] = max(sums[MOST], shade)
