"""The compiled form of `IrradianceCache.look_up`: one place at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.compute.search import lower_bound
from tracer.cache.cells import BITS, SIDES
from tracer.cache.irradiance import LEAST, PRIOR

MASK = (1 << BITS) - 1
FINE, COARSE = SIDES


@scalar
def cell(point, normal, side, level):
    """See `tracer.cache.cells.cells`."""
    x, y, z = abs(normal[0]), abs(normal[1]), abs(normal[2])
    axis = 0 if x >= y and x >= z else 1 if y >= z else 2
    key = 2 * axis + (1 if normal[axis] > 0 else 0) + 6 * level
    key = (key << BITS) + (np.int64(math.floor(point[0] / side)) & MASK)
    key = (key << BITS) + (np.int64(math.floor(point[1] / side)) & MASK)
    return (key << BITS) + (np.int64(math.floor(point[2] / side)) & MASK)


@scalar
def row_of(keys, key):
    """The row of a key among ascending ``keys``, -1 for none."""
    row = lower_bound(keys, key)
    return row if row < len(keys) and keys[row] == key else -1


@scalar
def look_up(keys, values, point, normal):
    """Radiance, and whether it is known; ``values`` ``(N, 4)`` are radiance and weight."""
    coarse = row_of(keys, cell(point, normal, COARSE, 1))
    if coarse < 0 or values[coarse, 3] < LEAST:
        return (0.0, 0.0, 0.0), False
    more = min(np.float64(values[coarse, 3]), PRIOR)
    fine = row_of(keys, cell(point, normal, FINE, 0))
    if fine < 0:
        return (np.float64(values[coarse, 0]), np.float64(values[coarse, 1]), np.float64(values[coarse, 2])), True
    own = np.float64(values[fine, 3])
    first, second = own / (own + more), more / (own + more)
    return (
        values[fine, 0] * first + values[coarse, 0] * second,
        values[fine, 1] * first + values[coarse, 1] * second,
        values[fine, 2] * first + values[coarse, 2] * second,
    ), True
