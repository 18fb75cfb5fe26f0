"""The compiled taps of a slice, for all lanes of receivers at once: see `post.sweep.lane_kernel`.

Names and steps are those of the torch reference in `post.sweep.arcs` and `post.sweep.occluders`, which is the
definition.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.sweep import lane_kernel as lane
from post.sweep.lane_kernel import LANES, keep_slice, receiver_of
from post.sweep.slice_kernel import (
    FIRST,
    HALF,
    ONE,
    TINY,
    ZERO,
    arc_measure,
    cut_slice,
    part_of_reach,
    pixels_to,
    right_share,
)

APART = np.float32(2)  # more than any share: stands for the share at the tap before where that is another body


@scalar
def start_slice(lanes, around, beyond):
    """Cut the slice of every lane; see `arcs.sides` for what both of its sides share."""
    rows, parts = lanes.rows, lanes.parts
    for x in range(LANES):
        cut: Any = cut_slice(receiver_of(rows, around.aspect, x), rows[lane.COS + x], rows[lane.SIN + x])
        keep_slice(rows, cut, x)
        length = math.sqrt(cut.step_x * cut.step_x + cut.step_y * cut.step_y)
        right = right_share(cut)
        rows[lane.DX + x], rows[lane.DY + x] = cut.step_x / length, cut.step_y / length
        rows[lane.LENGTH + x], rows[lane.HALVED + x] = length, HALF / cut.measure
        rows[lane.RIGHT + x], rows[lane.LEFT + x] = right, ONE - right
    steps = parts.shape[0] // LANES
    for i in range(steps):
        part = parts[i * LANES : (i + 1) * LANES]
        for x in range(LANES):
            part[x] = part_of_reach(i, rows[lane.JITTER + x], steps, beyond)


@inlined
def _place(lanes, around, side, px, x):
    """Store the whole pixel ``px`` pixels from the receiver, and the ray through it; see `arcs.look`."""
    rows, rays = lanes.rows, around.rays
    column = np.rint(rows[lane.COLUMN + x] + side * rows[lane.DX + x] * px)
    row = np.rint(rows[lane.ROW + x] + side * rows[lane.DY + x] * px)
    left_out = np.int32(around.left_out)
    i = min(max(np.int32(column) - left_out, np.int32(0)), np.int32(around.wide - 1))
    j = min(max(np.int32(row) - left_out, np.int32(0)), np.int32(around.tall - 1))
    lanes.spot[x] = j * around.wide + i
    rows[lane.TAP_X + x], rows[lane.TAP_Y + x] = rays[0] + rays[2] * column, rays[1] + rays[3] * row


@scalar
def start_side(lanes, around, side, edge):
    """Prepare one side, 1 for the right and -1 for the left, that ends ``edge`` pixels before the padded picture."""
    rows, limited = lanes.rows, around.limited
    widest = around.radii[around.radii.shape[0] - 1]
    for x in range(LANES):
        at, dx, dy = receiver_of(rows, around.aspect, x), side * rows[lane.DX + x], side * rows[lane.DY + x]
        reach = pixels_to(edge, around, at, dx, dy)
        rows[lane.REACH + x] = min(widest * rows[lane.LENGTH + x], reach) if limited else reach
        rightward, leftward = rows[lane.RIGHT + x], rows[lane.LEFT + x]
        rows[lane.WHOLE + x] = rightward if side > ZERO else leftward
        rows[lane.SAME + x] = ZERO
        # The tap before the first is the receiver itself, see `occluders.start`.
        rows[lane.BEFORE + x] = rows[lane.WHOLE + x]
        rows[lane.BEFORE_RISE + x], rows[lane.BEFORE_RUN + x], rows[lane.BEFORE_DISTANCE + x] = ZERO, ZERO, ZERO
        rows[lane.BEFORE_Z + x] = at.z
        rows[lane.BEFORE_BACK_Z + x] = at.z + rows[lane.SOLID + x]


@scalar
def place_taps(lanes, around, side, i):
    """Find where tap ``i`` of every lane lies."""
    part = lanes.parts[i * LANES : (i + 1) * LANES]
    for x in range(LANES):
        _place(lanes, around, side, FIRST + lanes.rows[lane.REACH + x] * part[x], x)


@scalar
def place_ends(lanes, around, side):
    """Find where every slice leaves the picture on one side, see `open_sky.leaves_hit`."""
    for x in range(LANES):
        at, dx, dy = receiver_of(lanes.rows, around.aspect, x), lanes.rows[lane.DX + x], lanes.rows[lane.DY + x]
        _place(lanes, around, side, pixels_to(around.margin + 1, around, at, side * dx, side * dy), x)


@scalar
def read_taps(lanes, pixels):
    """Read the pixels of all taps: depth and solid, and where light is gathered three pairs of numbers more."""
    index, pairs = lanes.spot, lanes.pairs
    if pixels.shape[1] == 1:
        for x in range(LANES):
            pairs[x] = pixels[index[x], 0]
    else:
        for x in range(LANES):
            k = index[x]
            one, two, three, four = pixels[k, 0], pixels[k, 1], pixels[k, 2], pixels[k, 3]
            pairs[x], pairs[LANES + x], pairs[2 * LANES + x], pairs[3 * LANES + x] = one, two, three, four


@scalar
def measure_taps(lanes, around, side):
    """See `occluders.blocked`: the shares of the side at which every tap begins and ends.

    ``LEAST`` is the share at the tap before, if both are one body.
    """
    rows, pixel, parallel = lanes.rows, lanes.pixel, around.parallel
    for x in range(LANES):
        z, solid = pixel[2 * x], pixel[2 * x + 1]
        tap_x, tap_y, whole = rows[lane.TAP_X + x], rows[lane.TAP_Y + x], rows[lane.WHOLE + x]
        cos_n, sin_n, half = rows[lane.COS_N + x], side * rows[lane.SIN_N + x], rows[lane.HALVED + x]
        rise = tap_x * rows[lane.NX + x] + tap_y * rows[lane.NY + x]
        run = tap_x * rows[lane.TX + x] + tap_y * rows[lane.TY + x]
        rise_by_z = rows[lane.NZ + x] + (ZERO if parallel else rise)
        run_by_z = rows[lane.TZ + x] + (ZERO if parallel else run)
        rise = (rise if parallel else ZERO) + z * rise_by_z - rows[lane.LEVEL + x]
        run = (run if parallel else ZERO) + z * run_by_z - rows[lane.PLACE + x]
        back_rise, back_run = rise + solid * rise_by_z, side * (run + solid * run_by_z)
        run, back_z = side * run, z + solid
        overlap = min(back_z, rows[lane.BEFORE_BACK_Z + x]) - max(z, rows[lane.BEFORE_Z + x])
        joined = (overlap > ZERO) | (rows[lane.SAME + x] > ZERO)
        back = arc_measure(back_rise, back_run, cos_n, sin_n, half, whole)
        before = rows[lane.BEFORE + x]
        rows[lane.FRONT + x] = arc_measure(rise, run, cos_n, sin_n, half, whole)
        rows[lane.HIGH + x] = max(back, before) if joined else back
        rows[lane.LEAST + x] = before if joined else APART
        rows[lane.DISTANCE + x] = math.sqrt(rise * rise + run * run + TINY)
        rows[lane.RISE + x], rows[lane.RUN + x] = rise, run
        rows[lane.Z + x], rows[lane.BACK_Z + x] = z, back_z


@scalar
def measure_crossings(lanes, radii, side):
    """See `occluders._front_at_the_radius`."""
    rows, last = lanes.rows, radii.shape[0] - 1
    for x in range(LANES):
        rows[lane.CROSSED + x] = radii[last]
    for s in range(last - 1, -1, -1):
        radius = radii[s]
        for x in range(LANES):
            farther = rows[lane.CROSSED + x]
            rows[lane.CROSSED + x] = radius if radius > rows[lane.BEFORE_DISTANCE + x] else farther
    for x in range(LANES):
        distance, before = rows[lane.DISTANCE + x], rows[lane.BEFORE_DISTANCE + x]
        left = (distance - rows[lane.CROSSED + x]) / max(abs(distance - before), np.float32(1e-9))
        rise, run = rows[lane.RISE + x], rows[lane.RUN + x]
        rise = rise + (rows[lane.BEFORE_RISE + x] - rise) * left
        run = run + (rows[lane.BEFORE_RUN + x] - run) * left
        cos_n, sin_n, half = rows[lane.COS_N + x], side * rows[lane.SIN_N + x], rows[lane.HALVED + x]
        rows[lane.CROSSED + x] = arc_measure(rise, run, cos_n, sin_n, half, rows[lane.WHOLE + x])


@scalar
def next_taps(rows):
    """Every tap becomes the one before."""
    for x in range(LANES):
        rows[lane.BEFORE + x] = rows[lane.FRONT + x]
        rows[lane.BEFORE_RISE + x], rows[lane.BEFORE_RUN + x] = rows[lane.RISE + x], rows[lane.RUN + x]
        rows[lane.BEFORE_DISTANCE + x] = rows[lane.DISTANCE + x]
        rows[lane.BEFORE_Z + x], rows[lane.BEFORE_BACK_Z + x] = rows[lane.Z + x], rows[lane.BACK_Z + x]
