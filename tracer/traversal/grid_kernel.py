"""Scalar kernels of one ray in one grid: steps over empty boxes, and from cell to cell. See `tracer.traversal.kernel`.

Points, directions and cells are triples, in grid coordinates unless stated otherwise.

Source: Amanatides and Woo 1987.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.scene.grids import HIGH, INDEX, LOW, NY, NZ, ORIGIN

SPHERE = 3  # row of a transform
TINY = 1e-30  # replaces a direction's zero component, so that no division needs a special case


@inlined
def _transform(matrix, x, y, z, w):
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3] * w,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3] * w,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3] * w,
    )


@inlined
def _nonzero(d):
    return TINY if abs(d) < TINY else d


@inlined
def ray_in_grid(matrix, origin, direction):
    """The ray in grid coordinates: origin, direction, reciprocal direction."""
    o = _transform(matrix, origin[0], origin[1], origin[2], 1.0)
    d = _transform(matrix, direction[0], direction[1], direction[2], 0.0)
    d = (_nonzero(d[0]), _nonzero(d[1]), _nonzero(d[2]))
    return o, d, (1.0 / d[0], 1.0 / d[1], 1.0 / d[2])


@inlined
def may_enter(row, origin, direction, t_end):
    """Whether a ray in world space comes near a bounding sphere: its centre, its radius."""
    x, y, z = row[0] - origin[0], row[1] - origin[1], row[2] - origin[2]
    along = x * direction[0] + y * direction[1] + z * direction[2]
    square = direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]
    outside = x * x + y * y + z * z - row[3] * row[3]
    if outside <= 0:
        return True
    return not (along <= 0 or along * along < outside * square or along - row[3] * math.sqrt(square) > t_end * square)


@inlined
def slabs(o, inv, box):
    """Where the ray enters and leaves the box of an entry, and the axis of the face that it enters through."""
    x0, x1 = (box[LOW] - o[0]) * inv[0], (box[HIGH] - o[0]) * inv[0]
    y0, y1 = (box[LOW + 1] - o[1]) * inv[1], (box[HIGH + 1] - o[1]) * inv[1]
    z0, z1 = (box[LOW + 2] - o[2]) * inv[2], (box[HIGH + 2] - o[2]) * inv[2]
    x, y, z = min(x0, x1), min(y0, y1), min(z0, z1)
    leave = min(max(x0, x1), max(y0, y1), max(z0, z1))
    if x >= y and x >= z:
        return x, leave, 0
    if y >= z:
        return y, leave, 1
    return z, leave, 2


@inlined
def _cell(o, d, t, low, high):
    place = o + d * t
    floor = math.floor(place)
    cell = int(floor) - (1 if d < 0 and floor == place else 0)
    return min(max(cell, low), high - 1)


@inlined
def cell_at(o, d, t, box):
    return (
        _cell(o[0], d[0], t, box[LOW], box[HIGH]),
        _cell(o[1], d[1], t, box[LOW + 1], box[HIGH + 1]),
        _cell(o[2], d[2], t, box[LOW + 2], box[HIGH + 2]),
    )


@scalar
def counted(cell, box):
    """A voxel, relative to the corner of its grid's index."""
    return cell[0] - box[ORIGIN], cell[1] - box[ORIGIN + 1], cell[2] - box[ORIGIN + 2]


@inlined
def triple(rows, i, k):
    """Three numbers of a row, beginning at column ``k``."""
    return np.float64(rows[i, k]), np.float64(rows[i, k + 1]), np.float64(rows[i, k + 2])


@inlined
def look(bricks, index, box, c):
    """The voxel id at a cell, and low corner and side of the uniform cube around it."""
    x, y, z = c[0] >> 4, c[1] >> 4, c[2] >> 4
    brick = index[box[INDEX] + (x * box[NY] + y) * box[NZ] + z]
    if brick <= 0:
        reach = -brick - 1
        return 0, ((x - reach) << 4, (y - reach) << 4, (z - reach) << 4), (2 * reach + 1) << 4
    value = int(bricks[(brick << 12) + ((c[0] & 15) << 8) + ((c[1] & 15) << 4) + (c[2] & 15)])
    if value >= 0:
        return value, c, 1
    return 0, (c[0] >> -value << -value, c[1] >> -value << -value, c[2] >> -value << -value), 1 << -value


@inlined
def _beyond(o, d, t, low, size, through):
    """One coordinate of the cell after a cube left at ``t``; ``through``: by the face across this axis."""
    last = low + size - 1
    out = last + 1 if d > 0 else low - 1
    along = min(max(int(math.floor(o + d * t)), low), last)  # noqa: RUF046 - CUDA floors to a float
    return out if through else along


@inlined
def step(o, d, inv, low, size):
    """Leave a cube: distance, axis, and the cell beyond. Branch-free, as branches would be unpredictable."""
    tx = (low[0] + (size if d[0] > 0 else 0) - o[0]) * inv[0]
    ty = (low[1] + (size if d[1] > 0 else 0) - o[1]) * inv[1]
    tz = (low[2] + (size if d[2] > 0 else 0) - o[2]) * inv[2]
    t = tx if tx < ty else ty
    t = t if t < tz else tz
    x = tx == t
    y = (ty == t) & (not x)
    z = not (x | y)
    cell = (
        _beyond(o[0], d[0], t, low[0], size, x),
        _beyond(o[1], d[1], t, low[1], size, y),
        _beyond(o[2], d[2], t, low[2], size, z),
    )
    return t, y + 2 * z, cell


@inlined
def inside(c, box):
    return (
        box[LOW] <= c[0] < box[HIGH] and box[LOW + 1] <= c[1] < box[HIGH + 1] and box[LOW + 2] <= c[2] < box[HIGH + 2]
    )
