"""What the candidates of a tile send to one of its pixels, all at once: `tracer.direct.choice_kernel.importance`.

Of their rectangles only those are looked at that face a point of the tile. Rows of numbers let the compiler take
several lamps in one instruction.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, scalar
from tracer.direct.choice_kernel import weight
from tracer.direct.kernel import CENTER, FACING, MEAN, OFFSET, RADIUS
from tracer.sampling.scatter_kernel import dot
from tracer.traversal.kernel import triple

Near = namedtuple("Near", "x y z offset area height first lamps")
"""Scratch of one thread: facing, offset and area of each rectangle, and how high a point is above it; where those of
each lamp begin; and the lamps, as `tracer.direct.kernel.Sources.lamps`."""


@allocating
def new_near(sources):
    """Scratch memory of one thread."""
    faces, lamps = len(sources.rectangles), sources.lamps.shape[1]
    return Near(
        np.empty(faces), np.empty(faces), np.empty(faces), np.empty(faces), np.empty(faces), np.empty(faces),
        np.zeros(lamps + 1, np.int64),
        np.empty((MEAN + 1, lamps)),
    )  # fmt: skip


@scalar
def gather(near, sources, candidates, low, high):
    """Put lamps into the scratch, for points between ``low`` and ``high``."""
    rectangles, count = sources.rectangles, 0
    for k in range(len(candidates)):
        number = candidates[k]
        for row in range(CENTER, MEAN + 1):
            near.lamps[row, k] = sources.lamps[row, number]
        for r in range(sources.first[number], sources.first[number + 1]):
            facing, offset, most = triple(rectangles, r, FACING), rectangles[r, OFFSET], 0.0
            for axis in range(3):
                most += max(facing[axis] * low[axis], facing[axis] * high[axis])
            if most > offset:
                near.x[count], near.y[count], near.z[count] = facing
                near.offset[count], near.area[count] = offset, math.sqrt(dot(facing, facing))
                count += 1
        near.first[k + 1] = count


@scalar
def closest(near, point, count):
    """Distance to the nearest centre of the first ``count`` lamps."""
    least = np.inf
    for k in range(count):
        x, y, z = near.lamps[0, k] - point[0], near.lamps[1, k] - point[1], near.lamps[2, k] - point[2]
        least = min(least, x * x + y * y + z * z)
    return math.sqrt(least)


@scalar
def importances(near, point, normal, reach, power):
    """`tracer.direct.choice_kernel.importance` of each lamp, into ``power``."""
    x, y, z, offset, height, lamps = near.x, near.y, near.z, near.offset, near.height, near.lamps
    for r in range(near.first[len(power)]):
        above = x[r] * point[0] + y[r] * point[1] + z[r] * point[2] - offset[r]
        height[r] = max(above + near.area[r] * reach, 0.0)
    for k in range(len(power)):
        shown = 0.0
        for r in range(near.first[k], near.first[k + 1]):
            shown += height[r]
        power[k] = shown
    for k in range(len(power)):
        way = lamps[0, k] - point[0], lamps[1, k] - point[1], lamps[2, k] - point[2]
        power[k] *= weight(way, normal, lamps[RADIUS, k] + reach, lamps[MEAN, k])
