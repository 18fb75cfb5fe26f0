"""The compiled form of temporal upscaling: this frame's samples, and the mix of them with the history, row by row.

Names and steps are those of the torch reference in `post.upsampling.upscale_reference`, the definition. Where a sample
lies depends on column and row apart, so weights in boxes are products of two tables, and sums over them are of three
rows, then of three columns. Colours are tone-mapped. Of the tables see `post.upsampling.upscale_op.axis_table`.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import inlined, scalar
from post.history.color_kernel import luminance, ycocg
from post.history.constants import BRIGHTEST as MOST_BRIGHT
from post.upsampling import constants
from post.upsampling.remap_kernel import FOUR, bounded, gather_row
from post.upsampling.upscale_history_kernel import (
    AWAY,
    BOXES,
    DRIFT,
    ELLIPSE,
    EVEN,
    EXPECTED,
    FEATURE,
    INDEX,
    LOCK,
    LOCKED,
    NOW_DEPTH,
    OLD,
    REACT,
    READS,
    SPARED,
    STEP,
    VALUES,
    WEIGHT,
    WOBBLE,
    four_places,
)

ZERO, ONE, TWO = np.float32(0), np.float32(1), np.float32(2)
TINY = np.float32(1e-12)
BRIGHTEST, EIGHTH, FARTHEST = np.float32(MOST_BRIGHT), np.float32(1 / 8), np.float32(1 / 32)
SAMPLE_WINDOW, FIRST_WINDOW = np.float32(constants.SAMPLE_WINDOW), np.float32(constants.FIRST_WINDOW)
FOLLOWS, TRUSTED = np.float32(constants.FOLLOWS), np.float32(constants.TRUSTED)
LEAST_WEIGHT, MATURE, KNOWN, DECAY = (
    np.float32(constants.LEAST_WEIGHT),
    np.float32(constants.MATURE),
    np.float32(constants.KNOWN),
    np.float32(constants.DECAY),
)
MIRRORS, FEW = np.float32(constants.MIRRORS), np.float32(constants.FEW)
NARROWEST, WIDER = np.float32(constants.NARROWEST), np.float32(constants.WIDEST - constants.NARROWEST)
WIDEST_AT, DISTRUST = np.float32(constants.WIDEST_AT), np.float32(constants.DISTRUST)
NEW_SHARE, STEADY, LOCK_WIDENS = (
    np.float32(constants.NEW_SHARE),
    np.float32(constants.STEADY),
    np.float32(constants.LOCK_WIDENS),
)
COLOR, MEAN, SPREAD, NOW_WEIGHT, LOWEST, HIGHEST = 0, 3, 6, 9, 10, 13
"""Rows of what this frame tells of each pixel."""
NOW, SUMS = 16, 6
BESIDE, WINDOW, COUNTS = 3, 5, READS
"""Rows of scratch after the three of ellipses: how far samples lie to the side, their window, and how each counts."""


@scalar
def sums_row(sums, small, begin):
    """Of columns of samples from ``begin`` on, sums over three rows about a row of pixels: YCoCg and its squares."""
    toned, down, y, count = small.toned, small.down, small.y, sums.shape[1]
    sums[:] = ZERO
    s0, s1, s2, s3, s4, s5 = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    for k in range(3):
        first = bounded(np.int64(down[INDEX, y]) + k - 1, small.height) * small.width + begin
        box, end = down[BOXES + k, y], first + count
        red, green, blue = toned[0, first:end], toned[1, first:end], toned[2, first:end]
        for x in range(count):
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
def _weigh_four(counts, now, kept, rows, small):
    """How the four samples around each pixel count, by ellipses, in shares of all."""
    step, side, left, right = small.across[STEP, 0], small.down[STEP, 0], rows[BESIDE], rows[BESIDE + 1]
    away, window, area = small.across[AWAY, small.first : small.end], rows[WINDOW], small.lens[22] * small.lens[23]
    xx, xy, yy, total, ready = rows[0], rows[1], rows[2], now[NOW_WEIGHT], kept[WEIGHT]
    for x in range(pixels(left.shape[0])):
        left[x], right[x] = away[x], away[x] + (-step if away[x] > ZERO else step)
        mature = min(max(ready[x] / MATURE, ZERO), ONE)
        window[x] = SAMPLE_WINDOW * mature + FIRST_WINDOW / area * (ONE - mature)
        total[x] = LEAST_WEIGHT
    above = small.down[AWAY, small.y]
    for k in range(FOUR):
        count, beside = counts[k], rows[BESIDE + k % 2]
        v = above + (-side if above > ZERO else side) if k > 1 else above
        for x in range(pixels(count.shape[0])):
            u = beside[x]
            square = xx[x] * u * u + xy[x] * u * v * TWO + yy[x] * v * v
            total[x] += _near(SAMPLE_WINDOW * square)
            count[x] = _near(window[x] * square)
    one, two, three, four = counts[0], counts[1], counts[2], counts[3]
    for x in range(pixels(one.shape[0])):
        share = ONE / (one[x] + two[x] + three[x] + four[x])
        one[x], two[x], three[x], four[x] = one[x] * share, two[x] * share, three[x] * share, four[x] * share


@scalar
def colors_row(now, kept, small, scratch):
    """Colours of the four samples that surround each pixel, by ellipses; see `accumulate.gathered`."""
    taps, rows = scratch
    values, counts = rows[VALUES : VALUES + FOUR], rows[COUNTS : COUNTS + FOUR]
    four_places(taps, small, ONE)
    for k in range(3):
        gather_row(rows[k], small.seen[ELLIPSE + k], taps[0])
    _weigh_four(counts, now, kept, rows, small)
    a, b, c, d, weight = values[0], values[1], values[2], values[3], kept[WEIGHT]
    one, two, three, four = counts[0], counts[1], counts[2], counts[3]
    for n in range(3):
        for k in range(FOUR):
            gather_row(values[k], small.seen[EXPECTED + n], taps[k])
        color, old = now[COLOR + n], kept[OLD + n]
        for x in range(pixels(one.shape[0])):
            expected = one[x] * a[x] + two[x] * b[x] + three[x] * c[x] + four[x] * d[x]
            color[x] = FOLLOWS * weight[x] / (weight[x] + TRUSTED) * (old[x] - expected)
        for k in range(FOUR):
            gather_row(values[k], small.toned[n], taps[k])
        lowest, highest = now[LOWEST + n], now[HIGHEST + n]
        for x in range(pixels(one.shape[0])):
            color[x] += one[x] * a[x] + two[x] * b[x] + three[x] * c[x] + four[x] * d[x]
            lowest[x], highest[x] = min(min(a[x], b[x]), min(c[x], d[x])), max(max(a[x], b[x]), max(c[x], d[x]))


@scalar
def box_row(now, sums, small, begin):
    """What bounds the history of each pixel; see `accumulate.gathered`. ``sums`` are of columns from ``begin`` on."""
    index, down, y, count = small.across[INDEX, small.first : small.end], small.down, small.y, sums.shape[1]
    across, first = small.across, small.first
    box_high = down[BOXES, y] + down[BOXES + 1, y] + down[BOXES + 2, y]
    for x in range(pixels(now.shape[1])):
        i = np.int64(index[x]) - begin
        h, k = bounded(i - 1, count), bounded(i + 1, count)
        a, b, c = across[BOXES, first + x], across[BOXES + 1, first + x], across[BOXES + 2, first + x]
        share = ONE / ((a + b + c) * box_high)
        for n in range(3):
            mean = (a * sums[n, h] + b * sums[n, i] + c * sums[n, k]) * share
            square = (a * sums[n + 3, h] + b * sums[n + 3, i] + c * sums[n + 3, k]) * share
            now[MEAN + n, x] = mean
            now[SPREAD + n, x] = math.sqrt(max(square - mean * mean, ZERO) + TINY)


@scalar
def _extent_row(extent, kept, gamma, stability, widest_at):
    """Standard deviations to the sides of the boxes."""
    drift, wobble, spared, weight, even = kept[DRIFT], kept[WOBBLE], kept[SPARED], kept[WEIGHT], kept[EVEN]
    for x in range(pixels(extent.shape[0])):
        calm = min(max(ONE - abs(drift[x]) / max(wobble[x], STEADY), ZERO), ONE) if wobble[x] > STEADY else ZERO
        wide = NARROWEST + WIDER * min(max(weight[x] / widest_at, ZERO), ONE)
        extent[x] = (gamma + LOCK_WIDENS * spared[x] + stability * calm) * wide * (ONE - MIRRORS * even[x])


@scalar
def _clip_row(rows, kept, now):
    """Histories within their boxes, in RGB, how far their lumas moved, and what weight is left."""
    red, green, blue, r, g, b = rows[0], rows[1], rows[2], kept[OLD], kept[OLD + 1], kept[OLD + 2]
    m0, m1, m2, s0, s1, s2 = now[MEAN], now[MEAN + 1], now[MEAN + 2], now[SPREAD], now[SPREAD + 1], now[SPREAD + 2]
    extent, moved, weight = rows[3], rows[4], kept[WEIGHT]
    for x in range(pixels(extent.shape[0])):
        luma, orange, shift = ycocg(r[x], g[x], b[x])
        e0, e1, e2 = extent[x] * s0[x], extent[x] * s1[x], extent[x] * s2[x]
        a0 = min(max(luma, m0[x] - e0), m0[x] + e0)
        a1, a2 = min(max(orange, m1[x] - e1), m1[x] + e1), min(max(shift, m2[x] - e2), m2[x] + e2)
        red[x], green[x], blue[x] = max(a0 + a1 - a2, ZERO), max(a0 + a2, ZERO), max(a0 - a1 - a2, ZERO)
        moved[x] = a0 - luma if weight[x] > ZERO else ZERO
        weight[x] /= ONE + DISTRUST * max(max(abs(a0 - luma), abs(a1 - orange)), abs(a2 - shift))


@scalar
def mix_row(kept, now, small, rows, numbers, new, light, length):
    """The new history: the old one, clipped to its box, with this frame in it; and the light that it shows."""
    (gamma, frames, stability, mean_weight), y, first, end = numbers, small.y, small.first, small.end
    most_length, weight, more, spared = frames * mean_weight, kept[WEIGHT], now[NOW_WEIGHT], kept[SPARED]
    counts, even, known = rows[5], kept[EVEN], min(KNOWN, FEW * mean_weight)
    for x in range(pixels(weight.shape[0])):
        counts[x] = mean_weight + (more[x] - mean_weight) * min(weight[x] / known, ONE) * (ONE - even[x])
    _extent_row(rows[3], kept, gamma, stability, WIDEST_AT * mean_weight)
    _clip_row(rows, kept, now)
    for k in range(3):
        clipped, old, color, react = rows[k], kept[OLD + k], now[COLOR + k], kept[REACT + k]
        lowest, highest, out = now[LOWEST + k], now[HIGHEST + k], new[k, y, first:end]
        for x in range(pixels(weight.shape[0])):
            most = min(weight[x], (ONE - react[x]) * most_length)
            was = clipped[x] + (old[x] - clipped[x]) * spared[x]
            mixed = was + (color[x] - was) * (counts[x] / (most + counts[x]))
            mixed = min(max(mixed, min(was, lowest[x])), max(was, highest[x]))
            out[x] = mixed if weight[x] > ZERO else color[x]
    red, green, blue, lengths = new[0, y, first:end], new[1, y, first:end], new[2, y, first:end], length[y, first:end]
    r, g, b = light[0, y, first:end], light[1, y, first:end], light[2, y, first:end]
    for x in range(pixels(weight.shape[0])):
        lengths[x] = min(weight[x] + more[x], most_length)
        level = ONE - min(max(luminance(red[x], green[x], blue[x]), ZERO), BRIGHTEST)
        r[x], g[x], b[x] = red[x] / level, green[x] / level, blue[x] / level


@scalar
def keep_row(kept, now, small, scratch, planes):
    """What the history holds besides: how clipping moves it, and locks; after `mix_row`."""
    (taps, rows), y, first, end = scratch, small.y, small.first, small.end
    drift, wobble, moved, met, more = kept[DRIFT], kept[WOBBLE], rows[4], rows[VALUES], now[NOW_WEIGHT]
    new_drift, new_wobble = planes[0, y, first:end], planes[1, y, first:end]
    gather_row(met, small.surfaces[FEATURE], taps[0])
    for x in range(pixels(met.shape[0])):
        new_drift[x] = drift[x] + (moved[x] - drift[x]) * NEW_SHARE
        new_wobble[x] = wobble[x] + (abs(moved[x]) - wobble[x]) * NEW_SHARE
    near, row_near, old, fresh = small.across[LOCK, first:end], small.down[LOCK, y], kept[LOCKED], rows[0]
    strength = planes[2, y, first:end]
    for x in range(pixels(met.shape[0])):
        found, left = met[x] * near[x] * row_near, max(old[x] - DECAY * more[x], ZERO)
        strength[x], fresh[x] = max(found, left), found - left
    for k in range(3):
        out, was, now_is = planes[3 + k, y, first:end], kept[LOCKED + 1 + k], kept[NOW_DEPTH + k]
        for x in range(pixels(met.shape[0])):
            out[x] = now_is[x] if fresh[x] > ZERO else was[x]
