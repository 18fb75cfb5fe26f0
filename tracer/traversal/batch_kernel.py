"""`tracer.traversal.kernel` for many rays at a time, in lanes: see `tracer.traversal.lane_kernel`.

Entries are passed over one after the other, and all rays go through one before any goes through the next.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.sampling.scatter_kernel import scaled
from tracer.scene.grids import MASK, MATERIAL, ORIGIN
from tracer.traversal import lane_kernel as lane
from tracer.traversal.entry_kernel import find_near, prepare, queue, take
from tracer.traversal.grid_kernel import counted, triple
from tracer.traversal.kernel import SOLID, dimmed, enters
from tracer.traversal.lane_kernel import GROUP, LANES, advance, cell_of, move, pass_through, put_cell, ray_of


@scalar
def _opaque(media, box, value):
    return media[value + box[MATERIAL], 0] >= 1.0


@inlined
def _start(lanes, x, entry, box, left):
    """Start the ray that has taken lane ``x`` as `tracer.traversal.kernel.nearest` does."""
    wholes, i = lanes.wholes, lanes.wholes[lane.RAY + x]
    if left.shape[0] > 0 and left[i, 1] == entry:
        put_cell(lanes, x, counted((left[i, 2], left[i, 3], left[i, 4]), box))
        wholes[lane.MEDIUM + x], wholes[lane.WITHIN + x], wholes[lane.FIRST + x] = left[i, 0] - box[MATERIAL], 1, 0


@scalar
def _found(lanes, x, entry, box, numbers, ids):
    """Write the surface that a lane has met."""
    rows, wholes = lanes.numbers, lanes.wholes
    i, t, axis = wholes[lane.RAY + x], rows[lane.T + x], wholes[lane.AXIS + x]
    value, c, (o, d) = wholes[lane.VALUE + x], cell_of(lanes, x), ray_of(lanes, x)
    back, falls = value == 0, d[axis] < 0
    offset = (1 if falls else -1) if back else 0  # a back face belongs to the voxel before it
    lanes.ends[i], numbers[i, 0] = t, t
    ids[i, 0] = (wholes[lane.MEDIUM + x] if back else value) + box[MATERIAL]
    ids[i, 1], ids[i, 2], ids[i, 3] = entry, 2 * axis + (1 if falls else 0), back
    for k in range(3):
        numbers[i, 1 + k] = o[k] + d[k] * t + box[ORIGIN + k]
        ids[i, 4 + k] = c[k] + box[ORIGIN + k] + (offset if axis == k else 0)


@inlined
def _ends(lanes, x, entry, media, box, numbers, ids):
    """Whether a lane's ray goes no further, see `tracer.traversal.kernel._find`; writes the surface that it meets."""
    wholes = lanes.wholes
    medium, silent = wholes[lane.MEDIUM + x], wholes[lane.WITHIN + x] > 0
    if wholes[lane.DID + x] == lane.LEAVES:
        if medium > 0 and not silent and lanes.numbers[lane.T + x] < lanes.numbers[lane.T_END + x]:
            wholes[lane.VALUE + x] = 0
            _found(lanes, x, entry, box, numbers, ids)
        return True
    value = wholes[lane.VALUE + x]
    if wholes[lane.FIRST + x] > 0:
        wholes[lane.MEDIUM + x] = SOLID if _opaque(media, box, value) else value
        wholes[lane.FIRST + x] = 0
        return False
    if medium == SOLID and value > 0 and _opaque(media, box, value):
        pass_through(lanes, x)
        return wholes[lane.DID + x] == lane.LEAVES
    if medium == SOLID or (silent and value == 0):
        wholes[lane.MEDIUM + x] = value
        return False
    _found(lanes, x, entry, box, numbers, ids)
    return True


@scalar
def _nearest_in(lanes, queued, entry, transform, grids, rays, left, numbers, ids):
    """The surfaces of one entry that are nearer than what was found before."""
    bricks, index, entries, media = grids
    box, used, idle, begun, ready, count = entries[entry], 0, 0, 0, 0, 0
    while True:
        while (idle or used < LANES) and (ready < count or begun < queued):
            if ready == count:
                count, ready = prepare(lanes, begun, queued, transform, box, rays), 0
                begun += count
            if lanes.next_wholes[lane.DID + ready] == lane.GOES:
                x = lanes.idle[idle - 1] if idle else used
                idle, used = (idle - 1, used) if idle else (0, used + 1)
                take(lanes, x, ready)
                _start(lanes, x, entry, box, left)
            ready += 1
        while idle:
            idle, used = idle - 1, used - 1
            move(lanes, used, lanes.idle[idle])
        if used == 0:
            return
        advance(lanes, used, bricks, index, box)
        for x in range(used):
            done = lanes.wholes[lane.DID + x] != lane.GOES
            if done and _ends(lanes, x, entry, media, box, numbers, ids):
                lanes.idle[idle] = x
                idle += 1


@scalar
def nearest(lanes, transforms, grids, rays, left, mask, numbers, ids):
    """`tracer.traversal.kernel.surface` for a batch of rays."""
    count, entries, spans = numbers.shape[0], grids[2], rays[2]
    for i in range(count):
        lanes.ends[i] = spans[i, 1]
        numbers[i, :] = np.float32(0)
        ids[i, :] = np.int32(0)
        numbers[i, 0], ids[i, 1] = np.inf, -1
    for entry in range(entries.shape[0]):
        if entry % GROUP == 1:
            find_near(lanes, count, entry, transforms, rays)
        queued = queue(lanes, count, entry) if entries[entry, MASK] & mask else 0
        if queued:
            _nearest_in(lanes, queued, entry, transforms[entry], grids, rays, left, numbers, ids)


@inlined
def _begin(lanes, x, passed):
    """Start the ray that has taken lane ``x`` as `tracer.traversal.kernel.transmitted` does."""
    rows, wholes = lanes.numbers, lanes.wholes
    rows[lane.RED + x], rows[lane.GREEN + x], rows[lane.BLUE + x] = triple(passed, wholes[lane.RAY + x], 0)
    rows[lane.BEGAN + x] = rows[lane.T + x]
    wholes[lane.AXIS + x] = -1 if wholes[lane.FIRST + x] > 0 else wholes[lane.AXIS + x]


@scalar
def _change(lanes, x, media, box, leaves, value):
    """Light at the end of the medium that a lane's ray was in: dimmed, and less what the next face reflects."""
    rows, wholes = lanes.numbers, lanes.wholes
    t, t_end, axis = rows[lane.T + x], rows[lane.T_END + x], wholes[lane.AXIS + x]
    medium, within = wholes[lane.MEDIUM + x], wholes[lane.WITHIN + x] > 0
    light = rows[lane.RED + x], rows[lane.GREEN + x], rows[lane.BLUE + x]
    if medium > 0:
        light = dimmed(light, media[medium + box[MATERIAL]], min(t, t_end) - rows[lane.BEGAN + x])
    if (within or value > 0) and axis >= 0 and not (leaves and t >= t_end):
        light = scaled(light, enters(ray_of(lanes, x)[1], axis))
    rows[lane.RED + x], rows[lane.GREEN + x], rows[lane.BLUE + x] = light
    rows[lane.BEGAN + x], wholes[lane.MEDIUM + x], wholes[lane.WITHIN + x] = t, value, value > 0 and axis < 0


@inlined
def _stops(lanes, x, media, box, passed):
    """Whether a lane's ray goes no further in a grid; writes the light that it then has."""
    wholes = lanes.wholes
    leaves, value, i = wholes[lane.DID + x] == lane.LEAVES, wholes[lane.VALUE + x], wholes[lane.RAY + x]
    if not leaves and _opaque(media, box, value):
        passed[i, 0], passed[i, 1], passed[i, 2] = 0.0, 0.0, 0.0
        lanes.ends[i] = -1.0  # it enters no other grid
        return True
    if not (leaves and wholes[lane.MEDIUM + x] == 0):
        _change(lanes, x, media, box, leaves, np.int32(0) if leaves else value)
    if leaves:
        rows = lanes.numbers
        passed[i, 0], passed[i, 1], passed[i, 2] = rows[lane.RED + x], rows[lane.GREEN + x], rows[lane.BLUE + x]
    return leaves


@scalar
def _transmitted_in(lanes, queued, box, transform, grids, rays, passed):
    """Light after one entry."""
    bricks, index, _, media = grids
    used, idle, begun, ready, count = 0, 0, 0, 0, 0
    while True:
        while (idle or used < LANES) and (ready < count or begun < queued):
            if ready == count:
                count, ready = prepare(lanes, begun, queued, transform, box, rays), 0
                begun += count
            if lanes.next_wholes[lane.DID + ready] == lane.GOES:
                x = lanes.idle[idle - 1] if idle else used
                idle, used = (idle - 1, used) if idle else (0, used + 1)
                take(lanes, x, ready)
                _begin(lanes, x, passed)
            ready += 1
        while idle:
            idle, used = idle - 1, used - 1
            move(lanes, used, lanes.idle[idle])
        if used == 0:
            return
        advance(lanes, used, bricks, index, box)
        for x in range(used):
            if lanes.wholes[lane.DID + x] != lane.GOES and _stops(lanes, x, media, box, passed):
                lanes.idle[idle] = x
                idle += 1


@scalar
def transmitted(lanes, transforms, grids, rays, mask, passed):
    """`tracer.traversal.kernel.transmit` for a batch of rays."""
    count, entries, spans = passed.shape[0], grids[2], rays[2]
    for i in range(count):
        lanes.ends[i] = spans[i, 1]
        passed[i, :] = np.float32(1)
    for entry in range(entries.shape[0]):
        if entry % GROUP == 1:
            find_near(lanes, count, entry, transforms, rays)
        queued = queue(lanes, count, entry) if entries[entry, MASK] & mask else 0
        if queued:
            _transmitted_in(lanes, queued, entries[entry], transforms[entry], grids, rays, passed)
