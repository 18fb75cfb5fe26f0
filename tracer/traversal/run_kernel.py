"""Lengths of rays through what is solid, for many rays at a time, in lanes: see `tracer.traversal.batch_kernel`."""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.scene.grids import MATERIAL
from tracer.traversal import lane_kernel as lane
from tracer.traversal.grid_kernel import counted, triple
from tracer.traversal.lane_kernel import LANES, advance, enter, move, put_cell


@inlined
def _follow(lanes, x, i, entry, transform, box, rays, starts):
    """Put ray ``i`` into lane ``x`` as `tracer.traversal.kernel.run_length` starts it; whether it enters the grid."""
    origins, directions, spans = rays
    origin, direction = triple(origins, i, 0), triple(directions, i, 0)
    t_begin, t_end = np.float64(spans[i, 0]), np.float64(spans[i, 1])
    if starts[i, 1] != entry or not enter(lanes, x, i, transform, box, origin, direction, t_begin, t_end)[0]:
        return False
    put_cell(lanes, x, counted((starts[i, 2], starts[i, 3], starts[i, 4]), box))
    rows = lanes.numbers
    rows[lane.T + x], rows[lane.BEGAN + x], rows[lane.RED + x] = t_begin, t_begin, 0.0
    lanes.wholes[lane.WITHIN + x] = 1
    return True


@inlined
def _comes_out(lanes, x, box, starts, lengths):
    """Whether a lane's ray is through what is solid; writes its lengths, see `tracer.traversal.kernel.run_length`."""
    rows, wholes = lanes.numbers, lanes.wholes
    leaves, value = wholes[lane.DID + x] == lane.LEAVES, wholes[lane.VALUE + x]
    length = max(min(rows[lane.T + x], rows[lane.T_END + x]) - rows[lane.BEGAN + x], 0.0)
    i = wholes[lane.RAY + x]
    if leaves or value == 0:
        lengths[i, 0], lengths[i, 1] = length, length if wholes[lane.WITHIN + x] > 0 else rows[lane.RED + x]
        return True
    if wholes[lane.WITHIN + x] > 0 and value + box[MATERIAL] != starts[i, 0]:
        wholes[lane.WITHIN + x], rows[lane.RED + x] = 0, length
    wholes[lane.MEDIUM + x] = value
    return False


@scalar
def run_lengths(lanes, transforms, grids, rays, starts, lengths):
    """`tracer.traversal.kernel.runs` for a batch of rays; ``lengths`` is 0 before."""
    bricks, index, entries, _ = grids
    count = lengths.shape[0]
    for entry in range(entries.shape[0]):
        box, transform, used, idle, i = entries[entry], transforms[entry], 0, 0, 0
        while True:
            while i < count and (idle or used < LANES):
                x = lanes.idle[idle - 1] if idle else used
                if _follow(lanes, x, i, entry, transform, box, rays, starts):
                    idle, used = (idle - 1, used) if idle else (0, used + 1)
                i += 1
            while idle:
                idle, used = idle - 1, used - 1
                move(lanes, used, lanes.idle[idle])
            if used == 0:
                break
            advance(lanes, used, bricks, index, box)
            for x in range(used):
                if lanes.wholes[lane.DID + x] != lane.GOES and _comes_out(lanes, x, box, starts, lengths):
                    lanes.idle[idle] = x
                    idle += 1
