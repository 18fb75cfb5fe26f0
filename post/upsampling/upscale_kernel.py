"""The compiled form of temporal upscaling: this frame's samples, and the mix of them with the history, row by row.

Names and steps are those of the torch reference in `post.upsampling.upscale_reference`, the definition. Where a sample
lies depends on column and row apart, so weights in boxes are products of two tables, and sums over them are of three
rows, then of three columns. Colours are tone-mapped. Of the tables see `post.upsampling.upscale_op.axis_table`.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.history.color_kernel import luminance, ycocg
from post.history.constants import BRIGHTEST as MOST_BRIGHT
from post.upsampling import constants
from post.upsampling.upscale_history_kernel import (
    AWAY,
    BOXES,
    DRIFT,
    ELLIPSE,
    EXPECTED,
    FEATURE,
    INDEX,
    LOCK,
    LOCKED,
    NOW_DEPTH,
    NOW_MOTION,
    OLD,
    REACT,
    SPARED,
    STEP,
    WEIGHT,
    WOBBLE,
    bounded,
)

ZERO, ONE, TWO = np.float32(0), np.float32(1), np.float32(2)
TINY, SMALL, SMALLEST = np.float32(1e-12), np.float32(1e-6), np.float32(1e-30)
BRIGHTEST, EIGHTH, FARTHEST = np.float32(MOST_BRIGHT), np.float32(1 / 8), np.float32(1 / 32)
SAMPLE_WINDOW, FIRST_WINDOW = np.float32(constants.SAMPLE_WINDOW), np.float32(constants.FIRST_WINDOW)
FOLLOWS, TRUSTED = np.float32(constants.FOLLOWS), np.float32(constants.TRUSTED)
LEAST_WEIGHT, MATURE, DECAY = (
    np.float32(constants.LEAST_WEIGHT),
    np.float32(constants.MATURE),
    np.float32(constants.DECAY),
)
NEW_SHARE, STEADY, LOCK_WIDENS = (
    np.float32(constants.NEW_SHARE),
    np.float32(constants.STEADY),
    np.float32(constants.LOCK_WIDENS),
)
COLOR, MEAN, SPREAD, NOW_WEIGHT, LOWEST, HIGHEST = 0, 3, 6, 9, 10, 13
"""Rows of what this frame tells of each pixel."""
NOW, SUMS = 16, 6


@scalar
def sums_row(sums, toned, down, y, begin):
    """Of columns of samples from ``begin`` on, sums over three rows about a row of pixels: YCoCg and its squares."""
    height, end = toned.shape[1], begin + sums.shape[1]
    sums[:] = ZERO
    s0, s1, s2, s3, s4, s5 = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    for k in range(3):
        row, box = bounded(np.int64(down[INDEX, y]) + k - 1, height), down[BOXES + k, y]
        red, green, blue = toned[0, row, begin:end], toned[1, row, begin:end], toned[2, row, begin:end]
        for x in range(sums.shape[1]):
            luma, orange, shift = ycocg(red[x], green[x], blue[x])
            s0[x] += box * luma
            s1[x] += box * orange
            s2[x] += box * shift
            s3[x] += box * luma * luma
            s4[x] += box * orange * orange
            s5[x] += box * shift * shift


@inlined
def _near(exponent):
    power = max(ONE + exponent * EIGHTH, FARTHEST)
    square = power * power
    return square * square * square * square


@scalar
def colors_row(now, kept, toned, seen, across, down, area, y):
    """Colours of the four samples that surround each pixel, by ellipses; see `accumulate.gathered`."""
    _, height, width = toned.shape
    row, above = np.int64(down[INDEX, y]), down[AWAY, y]
    side = -1 if above > ZERO else 1
    other, below, step = bounded(row + side, height), above + np.float32(side) * down[STEP, 0], across[STEP, 0]
    for x in range(now.shape[1]):
        column, left = np.int64(across[INDEX, x]), across[AWAY, x]
        side = -1 if left > ZERO else 1
        beside, right = bounded(column + side, width), left + np.float32(side) * step
        xx, xy, yy = seen[ELLIPSE, row, column], seen[ELLIPSE + 1, row, column], seen[ELLIPSE + 2, row, column]
        ready = min(max(kept[WEIGHT, x] / MATURE, ZERO), ONE)
        window = SAMPLE_WINDOW * ready + FIRST_WINDOW / area * (ONE - ready)
        count, share, r, g, b, e, f, h = LEAST_WEIGHT, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
        l0, l1, l2 = toned[0, row, column], toned[1, row, column], toned[2, row, column]
        m0, m1, m2 = l0, l1, l2
        for k in range(4):
            i, j = beside if k % 2 else column, other if k > 1 else row
            u, v = right if k % 2 else left, below if k > 1 else above
            square = xx * u * u + xy * u * v * TWO + yy * v * v
            count += _near(SAMPLE_WINDOW * square)
            counts = _near(window * square)
            t0, t1, t2 = toned[0, j, i], toned[1, j, i], toned[2, j, i]
            share, r, g, b = share + counts, r + counts * t0, g + counts * t1, b + counts * t2
            e, f = e + counts * seen[EXPECTED, j, i], f + counts * seen[EXPECTED + 1, j, i]
            h += counts * seen[EXPECTED + 2, j, i]
            l0, l1, l2, m0, m1, m2 = min(l0, t0), min(l1, t1), min(l2, t2), max(m0, t0), max(m1, t1), max(m2, t2)
        share, follows = ONE / share, FOLLOWS * kept[WEIGHT, x] / (kept[WEIGHT, x] + TRUSTED)
        now[COLOR, x] = r * share + follows * (kept[OLD, x] - e * share)
        now[COLOR + 1, x] = g * share + follows * (kept[OLD + 1, x] - f * share)
        now[COLOR + 2, x] = b * share + follows * (kept[OLD + 2, x] - h * share)
        now[LOWEST, x], now[LOWEST + 1, x], now[LOWEST + 2, x] = l0, l1, l2
        now[HIGHEST, x], now[HIGHEST + 1, x], now[HIGHEST + 2, x] = m0, m1, m2
        now[NOW_WEIGHT, x] = count


@scalar
def box_row(now, sums, across, down, y, begin, low_width):
    """What bounds the history of each pixel; see `accumulate.gathered`. ``sums`` are of columns from ``begin`` on."""
    box_high = down[BOXES, y] + down[BOXES + 1, y] + down[BOXES + 2, y]
    for x in range(now.shape[1]):
        i = np.int64(across[INDEX, x])
        h, k = bounded(i - 1, low_width) - begin, bounded(i + 1, low_width) - begin
        a, b, c = across[BOXES, x], across[BOXES + 1, x], across[BOXES + 2, x]
        share = ONE / ((a + b + c) * box_high)
        for n in range(3):
            mean = (a * sums[n, h] + b * sums[n, i - begin] + c * sums[n, k]) * share
            square = (a * sums[n + 3, h] + b * sums[n + 3, i - begin] + c * sums[n + 3, k]) * share
            now[MEAN + n, x] = mean
            now[SPREAD + n, x] = math.sqrt(max(square - mean * mean, ZERO) + TINY)


@scalar
def mix_row(kept, now, small, across, down, numbers, y, out, light, length, planes):
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
            extent = gamma + LOCK_WIDENS * spared + stability * calm
            r, g, b = kept[OLD, x], kept[OLD + 1, x], kept[OLD + 2, x]
            luma, orange, shift = ycocg(r, g, b)
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
                mixed = old + (now[COLOR + k, x] - old) * (more / (most + more))
                out[k, y, x] = min(max(mixed, min(old, now[LOWEST + k, x])), max(old, now[HIGHEST + k, x]))
        planes[0, y, x], planes[1, y, x] = (
            drift + (moved - drift) * NEW_SHARE,
            wobble + (abs(moved) - wobble) * NEW_SHARE,
        )
        length[y, x] = min(weight + more, most_length)
        met = small[FEATURE, np.int64(down[INDEX, y]), np.int64(across[INDEX, x])] * across[LOCK, x] * down[LOCK, y]
        strength = max(kept[LOCKED, x] - DECAY * more, ZERO)
        fresh = met > strength
        planes[2, y, x] = met if fresh else strength
        planes[3, y, x] = kept[NOW_DEPTH, x] if fresh else kept[LOCKED + 1, x]
        planes[4, y, x] = kept[NOW_MOTION, x] if fresh else kept[LOCKED + 2, x]
        planes[5, y, x] = kept[NOW_MOTION + 1, x] if fresh else kept[LOCKED + 3, x]
        level = ONE - min(max(luminance(out[0, y, x], out[1, y, x], out[2, y, x]), ZERO), BRIGHTEST)
        for k in range(3):
            light[k, y, x] = out[k, y, x] / level
