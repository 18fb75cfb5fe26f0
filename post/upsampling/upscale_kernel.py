"""The compiled form of temporal upscaling: this frame's samples, and the mix of them with the history, row by row.

Names and steps are those of the torch reference in `post.upsampling.upscale_reference`, the definition. Where a sample
lies depends on column and row apart, so its weights are products of two tables, and windows are sums of three rows,
then of three columns. Colours are tone-mapped. Of the tables see `post.upsampling.upscale_op.axis_table`.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from post.history.color_kernel import luminance, ycocg
from post.history.constants import BRIGHTEST as MOST_BRIGHT
from post.history.constants import WINDOW as NARROW
from post.upsampling import constants
from post.upsampling.upscale_history_kernel import (
    AWAY,
    BOXES,
    COUNTED,
    DRIFT,
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
    TAPS,
    WEIGHT,
    WOBBLE,
    bounded,
)

ZERO, ONE = np.float32(0), np.float32(1)
TINY, SMALL, SMALLEST = np.float32(1e-12), np.float32(1e-6), np.float32(1e-30)
BRIGHTEST, WINDOW, FIRST = np.float32(MOST_BRIGHT), np.float32(NARROW), np.float32(constants.FIRST)
LEAST, MATURE, DECAY = np.float32(constants.LEAST), np.float32(constants.MATURE), np.float32(constants.DECAY)
SLOW, STEADY, WIDER = np.float32(constants.SLOW), np.float32(constants.STEADY), np.float32(constants.WIDER)
COLOR, MEAN, SPREAD, NOW_WEIGHT = 0, 3, 6, 9
"""Rows of what this frame tells of each pixel."""
NOW, SUMS = 10, 9


@scalar
def sums_row(sums, toned, down, y, begin):
    """Of columns of samples from ``begin`` on, sums over three rows about a row of pixels: colours, then YCoCg and its
    squares."""
    height, end = toned.shape[1], begin + sums.shape[1]
    sums[:] = ZERO
    s0, s1, s2, s3, s4, s5 = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    s6, s7, s8 = sums[6], sums[7], sums[8]
    for k in range(3):
        row = bounded(np.int64(down[INDEX, y]) + k - 1, height)
        weight, box = down[TAPS + k, y], down[BOXES + k, y]
        red, green, blue = toned[0, row, begin:end], toned[1, row, begin:end], toned[2, row, begin:end]
        for x in range(sums.shape[1]):
            r, g, b = red[x], green[x], blue[x]
            luma, orange, shift = ycocg(r, g, b)
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
        at, by = bounded(row + j, height), math.exp(window * away * away)
        for i in range(-1, 2):
            away = across[AWAY, x] + np.float32(i) * step_x
            to, counts = bounded(column + i, width), by * math.exp(window * away * away)
            share += counts
            r, g, b = r + counts * toned[0, at, to], g + counts * toned[1, at, to], b + counts * toned[2, at, to]
    share = max(share, SMALLEST)
    now[COLOR, x], now[COLOR + 1, x], now[COLOR + 2, x] = r / share, g / share, b / share


@scalar
def now_row(now, kept, sums, toned, across, down, area, y, begin):
    """What this frame tells of each pixel; see `accumulate.Gathered`. ``sums`` are of columns from ``begin`` on."""
    (_, _, low_width), width = toned.shape, now.shape[1]
    high = down[TAPS, y] + down[TAPS + 1, y] + down[TAPS + 2, y]
    box_high = down[BOXES, y] + down[BOXES + 1, y] + down[BOXES + 2, y]
    for x in range(width):
        i = np.int64(across[INDEX, x])
        h, k = bounded(i - 1, low_width) - begin, bounded(i + 1, low_width) - begin
        a, b, c = across[TAPS, x], across[TAPS + 1, x], across[TAPS + 2, x]
        near = (a + b + c) * high
        now[NOW_WEIGHT, x] = across[COUNTED, x] * down[COUNTED, y] + LEAST
        share = ONE / max(near, SMALLEST)
        ready = min(max(kept[WEIGHT, x] / MATURE, ZERO), ONE)
        if ready < ONE:
            _wide(now, toned, across, down, WINDOW * ready + FIRST / area * (ONE - ready), x, y)
        else:
            for n in range(3):
                now[COLOR + n, x] = (a * sums[n, h] + b * sums[n, i - begin] + c * sums[n, k]) * share
        a, b, c = across[BOXES, x], across[BOXES + 1, x], across[BOXES + 2, x]
        share = ONE / ((a + b + c) * box_high)
        for n in range(3):
            mean = (a * sums[n + 3, h] + b * sums[n + 3, i - begin] + c * sums[n + 3, k]) * share
            square = (a * sums[n + 6, h] + b * sums[n + 6, i - begin] + c * sums[n + 6, k]) * share
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
            extent = gamma + WIDER * spared + stability * calm
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
        level = ONE - min(max(luminance(out[0, y, x], out[1, y, x], out[2, y, x]), ZERO), BRIGHTEST)
        for k in range(3):
            light[k, y, x] = out[k, y, x] / level
