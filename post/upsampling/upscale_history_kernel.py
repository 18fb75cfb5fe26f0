"""The compiled form of temporal upscaling: where pixels of the large picture were, and what its history holds there.

Names and steps are those of the torch reference in `post.upsampling.upscale_reference`, the definition. Of the tables
of columns and rows see `post.upsampling.upscale_op.axis_table`.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.upsampling import constants

ZERO, HALF, ONE, TWO, FOUR, NEAREST = (np.float32(x) for x in (0, 0.5, 1, 2, 4, 1e-9))
STEPPED = np.float32(constants.STEPPED)
PARTING, COVERED = np.float32(constants.PARTING), np.float32(1 - constants.COVERED)
LOST_BETWEEN, IN_FRONT = np.float32(constants.LOST_BETWEEN), np.float32(1 - constants.IN_FRONT)
LOST_MOVING, LOST_SHEARED, FASTEST = (
    np.float32(constants.LOST_MOVING),
    np.float32(constants.LOST_SHEARED),
    np.float32(constants.FASTEST),
)
STRETCH, TOLERANCE = np.float32(constants.STRETCH), np.float32(1 + constants.TOLERANCE)
EDGE_ON = np.float32(constants.EDGE_ON)
INDEX, BOXES, LOCK, PLACE, AWAY, STEP = 0, 1, 4, 5, 6, 7
"""Rows of `axis_table`."""
DEPTH, HIT, FACING, OFFSET, OWN, OWN_Z, ALIKE, FEATURE, REACTIVE = 0, 1, 2, 5, 6, 8, 9, 10, 11
"""Channels of what the small picture tells of its surfaces."""
WEIGHT, OLD, DRIFT, WOBBLE, LOCKED, NOW_DEPTH, NOW_MOTION, SPARED, REACT = 0, 1, 4, 5, 6, 10, 11, 13, 14
"""Rows of what is kept of each pixel's history; `LOCKED` has four, as `accumulate.locked`, `REACT` three."""
KEPT = 17
EXPECTED, SHEAR, ELLIPSE = 0, 3, 4
"""Channels of what `samples_row` tells of samples."""


@inlined
def bounded(i, count):
    return min(max(i, 0), count - 1)


@inlined
def _surface_in_front(small, across, down, x, y):
    """Column and row of the nearest surface among the four samples that surround a pixel."""
    _, height, width = small.shape
    column, row = np.int64(across[INDEX, x]), np.int64(down[INDEX, y])
    side_x = column - (1 if across[AWAY, x] > ZERO else (-1 if across[AWAY, x] < ZERO else 0))
    side_y = row - (1 if down[AWAY, y] > ZERO else (-1 if down[AWAY, y] < ZERO else 0))
    side_x, side_y = bounded(side_x, width), bounded(side_y, height)
    best_x, best_y, nearest = column, row, small[DEPTH, row, column]
    for k in range(1, 4):
        i, j = side_x if k != 2 else column, side_y if k != 1 else row
        if small[DEPTH, j, i] < nearest * IN_FRONT:
            best_x, best_y, nearest = i, j, small[DEPTH, j, i]
    return best_x, best_y


@inlined
def _was_at(small, lens, across, down, orthographic, x, y, first):
    """Where a pixel was, px, and its depth now and then."""
    column, row = _surface_in_front(small, across, down, x, y)
    near, at_x, at_y = small[DEPTH, row, column], np.float32(first + x) + HALF, np.float32(y) + HALF
    ray_x, ray_y = (at_x - lens[2]) / lens[0], (at_y - lens[3]) / lens[1]
    fx, fy, fz = small[FACING, row, column], small[FACING + 1, row, column], small[FACING + 2, row, column]
    start = fx * ray_x + fy * ray_y if orthographic else ZERO
    along = fz if orthographic else fx * ray_x + fy * ray_y + fz
    depth = near
    if abs(along) > EDGE_ON:
        met = (small[OFFSET, row, column] - start) / along
        if met > near / STRETCH and met < near * STRETCH:
            depth = met
    px, py = (ray_x, ray_y) if orthographic else (ray_x * depth, ray_y * depth)
    hit = small[HIT, row, column] > ZERO
    if hit or not orthographic:
        share = ONE if hit else ZERO
        bx = lens[4] * px + lens[5] * py + lens[6] * depth + lens[13] * share
        by = lens[7] * px + lens[8] * py + lens[9] * depth + lens[14] * share
        bz = lens[10] * px + lens[11] * py + lens[12] * depth + lens[15] * share
    else:
        bx, by, bz = px, py, depth
    behind = ONE if orthographic else max(bz, NEAREST)
    scale_x, scale_y = lens[22], lens[23]
    there_x = bx / behind * lens[16] + lens[18] + small[OWN, row, column] * scale_x
    there_y = by / behind * lens[17] + lens[19] + small[OWN + 1, row, column] * scale_y
    then = depth + (bz - depth if hit else ZERO) + small[OWN_Z, row, column]
    return there_x, there_y, depth, then


@inlined
def _sloped(near, up, here, f):
    """``near`` with what its slope adds on the way to its neighbour; it rises by ``up``, then by ``here``."""
    steepest = TWO * min(abs(up), abs(here))
    return near + min(max((up + here) * HALF, -steepest), steepest) * f * HALF


@inlined
def _moved(a, b, c, d, f):
    """See `post.upsampling.remap`; what is chosen is chosen without a jump, which no processor would foresee."""
    g, up, here, down = ONE - f, b - a, c - b, d - c
    rising, next_rising = up * here > ZERO, here * down > ZERO
    step, next_step = here / (up + here if rising else ONE), down / (here + down if next_rising else ONE)
    sloped, next_sloped = g * _sloped(b, up, here, f), f * _sloped(c, here, down, -g)
    stepped = max(step - f, ZERO) * a + (ONE - max(step, f)) * c
    next_stepped = min(next_step, f) * b + max(f - next_step, ZERO) * d
    first = sloped + (stepped - sloped) * STEPPED if rising else g * b
    return first + (next_sloped + (next_stepped - next_sloped) * STEPPED if next_rising else f * c)


@inlined
def remapped(old, x, y):
    """Colour of a history over a square between its pixels; see `post.upsampling.remap`."""
    _, height, width = old.shape
    left, top = np.float32(math.floor(x - HALF)), np.float32(math.floor(y - HALF))
    u, v, x0, y0 = x - HALF - left, y - HALF - top, np.int64(left), np.int64(top)
    xa, xb = bounded(x0 - 1, width), bounded(x0, width)
    xc, xd = bounded(x0 + 1, width), bounded(x0 + 2, width)
    ye, yf = bounded(y0 - 1, height), bounded(y0, height)
    yg, yh = bounded(y0 + 1, height), bounded(y0 + 2, height)
    red, green, blue = ZERO, ZERO, ZERO
    for n in range(3):
        r0, r1, r2, r3 = old[n, ye], old[n, yf], old[n, yg], old[n, yh]
        read = _moved(
            _moved(r0[xa], r0[xb], r0[xc], r0[xd], u),
            _moved(r1[xa], r1[xb], r1[xc], r1[xd], u),
            _moved(r2[xa], r2[xb], r2[xc], r2[xd], u),
            _moved(r3[xa], r3[xb], r3[xc], r3[xd], u),
            v,
        )
        red, green, blue = green, blue, read
    return red, green, blue


@inlined
def _between(plane, i, k, u, j, m, v):
    """A plane between columns ``i`` and ``k``, by ``u`` of the way, and rows ``j`` and ``m``, by ``v``."""
    return (ONE - v) * ((ONE - u) * plane[j, i] + u * plane[j, k]) + v * ((ONE - u) * plane[m, i] + u * plane[m, k])


@scalar
def fetch_row(kept, small, farthest, lens, across, down, orthographic, old, seen, length, planes, lock, y, first):
    """History where each pixel was, and what is left of its locks; zero where the pixel was not seen.

    ``kept`` and ``across`` are of the columns from ``first`` on; ``seen`` is of `samples_row`.
    """
    (_, height, width), (low_height, low_width) = old.shape, farthest.shape
    for x in range(kept.shape[1]):
        there_x, there_y, depth, then = _was_at(small, lens, across, down, orthographic, x, y, first)
        move_x, move_y = there_x - (np.float32(first + x) + HALF), there_y - (np.float32(y) + HALF)
        kept[NOW_DEPTH, x], kept[NOW_MOTION, x], kept[NOW_MOTION + 1, x] = depth, move_x, move_y
        valid = there_x >= ZERO and there_x < np.float32(width) and there_y >= ZERO and there_y < np.float32(height)
        if valid:
            i = bounded(np.int64(math.floor(there_x / lens[22] - lens[20])), low_width)
            j = bounded(np.int64(math.floor(there_y / lens[23] - lens[21])), low_height)
            valid = then <= farthest[j, i] * TOLERANCE
        if not valid:
            for k in range(NOW_DEPTH):
                kept[k, x] = ZERO
            kept[SPARED, x], kept[LOCKED + 1, x] = ZERO, depth - then
            continue
        left, top = np.float32(math.floor(there_x - HALF)), np.float32(math.floor(there_y - HALF))
        u, v = there_x - HALF - left, there_y - HALF - top
        blur = HALF * (FOUR * u * (ONE - u) + FOUR * v * (ONE - v))
        x0, y0 = np.int64(left), np.int64(top)
        xb, xc, yf, yg = bounded(x0, width), bounded(x0 + 1, width), bounded(y0, height), bounded(y0 + 1, height)
        speed = min(math.sqrt(move_x * move_x + move_y * move_y), FASTEST)
        apart = seen[SHEAR, np.int64(down[INDEX, y]), np.int64(across[INDEX, x])]
        lost = (ONE + LOST_SHEARED * apart) * (ONE + LOST_MOVING * speed)
        kept[WEIGHT, x] = _between(length, xb, xc, u, yf, yg, v) * (ONE - LOST_BETWEEN * blur) / lost
        kept[DRIFT, x] = _between(planes[0], xb, xc, u, yf, yg, v)
        kept[WOBBLE, x] = _between(planes[1], xb, xc, u, yf, yg, v)
        strength, was = _between(planes[2], xb, xc, u, yf, yg, v), _between(planes[3], xb, xc, u, yf, yg, v)
        moved_x = _between(planes[4], xb, xc, u, yf, yg, v)
        moved_y = _between(planes[5], xb, xc, u, yf, yg, v)
        apart = math.sqrt((moved_x - move_x) ** 2 + (moved_y - move_y) ** 2) / PARTING
        strength *= min(max(ONE - apart, ZERO), ONE)
        i, j = np.int64(across[PLACE, x]), np.int64(down[PLACE, y])
        k, m = min(i + 1, low_width - 1), min(j + 1, low_height - 1)
        s, t = across[PLACE, x] - np.float32(i), down[PLACE, y] - np.float32(j)
        strength = strength * _between(small[ALIKE], i, k, s, j, m, t) if then > was * COVERED else ZERO
        kept[LOCKED, x], kept[LOCKED + 1, x] = strength, was + depth - then
        kept[LOCKED + 2, x], kept[LOCKED + 3, x] = moved_x, moved_y
        most = ZERO
        for c in range(3):
            react = kept[REACT, x] if c else ZERO
            if c < small.shape[0] - REACTIVE:
                react = _between(small[REACTIVE + c], i, k, s, j, m, t)
            kept[REACT + c, x], most = react, max(most, react)
        kept[SPARED, x] = lock * strength * (ONE - most)
        red, green, blue = remapped(old, there_x, there_y)
        kept[OLD, x], kept[OLD + 1, x], kept[OLD + 2, x] = red, green, blue
