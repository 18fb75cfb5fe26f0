"""Rays on their way into lanes: which come near a grid, and where they enter it, many side by side.

See `tracer.traversal.lane_kernel`.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.scene.grids import HIGH, LOW
from tracer.traversal.grid_kernel import SPHERE, may_enter, ray_in_grid, slabs, triple
from tracer.traversal.lane_kernel import (
    AXIS,
    BEGAN,
    CX,
    DID,
    DX,
    DY,
    DZ,
    END_X,
    FIRST,
    GOES,
    GROUP,
    IX,
    LANES,
    LEAVES,
    MEDIUM,
    MIRROR_X,
    OX,
    OY,
    OZ,
    RAY,
    T_END,
    VALUE,
    WITHIN,
    T,
)


@scalar
def find_near(lanes, count, first, transforms, rays):
    """Tell which of up to `GROUP` entries from ``first`` on each of ``count`` rays comes near."""
    origins, directions, _ = rays
    last = min(first + GROUP, transforms.shape[0])
    for i in range(count):
        origin, direction, t_end, bits = triple(origins, i, 0), triple(directions, i, 0), lanes.ends[i], 0
        for entry in range(first, last):
            if may_enter(transforms[entry, SPHERE], origin, direction, t_end):
                bits |= 1 << (entry - first)
        lanes.near[i] = bits


@scalar
def queue(lanes, count, entry):
    """Queue the rays that come near an entry, all for the first; how many they are."""
    bit, queued = (entry - 1) % GROUP, 0
    for i in range(count):
        if entry == 0 or lanes.near[i] >> bit & 1:
            lanes.queue[queued] = i
            queued += 1
    return queued


@inlined
def _clamped_cell(o, d, t, low, high):
    """See `tracer.traversal.grid_kernel.cell_at`."""
    place = o + d * t
    floor = np.floor(place)
    cell = np.int32(floor) - (np.int32(1) if (d < 0) & (floor == place) else np.int32(0))
    return np.int32(min(max(cell, low), np.int32(high - 1)))


@inlined
def _mirror(rows, wholes, x, box, o, d, inv, t, k):
    """Store one coordinate of a ray and of its cell, mirrored where it falls."""
    falls, c = d < 0, _clamped_cell(o, d, t, box[LOW + k], box[HIGH + k])
    mirror = np.int32(-1) if falls else np.int32(0)
    wholes[MIRROR_X + k * LANES + x], wholes[CX + k * LANES + x] = mirror, c ^ mirror
    wholes[END_X + k * LANES + x] = np.int32(-box[LOW + k]) if falls else box[HIGH + k]
    rows[OX + k * LANES + x] = -o if falls else o
    rows[DX + k * LANES + x], rows[IX + k * LANES + x] = abs(d), abs(inv)


@scalar
def _read(lanes, first, count, rays):
    """Read queued rays, as they are in world space, into the rows of those that take a lane next."""
    origins, directions, spans = rays
    rows, wholes = lanes.next_numbers, lanes.next_wholes
    for x in range(count):
        i = lanes.queue[first + x]
        rows[OX + x], rows[OY + x], rows[OZ + x] = triple(origins, i, 0)
        rows[DX + x], rows[DY + x], rows[DZ + x] = triple(directions, i, 0)
        rows[T + x], rows[T_END + x], wholes[RAY + x] = spans[i, 0], lanes.ends[i], i


@scalar
def prepare(lanes, first, queued, transform, box, rays):
    """Ready up to `LANES` queued rays for a lane; how many. Those whose ``DID`` is `LEAVES` do not enter the grid."""
    count = min(LANES, queued - first)
    _read(lanes, first, count, rays)
    rows, wholes = lanes.next_numbers, lanes.next_wholes
    for x in range(count):
        origin, direction = (rows[OX + x], rows[OY + x], rows[OZ + x]), (rows[DX + x], rows[DY + x], rows[DZ + x])
        o, d, inv = ray_in_grid(transform, origin, direction)
        near, leave, axis = slabs(o, inv, box)
        begin = rows[T + x]
        t = max(near, begin)
        enters = (t < leave) & (t < rows[T_END + x]) & (leave < np.inf)
        rows[T + x], wholes[AXIS + x] = t, axis
        wholes[DID + x] = np.int32(GOES) if enters else np.int32(LEAVES)
        wholes[FIRST + x] = np.int32(0) if near > begin else np.int32(1)
        _mirror(rows, wholes, x, box, o[0], d[0], inv[0], t, 0)
        _mirror(rows, wholes, x, box, o[1], d[1], inv[1], t, 1)
        _mirror(rows, wholes, x, box, o[2], d[2], inv[2], t, 2)
    return count


@inlined
def take(lanes, x, source):
    """Give lane ``x`` one of the rays that are ready."""
    for row in range(BEGAN // LANES):
        lanes.numbers[row * LANES + x] = lanes.next_numbers[row * LANES + source]
    for row in range(VALUE // LANES):
        lanes.wholes[row * LANES + x] = lanes.next_wholes[row * LANES + source]
    lanes.wholes[MEDIUM + x], lanes.wholes[WITHIN + x] = 0, 0
