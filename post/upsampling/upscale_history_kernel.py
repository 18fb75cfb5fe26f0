"""The compiled form of temporal upscaling: where pixels of the large picture were, and what its history holds there.

A row of pixels at a time, whose loops become vector instructions but for the gathers. Names and steps are those of the
torch reference in `post.upsampling.upscale_reference`, the definition. Of the tables of columns and rows see
`post.upsampling.upscale_op.axis_table`.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import scalar
from post.upsampling import constants
from post.upsampling.remap_kernel import (
    FOUR,
    SHARES,
    between_row,
    bounded,
    gather_row,
    nearer_row,
    remapped_row,
    taps_row,
)

ZERO, HALF, ONE, NEAREST = (np.float32(x) for x in (0, 0.5, 1, 1e-9))
BETWEEN = np.float32(2 * constants.LOST_BETWEEN)
PARTING, COVERED = np.float32(constants.PARTING), np.float32(1 - constants.COVERED)
IN_FRONT = np.float32(1 - constants.IN_FRONT)
LOST_MOVING, LOST_SHEARED = np.float32(constants.LOST_MOVING), np.float32(constants.LOST_SHEARED)
FASTEST = np.float32(constants.FASTEST)
STRETCH, TOLERANCE = np.float32(constants.STRETCH), np.float32(1 + constants.TOLERANCE)
EDGE_ON = np.float32(constants.EDGE_ON)
LEAVES, HID = np.float32(constants.LEAVES), np.float32(constants.HID)
INDEX, BOXES, LOCK, PLACE, AWAY, STEP = 0, 1, 4, 5, 6, 7
"""Rows of `axis_table`."""
DEPTH, HIT, FACING, OFFSET, OWN, OWN_Z, ALIKE, FEATURE, MIRRORED, REACTIVE = 0, 1, 2, 5, 6, 8, 9, 10, 11, 12
"""Channels of what the small picture tells of its surfaces."""
WEIGHT, OLD, DRIFT, WOBBLE, LOCKED, NOW_DEPTH, NOW_MOTION, SPARED, REACT, EVEN = 0, 1, 4, 5, 6, 10, 11, 13, 14, 17
"""Rows of what is kept of each pixel's history; `LOCKED` has four, as `accumulate.locked`, `REACT` three."""
KEPT = 18
AT, THEN, VALID, HIDDEN, SHARE, VALUES, READS = 9, 11, 12, 13, 14, 14 + SHARES, 14 + SHARES + FOUR
"""Rows of scratch after those of surfaces: where pixels were, their depth there, whether it was seen, what share of the
samples around hid it, and for reads."""
SCRATCH = READS + FOUR
EXPECTED, SHEAR, ELLIPSE = 0, 3, 4
"""Channels of what `samples_row` tells of samples."""


Small = namedtuple("Small", "surfaces depths toned seen lens across down orthographic height width y first end")
"""Flat pictures of samples, what leads to them, their height and width, and which pixels of the large picture to do."""
Past = namedtuple("Past", "old length planes height width")
"""A flat history."""


@scalar
def four_places(taps, small, centered):
    """The four samples that surround each pixel; ``centered`` is the side of the others where one is in its centre."""
    index, away = small.across[INDEX, small.first : small.end], small.across[AWAY, small.first : small.end]
    row, above, last = np.int64(small.down[INDEX, small.y]), small.down[AWAY, small.y], np.float32(small.width - 1)
    side = bounded(row + np.int64(-ONE if above > ZERO else (ONE if above < ZERO else centered)), small.height)
    here, there = np.int32(row * small.width), np.int32(side * small.width)
    one, two, three, four = taps[0], taps[1], taps[2], taps[3]
    for x in range(pixels(one.shape[0])):
        step = -ONE if away[x] > ZERO else (ONE if away[x] < ZERO else centered)
        column, beside = np.int32(index[x]), np.int32(min(max(index[x] + step, ZERO), last))
        one[x], two[x], three[x], four[x] = column + here, beside + here, column + there, beside + there


@scalar
def _surface_row(rows, taps, small):
    """The nearest surface among the four samples that surround each pixel."""
    four_places(taps, small, ZERO)
    one, two, three, four = taps[0], taps[1], taps[2], taps[3]
    for k in range(FOUR):
        gather_row(rows[VALUES + k], small.surfaces[DEPTH], taps[k])
    a, b, c, d = rows[VALUES], rows[VALUES + 1], rows[VALUES + 2], rows[VALUES + 3]
    for x in range(pixels(one.shape[0])):
        nearest, place, closer = a[x], one[x], b[x] < a[x] * IN_FRONT
        nearest, place = b[x] if closer else nearest, two[x] if closer else place
        closer = c[x] < nearest * IN_FRONT
        nearest, place = c[x] if closer else nearest, three[x] if closer else place
        one[x] = four[x] if d[x] < nearest * IN_FRONT else place
    for k in range(OWN_Z + 1):
        gather_row(rows[k], small.surfaces[k], one)


@scalar
def _depth_row(depth, rows, lens, orthographic, y, first):
    """Where the plane of each pixel's surface lies."""
    near, fx, fy, fz, offset = rows[DEPTH], rows[FACING], rows[FACING + 1], rows[FACING + 2], rows[OFFSET]
    ray_y = (np.float32(y) + HALF - lens[3]) / lens[1]
    for x in range(pixels(depth.shape[0])):
        ray_x = (np.float32(np.int32(first + x)) + HALF - lens[2]) / lens[0]
        tilted = fx[x] * ray_x + fy[x] * ray_y
        start, along = tilted if orthographic else ZERO, fz[x] if orthographic else tilted + fz[x]
        facing = abs(along) > EDGE_ON
        met = (offset[x] - start) / (along if facing else ONE)
        facing &= (met > near[x] / STRETCH) & (met < near[x] * STRETCH)
        depth[x] = met if facing else near[x]


@scalar
def _was_row(kept, rows, small):
    """Where each pixel was, px, and its depth now and then."""
    lens, orthographic, y, first = small.lens, small.orthographic, small.y, small.first
    _depth_row(kept[NOW_DEPTH], rows, lens, orthographic, y, first)
    depth, at_x, at_y, then, hit = kept[NOW_DEPTH], rows[AT], rows[AT + 1], rows[THEN], rows[HIT]
    own_x, own_y, own_z, ray_y = rows[OWN], rows[OWN + 1], rows[OWN_Z], (np.float32(y) + HALF - lens[3]) / lens[1]
    for x in range(pixels(depth.shape[0])):
        ray_x, z = (np.float32(np.int32(first + x)) + HALF - lens[2]) / lens[0], depth[x]
        px, py = ray_x if orthographic else ray_x * z, ray_y if orthographic else ray_y * z
        solid = hit[x] > ZERO
        share, still = ONE if solid else ZERO, orthographic and not solid
        bx = lens[4] * px + lens[5] * py + lens[6] * z + lens[13] * share
        by = lens[7] * px + lens[8] * py + lens[9] * z + lens[14] * share
        bz = lens[10] * px + lens[11] * py + lens[12] * z + lens[15] * share
        bx, by, bz = px if still else bx, py if still else by, z if still else bz
        behind = ONE if orthographic else max(bz, NEAREST)
        at_x[x] = bx / behind * lens[16] + lens[18] + own_x[x] * lens[22]
        at_y[x] = by / behind * lens[17] + lens[19] + own_y[x] * lens[23]
        then[x] = (bz if solid else z) + own_z[x]
    move_x, move_y = kept[NOW_MOTION], kept[NOW_MOTION + 1]
    for x in range(pixels(depth.shape[0])):
        move_x[x] = at_x[x] - (np.float32(np.int32(first + x)) + HALF)
        move_y[x] = at_y[x] - (np.float32(y) + HALF)


@scalar
def _seen_row(rows, taps, small, past):
    """Whether the frame before showed each pixel; where it did not, the history's corner is read."""
    at_x, at_y, then, valid, farthest, place = rows[AT], rows[AT + 1], rows[THEN], rows[VALID], rows[VALUES], taps[0]
    lens, right, bottom = small.lens, np.float32(small.width - 1), np.float32(small.height - 1)
    width, height = np.float32(past.width), np.float32(past.height)
    for x in range(pixels(valid.shape[0])):
        inside = (at_x[x] >= ZERO) & (at_x[x] < width) & (at_y[x] >= ZERO) & (at_y[x] < height)
        at_x[x], at_y[x], valid[x] = at_x[x] if inside else ZERO, at_y[x] if inside else ZERO, ONE if inside else ZERO
        column = min(max(np.floor(at_x[x] / lens[22] - lens[20]), ZERO), right)
        row = min(max(np.floor(at_y[x] / lens[23] - lens[21]), ZERO), bottom)
        place[x] = np.int32(row) * np.int32(small.width) + np.int32(column)
    gather_row(farthest, small.depths[0], place)
    for x in range(pixels(valid.shape[0])):
        valid[x] = valid[x] if then[x] <= farthest[x] * TOLERANCE else ZERO
    place_x, place_y, shares = rows[READS], rows[READS + 1], rows[SHARE : SHARE + SHARES]
    for x in range(pixels(valid.shape[0])):
        place_x[x], place_y[x] = at_x[x] / lens[22] - lens[20], at_y[x] / lens[23] - lens[21]
    taps_row(taps, shares, place_x, place_y, small.height, small.width)
    values = rows[VALUES : VALUES + FOUR]
    nearer_row(rows[HIDDEN], small.depths[1], then, TOLERANCE, taps, shares, values)


@scalar
def _weight_row(kept, rows, taps, small, past):
    """What is left of the weight of each pixel's history."""
    index, row = small.across[INDEX, small.first : small.end], np.int32(small.down[INDEX, small.y])
    place, apart = taps[0], rows[VALUES]
    for x in range(pixels(place.shape[0])):
        place[x] = row * np.int32(small.width) + np.int32(index[x])
    gather_row(apart, small.seen[SHEAR], place)
    weight, move_x, move_y, valid = kept[WEIGHT], kept[NOW_MOTION], kept[NOW_MOTION + 1], rows[VALID]
    u, v, drift, wobble, hidden = rows[SHARE], rows[SHARE + 1], kept[DRIFT], kept[WOBBLE], rows[HIDDEN]
    at_x, at_y, width, height = rows[AT], rows[AT + 1], np.float32(past.width), np.float32(past.height)
    for x in range(pixels(place.shape[0])):
        speed = min(math.sqrt(move_x[x] * move_x[x] + move_y[x] * move_y[x]), FASTEST)
        lost = (ONE + LOST_SHEARED * apart[x]) * (ONE + LOST_MOVING * speed)
        left = ONE - BETWEEN * (u[x] * (ONE - u[x]) + v[x] * (ONE - v[x]))
        within = min(min(at_x[x], width - at_x[x]), min(at_y[x], height - at_y[x]))
        left *= min(max(within + within, ZERO), ONE)
        left *= ONE - min(max(apart[x] - LEAVES, ZERO), ONE) * min(HID * hidden[x], ONE)
        weight[x] = weight[x] * left / lost if valid[x] > ZERO else ZERO
        drift[x], wobble[x] = drift[x] * valid[x], wobble[x] * valid[x]


@scalar
def _between_samples(rows, taps, small):
    """Taps and shares of `between_row` for pixels between the samples of the small picture."""
    place, left, right, u, v = (
        small.across[PLACE, small.first : small.end],
        taps[1],
        taps[2],
        rows[SHARE],
        rows[SHARE + 1],
    )
    last, row = np.int32(small.width - 1), np.int64(small.down[PLACE, small.y])
    taps[5, :], taps[6, :] = np.int32(row * small.width), np.int32(min(row + 1, small.height - 1) * small.width)
    v[:] = small.down[PLACE, small.y] - np.float32(row)
    for x in range(pixels(left.shape[0])):
        i = np.int32(place[x])
        left[x], right[x], u[x] = i, min(np.int32(i + 1), last), place[x] - np.float32(i)


@scalar
def _react_rows(kept, rows, taps, small):
    """How much less history each channel may hold; taps are of `_between_samples`."""
    channels, shares, values = small.surfaces.shape[0] - REACTIVE, rows[SHARE : SHARE + SHARES], rows[VALUES:]
    for k in range(channels):
        between_row(kept[REACT + k], small.surfaces[REACTIVE + k], taps, shares, values)
    for k in range(channels, 3):
        red, other = kept[REACT], kept[REACT + k]
        for x in range(pixels(other.shape[0])):
            other[x] = red[x] if k > 0 else ZERO


@scalar
def _lock_row(kept, rows, alike, lock):
    """What is left of locks, and how far they spare pixels of clipping; the weight that a change of light leaves."""
    strength, was, moved_x, moved_y = kept[LOCKED], kept[LOCKED + 1], kept[LOCKED + 2], kept[LOCKED + 3]
    move_x, move_y, depth = kept[NOW_MOTION], kept[NOW_MOTION + 1], kept[NOW_DEPTH]
    red, green, blue, spared, weight = kept[REACT], kept[REACT + 1], kept[REACT + 2], kept[SPARED], kept[WEIGHT]
    even, then, valid = kept[EVEN], rows[THEN], rows[VALID]
    for x in range(pixels(strength.shape[0])):
        weight[x] *= alike[x] * alike[x]
        off_x, off_y = moved_x[x] - move_x[x], moved_y[x] - move_y[x]
        alive = min(max(ONE - math.sqrt(off_x * off_x + off_y * off_y) / PARTING, ZERO), ONE) * alike[x] * valid[x]
        alive = strength[x] * alive if then[x] > was[x] * COVERED else ZERO
        strength[x], was[x] = alive, was[x] * valid[x] + depth[x] - then[x]
        moved_x[x], moved_y[x] = moved_x[x] * valid[x], moved_y[x] * valid[x]
        spared[x] = lock * alive * (ONE - max(max(red[x], green[x]), blue[x])) * (ONE - even[x])


@scalar
def fetch_row(kept, small, past, lock, scratch):
    """History where each pixel was, and what is left of its locks; zero where the pixel was not seen.

    ``scratch`` are taps and rows, for as many pixels as ``kept``. See `Small` and `Past`.
    """
    taps, rows = scratch
    shares, values, reads = rows[SHARE : SHARE + SHARES], rows[VALUES : VALUES + FOUR], rows[READS : READS + FOUR]
    _surface_row(rows, taps, small)
    _was_row(kept, rows, small)
    _seen_row(rows, taps, small, past)
    taps_row(taps, shares, rows[AT], rows[AT + 1], past.height, past.width)
    between_row(kept[WEIGHT], past.length, taps, shares, values)
    for k in range(2):
        between_row(kept[DRIFT + k], past.planes[k], taps, shares, values)
    for k in range(4):
        between_row(kept[LOCKED + k], past.planes[2 + k], taps, shares, values)
    for k in range(3):
        remapped_row(kept[OLD + k], past.old[k], taps, shares, values, reads)
    _weight_row(kept, rows, taps, small, past)
    _between_samples(rows, taps, small)
    _react_rows(kept, rows, taps, small)
    between_row(kept[EVEN], small.surfaces[MIRRORED], taps, shares, values)
    between_row(reads[0], small.surfaces[ALIKE], taps, shares, values)
    _lock_row(kept, rows, reads[0], lock)
