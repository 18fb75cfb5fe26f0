"""Lengths of rays through what is solid, for many rays at a time, in lanes: see `tracer.traversal.batch_kernel`."""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.scene.grids import MATERIAL
from tracer.traversal import lane_kernel as lane
from tracer.traversal.entry_kernel import prepare, take
from tracer.traversal.grid_kernel import counted
from tracer.traversal.lane_kernel import LANES, advance, move, put_cell


@inlined
def _follow(lanes, x, box, rays, starts):
    """Start the ray that has taken lane ``x`` as `tracer.traversal.kernel.run_length` does."""
    i, rows, begin = lanes.wholes[lane.RAY + x], lanes.numbers, np.float64(rays[2][lanes.wholes[lane.RAY + x], 0])
    put_cell(lanes, x, counted((starts[i, 2], starts[i, 3], starts[i, 4]), box))
    rows[lane.T + x], rows[lane.BEGAN + x], rows[lane.RED + x] = begin, begin, 0.0
    lanes.wholes[lane.WITHIN + x] = 1


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
def _queue(lanes, starts, entry):
    """Queue the rays that begin in an entry; how many they are."""
    queued = 0
    for i in range(starts.shape[0]):
        if starts[i, 1] == entry:
            lanes.queue[queued] = i
            queued += 1
    return queued


@scalar
def run_lengths(lanes, transforms, grids, rays, starts, lengths):
    """`tracer.traversal.kernel.runs` for a batch of rays; ``lengths`` is 0 before."""
    bricks, index, entries, _ = grids
    for i in range(lengths.shape[0]):
        lanes.ends[i] = rays[2][i, 1]
    for entry in range(entries.shape[0]):
        box, transform, used, idle, begun, ready, count = entries[entry], transforms[entry], 0, 0, 0, 0, 0
        queued = _queue(lanes, starts, entry)
        while True:
            while (idle or used < LANES) and (ready < count or begun < queued):
                if ready == count:
                    count, ready = prepare(lanes, begun, queued, transform, box, rays), 0
                    begun += count
                if lanes.next_wholes[lane.DID + ready] == lane.GOES:
                    x = lanes.idle[idle - 1] if idle else used
                    idle, used = (idle - 1, used) if idle else (0, used + 1)
                    take(lanes, x, ready)
                    _follow(lanes, x, box, rays, starts)
                ready += 1
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
