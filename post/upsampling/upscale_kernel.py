"""The compiled form of temporal upscaling: a row of the large picture at a time.

Names and steps are those of the torch reference in `post.upsampling.upscale_reference`, the definition. Where a sample
lies depends on column and row apart, so its weights are products of two tables, and windows are sums of three rows,
then of three columns. Colours are tone-mapped. Of the tables see `post.upsampling.upscale_op.axis_table`.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.filters.signals import REC709
from post.history.constants import BRIGHTEST as MOST_BRIGHT
from post.history.constants import WINDOW as NARROW
from post.upsampling import constants

ZERO, QUARTER, HALF, ONE, TWO, FOUR = (np.float32(x) for x in (0, 0.25, 0.5, 1, 2, 4))
THIRD, SIXTH, TWO_THIRDS = np.float32(1 / 3), np.float32(1 / 6), np.float32(2 / 3)
TINY, SMALL, SMALLEST, NEAREST = np.float32(1e-12), np.float32(1e-6), np.float32(1e-30), np.float32(1e-9)
BRIGHTEST, WINDOW, FIRST = np.float32(MOST_BRIGHT), np.float32(NARROW), np.float32(constants.FIRST)
LEAST, MATURE, DECAY = np.float32(constants.LEAST), np.float32(constants.MATURE), np.float32(constants.DECAY)
PARTING, COVERED = np.float32(constants.PARTING), np.float32(1 - constants.COVERED)
SLOW, STEADY, WIDER = np.float32(constants.SLOW), np.float32(constants.STEADY), np.float32(constants.WIDER)
BETWEEN, IN_FRONT = np.float32(constants.BETWEEN), np.float32(1 - constants.IN_FRONT)
STRETCH, TOLERANCE = np.float32(constants.STRETCH), np.float32(1 + constants.TOLERANCE)
EDGE_ON = np.float32(constants.EDGE_ON)
RED, GREEN, BLUE = (np.float32(share) for share in REC709)
INDEX, TAPS, BOXES, LOCK, PLACE, AWAY, STEP = 0, 1, 4, 7, 8, 9, 10
"""Rows of `axis_table`."""
DEPTH, HIT, FACING, OFFSET, OWN, OWN_Z, ALIKE, FEATURE, REACTIVE = 0, 1, 2, 5, 6, 8, 9, 10, 11
"""Channels of what the small picture tells of its surfaces."""
WEIGHT, OLD, DRIFT, WOBBLE, LOCKED, NOW_DEPTH, NOW_MOTION, SPARED, REACT = 0, 1, 4, 5, 6, 10, 11, 13, 14
"""Rows of what is kept of each pixel's history; `LOCKED` has four, as `accumulate.locked`, `REACT` three."""
KEPT = 17
COLOR, MEAN, SPREAD, NOW_WEIGHT = 0, 3, 6, 9
"""Rows of what this frame tells of each pixel."""
NOW = 10


@inlined
def _luminance(r, g, b):
    return RED * r + GREEN * g + BLUE * b


@inlined
def _ycocg(r, g, b):
    return QUARTER * r + HALF * g + QUARTER * b, HALF * (r - b), HALF * g - QUARTER * (r + b)


@inlined
def _bounded(i, count):
    return min(max(i, 0), count - 1)


@scalar
def coefficients_row(out, rows, image, taps, y):
    """A row of spline coefficients ``(3, W)``: down, then across; ``rows`` is room for one row."""
    (_, height, width), reach = image.shape, len(taps) // 2
    for c in range(3):
        rows[:] = ZERO
        for k in range(-reach, reach + 1):
            row, weight = image[c, _bounded(y + k, height)], taps[k + reach]
            for x in range(width):
                rows[reach + x] += weight * row[x]
        for x in range(reach):
            rows[x], rows[reach + width + x] = rows[reach], rows[reach + width - 1]
        new = out[c, y]
        new[:] = ZERO
        for k in range(2 * reach + 1):
            row, weight = rows[k : k + width], taps[k]
            for x in range(width):
                new[x] += weight * row[x]


@inlined
def _surface_in_front(small, across, down, x, y):
    """Column and row of the nearest surface among the four samples that surround a pixel."""
    _, height, width = small.shape
    column, row = np.int64(across[INDEX, x]), np.int64(down[INDEX, y])
    side_x = column - (1 if across[AWAY, x] > ZERO else (-1 if across[AWAY, x] < ZERO else 0))
    side_y = row - (1 if down[AWAY, y] > ZERO else (-1 if down[AWAY, y] < ZERO else 0))
    side_x, side_y = _bounded(side_x, width), _bounded(side_y, height)
    best_x, best_y, nearest = column, row, small[DEPTH, row, column]
    for k in range(1, 4):
        i, j = side_x if k != 2 else column, side_y if k != 1 else row
        if small[DEPTH, j, i] < nearest * IN_FRONT:
            best_x, best_y, nearest = i, j, small[DEPTH, j, i]
    return best_x, best_y


@inlined
def _was_at(small, lens, across, down, orthographic, x, y):
    """Where a pixel was, px, and its depth now and then."""
    column, row = _surface_in_front(small, across, down, x, y)
    near, at_x, at_y = small[DEPTH, row, column], np.float32(x) + HALF, np.float32(y) + HALF
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
def _cubic(f):
    """Weights of a B-spline's taps at -1, 0, 1 and 2."""
    g, square, cube = ONE - f, f * f, f * f * f
    first, last, second = g * g * g * SIXTH, cube * SIXTH, TWO_THIRDS - square + HALF * cube
    return first, second, ONE - first - second - last, last


@inlined
def _between(plane, i, k, u, j, m, v):
    """A plane between columns ``i`` and ``k``, by ``u`` of the way, and rows ``j`` and ``m``, by ``v``."""
    return (ONE - v) * ((ONE - u) * plane[j, i] + u * plane[j, k]) + v * ((ONE - u) * plane[m, i] + u * plane[m, k])


@scalar
def fetch_row(kept, small, farthest, lens, across, down, orthographic, curve, length, planes, lock, y):
    """History where each pixel was, and what is left of its locks; zero where the pixel was not seen."""
    (_, height, width), (low_height, low_width) = curve.shape, farthest.shape
    for x in range(width):
        there_x, there_y, depth, then = _was_at(small, lens, across, down, orthographic, x, y)
        move_x, move_y = there_x - (np.float32(x) + HALF), there_y - (np.float32(y) + HALF)
        kept[NOW_DEPTH, x], kept[NOW_MOTION, x], kept[NOW_MOTION + 1, x] = depth, move_x, move_y
        valid = there_x >= ZERO and there_x < np.float32(width) and there_y >= ZERO and there_y < np.float32(height)
        if valid:
            i = _bounded(np.int64(math.floor(there_x / lens[22] - lens[20])), low_width)
            j = _bounded(np.int64(math.floor(there_y / lens[23] - lens[21])), low_height)
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
        xa, xb = _bounded(x0 - 1, width), _bounded(x0, width)
        xc, xd = _bounded(x0 + 1, width), _bounded(x0 + 2, width)
        ye, yf = _bounded(y0 - 1, height), _bounded(y0, height)
        yg, yh = _bounded(y0 + 1, height), _bounded(y0 + 2, height)
        kept[WEIGHT, x] = _between(length, xb, xc, u, yf, yg, v) * (ONE - BETWEEN * blur)
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
        a, b, c, d = _cubic(u)
        e, f, g, h = _cubic(v)
        for n in range(3):
            r0, r1, r2, r3 = curve[n, ye], curve[n, yf], curve[n, yg], curve[n, yh]
            kept[OLD + n, x] = (
                e * (a * r0[xa] + b * r0[xb] + c * r0[xc] + d * r0[xd])
                + f * (a * r1[xa] + b * r1[xb] + c * r1[xc] + d * r1[xd])
                + g * (a * r2[xa] + b * r2[xb] + c * r2[xc] + d * r2[xd])
                + h * (a * r3[xa] + b * r3[xb] + c * r3[xc] + d * r3[xd])
            )


@scalar
def sums_row(sums, toned, down, y):
    """Of each column of samples, sums over three rows about a row of pixels: colours, then YCoCg and its squares."""
    _, height, width = toned.shape
    sums[:] = ZERO
    s0, s1, s2, s3, s4, s5 = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    s6, s7, s8 = sums[6], sums[7], sums[8]
    for k in range(3):
        row = _bounded(np.int64(down[INDEX, y]) + k - 1, height)
        weight, box = down[TAPS + k, y], down[BOXES + k, y]
        red, green, blue = toned[0, row], toned[1, row], toned[2, row]
        for x in range(width):
            r, g, b = red[x], green[x], blue[x]
            luma, orange, shift = _ycocg(r, g, b)
            s0[x] += weight * r
            s1[x] += weight * g
            s2[x] += weight * b
            s3[x] += box * luma
            s4[x] += box * orange
            s5[x] += box * shift
            s6[x] += box * luma * luma
            s7[x] += box * orange * orange
            s8[x] += box * shift * shift


@scalar
def _wide(now, toned, across, down, window, x, y):
    """Mean colour about a pixel with little history, by a wider window."""
    _, height, width = toned.shape
    column, row, share, r, g, b = np.int64(across[INDEX, x]), np.int64(down[INDEX, y]), ZERO, ZERO, ZERO, ZERO
    step_x, step_y = across[STEP, 0], down[STEP, 0]
    for j in range(-1, 2):
        away = down[AWAY, y] + np.float32(j) * step_y
        at, by = _bounded(row + j, height), math.exp(window * away * away)
        for i in range(-1, 2):
            away = across[AWAY, x] + np.float32(i) * step_x
            to, counts = _bounded(column + i, width), by * math.exp(window * away * away)
            share += counts
            r, g, b = r + counts * toned[0, at, to], g + counts * toned[1, at, to], b + counts * toned[2, at, to]
    share = max(share, SMALLEST)
    now[COLOR, x], now[COLOR + 1, x], now[COLOR + 2, x] = r / share, g / share, b / share


@scalar
def now_row(now, kept, sums, toned, across, down, area, y):
    """What this frame tells of each pixel; see `accumulate.Gathered`."""
    (_, _, low_width), width = toned.shape, now.shape[1]
    high = down[TAPS, y] + down[TAPS + 1, y] + down[TAPS + 2, y]
    box_high = down[BOXES, y] + down[BOXES + 1, y] + down[BOXES + 2, y]
    for x in range(width):
        i = np.int64(across[INDEX, x])
        h, k = _bounded(i - 1, low_width), _bounded(i + 1, low_width)
        a, b, c = across[TAPS, x], across[TAPS + 1, x], across[TAPS + 2, x]
        near = (a + b + c) * high
        now[NOW_WEIGHT, x], share = near + LEAST, ONE / max(near, SMALLEST)
        ready = min(max(kept[WEIGHT, x] / MATURE, ZERO), ONE)
        if ready < ONE:
            _wide(now, toned, across, down, WINDOW * ready + FIRST / area * (ONE - ready), x, y)
        else:
            for n in range(3):
                now[COLOR + n, x] = (a * sums[n, h] + b * sums[n, i] + c * sums[n, k]) * share
        a, b, c = across[BOXES, x], across[BOXES + 1, x], across[BOXES + 2, x]
        share = ONE / ((a + b + c) * box_high)
        for n in range(3):
            mean = (a * sums[n + 3, h] + b * sums[n + 3, i] + c * sums[n + 3, k]) * share
            square = (a * sums[n + 6, h] + b * sums[n + 6, i] + c * sums[n + 6, k]) * share
            now[MEAN + n, x] = mean
            now[SPREAD + n, x] = math.sqrt(max(square - mean * mean, ZERO) + TINY)


@scalar
def mix_row(out, light, length, planes, kept, now, small, across, down, numbers, y):
    """The new history: the old one, clipped to its box, with this frame in it; and the light that it shows."""
    gamma, frames, stability, mean_weight = numbers
    most_length = frames * mean_weight
    for x in range(kept.shape[1]):
        weight, more = kept[WEIGHT, x], now[NOW_WEIGHT, x]
        drift, wobble, spared, moved = kept[DRIFT, x], kept[WOBBLE, x], kept[SPARED, x], ZERO
        for k in range(3):
            out[k, y, x] = now[COLOR + k, x]
        if weight > ZERO:
            calm = min(max(ONE - abs(drift) / max(wobble, STEADY), ZERO), ONE) if wobble > STEADY else ZERO
            extent = gamma + WIDER * spared + stability * calm
            r, g, b = kept[OLD, x], kept[OLD + 1, x], kept[OLD + 2, x]
            luma, orange, shift = _ycocg(r, g, b)
            a0, a1, a2 = luma - now[MEAN, x], orange - now[MEAN + 1, x], shift - now[MEAN + 2, x]
            outside = max(
                abs(a0) / max(extent * now[SPREAD, x], SMALL), abs(a1) / max(extent * now[SPREAD + 1, x], SMALL)
            )
            outside = max(max(outside, abs(a2) / max(extent * now[SPREAD + 2, x], SMALL)), ONE)
            a0 = now[MEAN, x] + a0 / outside
            a1, a2 = now[MEAN + 1, x] + a1 / outside, now[MEAN + 2, x] + a2 / outside
            moved = a0 - luma
            clipped = (a0 + a1 - a2, a0 + a2, a0 - a1 - a2)
            for k in range(3):
                most = min(weight, (ONE - kept[REACT + k, x]) * most_length)
                old = clipped[k] + (kept[OLD + k, x] - clipped[k]) * spared
                out[k, y, x] = old + (now[COLOR + k, x] - old) * (more / (most + more))
        planes[0, y, x], planes[1, y, x] = drift + (moved - drift) * SLOW, wobble + (abs(moved) - wobble) * SLOW
        length[y, x] = min(weight + more, most_length)
        met = small[FEATURE, np.int64(down[INDEX, y]), np.int64(across[INDEX, x])] * across[LOCK, x] * down[LOCK, y]
        strength = max(kept[LOCKED, x] - DECAY * more, ZERO)
        fresh = met > strength
        planes[2, y, x] = met if fresh else strength
        planes[3, y, x] = kept[NOW_DEPTH, x] if fresh else kept[LOCKED + 1, x]
        planes[4, y, x] = kept[NOW_MOTION, x] if fresh else kept[LOCKED + 2, x]
        planes[5, y, x] = kept[NOW_MOTION + 1, x] if fresh else kept[LOCKED + 3, x]
        level = ONE - min(max(_luminance(out[0, y, x], out[1, y, x], out[2, y, x]), ZERO), BRIGHTEST)
        for k in range(3):
            light[k, y, x] = out[k, y, x] / level
