"""Shadow rays of direct light, which wait until there are enough of them to fill lanes.

See `tracer.traversal.batch_kernel`. A ray adds what it finds to a row of sums, as `tracer.lights.shadows.ShadowRays`
counts it, or to the light of a pixel. On a GPU no ray waits.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, in_lanes, scalar
from tracer.lights.shadows import LEAST, MOST, WEIGHT
from tracer.scene.scene import MASK_SHADOW
from tracer.traversal import batch_kernel, kernel
from tracer.traversal.kernel import triple
from tracer.traversal.lane_kernel import BATCH, new_lanes

Shadows = namedtuple("Shadows", "lanes origins directions spans passed rows numbers weights used sums light")
"""Scratch of one thread: a batch of rays, what passes along each, and what its row, source and weight are; how many
there are; and where their light goes: rows of sums, or for a row below 0 the pixel ``~row`` of ``light`` ``(3, N)``."""
Arrivals = namedtuple("Arrivals", "sums light")
"""The same for rays that do not wait."""


@allocating
def new_shadows(sums, light):
    """Scratch memory of one thread."""
    return Shadows(
        new_lanes(),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 2)),
        np.zeros((BATCH, 3)),
        np.zeros(BATCH, np.int32),
        np.zeros(BATCH, np.int32),
        np.zeros(BATCH),
        np.zeros(1, np.int64),
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
    i = shadows.used[0]
    for k in range(3):
        shadows.origins[i, k], shadows.directions[i, k] = origin[k], direction[k]
    shadows.spans[i, 1] = distance
    shadows.rows[i], shadows.numbers[i], shadows.weights[i] = row, number, weight
    shadows.used[0] = i + 1
    if i + 1 == BATCH:
        finish(shadows, space, sources)


@scalar
def finish(shadows, space, sources):
    """Trace all rays that wait."""
    transforms, bricks, index, entries, media = space
    count = shadows.used[0]
    rays = shadows.origins[:count], shadows.directions[:count], shadows.spans[:count]
    grids, passed = (bricks, index, entries, media), shadows.passed[:count]
    batch_kernel.transmitted(shadows.lanes, transforms, grids, rays, MASK_SHADOW, passed)
    for i in range(count):
        _arrive(shadows, sources, triple(passed, i, 0), shadows.weights[i], shadows.rows[i], shadows.numbers[i])
    shadows.used[0] = 0


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
