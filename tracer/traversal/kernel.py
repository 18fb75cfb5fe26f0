"""The compiled form of `tracer.traversal.reference`: a ray at a time, with steps as long as the space is empty.

Points, directions and cells are triples, in grid coordinates where nothing else is said.

Source: Amanatides and Woo 1987.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from tracer.sampling.scatter_kernel import dot, enters_smooth, scaled
from tracer.scene.grids import HIGH, INDEX, LOW, MASK, MATERIAL, NY, NZ, ORIGIN

SOLID = -1
TINY = 1e-30
ROWS = 64  # rays handed out at a time


@scalar
def _transform(matrix, x, y, z, w):
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3] * w,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3] * w,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3] * w,
    )


@scalar
def _nonzero(d):
    return TINY if abs(d) < TINY else d


@scalar
def _ray(matrix, origin, direction):
    """The ray in grid coordinates: origin, direction, reciprocal direction."""
    o = _transform(matrix, origin[0], origin[1], origin[2], 1.0)
    d = _transform(matrix, direction[0], direction[1], direction[2], 0.0)
    d = (_nonzero(d[0]), _nonzero(d[1]), _nonzero(d[2]))
    return o, d, (1.0 / d[0], 1.0 / d[1], 1.0 / d[2])


@scalar
def _slabs(o, inv, box):
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


@scalar
def _cell(o, d, t, low, high):
    place = o + d * t
    floor = math.floor(place)
    cell = int(floor) - (1 if d < 0 and floor == place else 0)
    return min(max(cell, low), high - 1)


@scalar
def _start(o, d, t, box):
    return (
        _cell(o[0], d[0], t, box[LOW], box[HIGH]),
        _cell(o[1], d[1], t, box[LOW + 1], box[HIGH + 1]),
        _cell(o[2], d[2], t, box[LOW + 2], box[HIGH + 2]),
    )


@scalar
def _counted(cell, box):
    """A voxel, counted from the corner of its grid's index."""
    return cell[0] - box[ORIGIN], cell[1] - box[ORIGIN + 1], cell[2] - box[ORIGIN + 2]


@scalar
def triple(rows, i, k):
    """Three numbers of a row, beginning at column ``k``."""
    return np.float64(rows[i, k]), np.float64(rows[i, k + 1]), np.float64(rows[i, k + 2])


@scalar
def _look(bricks, index, box, c):
    """The voxel id at a cell, and low corner and side of the cube around it that holds the same."""
    x, y, z = c[0] >> 4, c[1] >> 4, c[2] >> 4
    brick = index[box[INDEX] + (x * box[NY] + y) * box[NZ] + z]
    if brick <= 0:
        reach = -brick - 1
        return 0, ((x - reach) << 4, (y - reach) << 4, (z - reach) << 4), (2 * reach + 1) << 4
    value = int(bricks[(brick << 12) + ((c[0] & 15) << 8) + ((c[1] & 15) << 4) + (c[2] & 15)])
    if value >= 0:
        return value, c, 1
    return 0, (c[0] >> -value << -value, c[1] >> -value << -value, c[2] >> -value << -value), 1 << -value


@scalar
def _beyond(o, d, t, low, size, through):
    """One coordinate of the cell after a cube that is left at ``t``, through the face across this axis or another."""
    last = low + size - 1
    out = last + 1 if d > 0 else low - 1
    along = min(max(math.floor(o + d * t), low), last)
    return out if through else along


@scalar
def _step(o, d, inv, low, size):
    """Leave a cube: distance, axis, and the cell beyond. Without branches, which nothing could predict."""
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


@scalar
def _inside(c, box):
    return (
        box[LOW] <= c[0] < box[HIGH] and box[LOW + 1] <= c[1] < box[HIGH + 1] and box[LOW + 2] <= c[2] < box[HIGH + 2]
    )


@scalar
def _find(bricks, index, media, box, o, d, inv, c, t, t_end, axis, medium, silent):
    """Walk to where the medium changes: t (-1 for none), axis, cell, what is there, and what was left."""
    while True:
        value, low, size = _look(bricks, index, box, c)
        if value != medium:
            if medium == SOLID:
                if value == 0 or media[value + box[MATERIAL], 0] < 1.0:
                    medium = value
            elif silent and value == 0:
                medium = 0
            else:
                return t, axis, c, value, medium
        t, axis, c = _step(o, d, inv, low, size)
        if not t < t_end:
            return -1.0, axis, c, 0, 0
        if not _inside(c, box):
            return (t if medium > 0 and not silent else -1.0), axis, c, 0, medium


@scalar
def nearest(transforms, grids, origin, direction, t_begin, t_end, left, mask):
    """The first surface on a ray: t (inf for none), entry (-1), material, face, whether it is the back, voxel, place.

    ``left`` is entry (-1 for none), material and voxel of what the ray begins in; see `tracer.traversal.op.surface`.
    """
    bricks, index, entries, media = grids
    found, t_found, material, face, back = -1, np.inf, 0, 0, False
    voxel, place = (0, 0, 0), (0.0, 0.0, 0.0)
    for entry in range(entries.shape[0]):
        box = entries[entry]
        if not box[MASK] & mask:
            continue
        o, d, inv = _ray(transforms[entry], origin, direction)
        enter, leave, axis = _slabs(o, inv, box)
        t = max(enter, t_begin)
        if not (t < leave and t < t_end and math.isfinite(leave)):
            continue
        c, medium, silent = _start(o, d, t, box), 0, False
        if left[0] == entry:
            c = _counted(left[2], box)
            medium, silent = left[1] - box[MATERIAL], True
        elif enter <= t_begin:
            medium = _look(bricks, index, box, c)[0]
            if medium > 0 and media[medium + box[MATERIAL], 0] >= 1.0:
                medium = SOLID
        t, axis, c, value, medium = _find(bricks, index, media, box, o, d, inv, c, t, t_end, axis, medium, silent)
        if t < 0:
            continue
        found, t_found, t_end, back = entry, t, t, value == 0
        material = (medium if back else value) + box[MATERIAL]
        falls = d[axis] < 0
        face = 2 * axis + (1 if falls else 0)
        step = (1 if falls else -1) if back else 0  # the back of a voxel belongs to the voxel before
        voxel = (
            c[0] + box[ORIGIN] + (step if axis == 0 else 0),
            c[1] + box[ORIGIN + 1] + (step if axis == 1 else 0),
            c[2] + box[ORIGIN + 2] + (step if axis == 2 else 0),
        )
        place = (
            o[0] + d[0] * t + box[ORIGIN],
            o[1] + d[1] * t + box[ORIGIN + 1],
            o[2] + d[2] * t + box[ORIGIN + 2],
        )
    return t_found, found, material, face, back, voxel, place


@scalar
def _dim(light, row, length):
    """Light after a run through a transmissive material."""
    rest = 1.0 - row[0]
    return (
        light[0] * rest * row[1] ** length,
        light[1] * rest * row[2] ** length,
        light[2] * rest * row[3] ** length,
    )


@scalar
def _through(bricks, index, media, box, o, d, inv, t, t_end, axis, light):
    """Light after the whole grid between ``t``, where it comes by the face across ``axis`` (-1 if it begins within),
    and ``t_end``."""
    c, medium, began, within = _start(o, d, t, box), 0, t, False
    while True:
        value, low, size = _look(bricks, index, box, c)
        if value != medium:
            if medium > 0:
                light = _dim(light, media[medium + box[MATERIAL]], t - began)
            if value > 0 and media[value + box[MATERIAL], 0] >= 1.0:
                return (0.0, 0.0, 0.0)
            if (value > 0 or within) and axis >= 0:
                light = scaled(light, _enters(d, axis))
            medium, began, within = value, t, value > 0 and axis < 0
        t, axis, c = _step(o, d, inv, low, size)
        leaves = not _inside(c, box)
        if leaves or not t < t_end:
            if medium > 0:
                light = _dim(light, media[medium + box[MATERIAL]], min(t, t_end) - began)
            return scaled(light, _enters(d, axis)) if within and leaves and t < t_end else light


@scalar
def _enters(d, axis):
    """See `tracer.sampling.scatter_kernel.enters_smooth`, for a face across an axis."""
    return enters_smooth(abs(d[axis]) / math.sqrt(dot(d, d)))


@scalar
def transmitted(transforms, grids, origin, direction, t_begin, t_end, mask):
    """The share of light that comes through between two places on a ray."""
    bricks, index, entries, media = grids
    light = (1.0, 1.0, 1.0)
    for entry in range(len(entries)):
        box = entries[entry]
        if box[MASK] & mask:
            o, d, inv = _ray(transforms[entry], origin, direction)
            enter, leave, axis = _slabs(o, inv, box)
            t = max(enter, t_begin)
            if t < leave and t < t_end and math.isfinite(leave):
                axis = axis if enter > t_begin else -1
                light = _through(bricks, index, media, box, o, d, inv, t, t_end, axis, light)
                if max(light) <= 0.0:
                    break
    return light


@scalar
def _run(bricks, index, box, o, d, inv, t, t_end, c, material):
    """How far the ray goes on through solid voxels, and through the first of the same material."""
    begin, length, same, going = t, 0.0, 0.0, True
    while True:
        value, low, size = _look(bricks, index, box, c)
        going = going and value == material
        if value == 0:
            return length, same
        t, _, c = _step(o, d, inv, low, size)
        length = max(min(t, t_end) - begin, 0.0)
        same = length if going else same
        if not (t < t_end and _inside(c, box)):
            return length, same


@scalar
def run_length(transforms, grids, origin, direction, t, t_end, entry, material, voxel):
    """How far a ray goes on from a surface through voxels that are not air, and through the first of its material."""
    bricks, index, entries, _ = grids
    box = entries[entry]
    o, d, inv = _ray(transforms[entry], origin, direction)
    return _run(bricks, index, box, o, d, inv, t, t_end, _counted(voxel, box), material - box[MATERIAL])
