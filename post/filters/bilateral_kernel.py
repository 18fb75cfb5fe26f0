"""The joint bilateral kernel over a row of pixels, compiled: nine or five taps at a time, weighed and summed at once;
and what noise denoisers expect.

Names and steps are those of `post.filters.reference`; see `post.filters.weight_kernel.room_weight`.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import contracted, inlined, scalar
from post.filters import constants
from post.filters.weight_kernel import (
    LEAST,
    LENGTH,
    LEVEL,
    LIMIT,
    NEXT,
    ONE,
    ROOT,
    ROWS,
    SCALE,
    SUMS,
    TOTAL,
    ZERO,
    Own,
    room_weight,
    there_row,
)  # fmt: skip

FIRST, SECOND, THIRD, FOURTH, SIXTH = (np.uint64(k) for k in (1, 2, 3, 4, 6))
HALF_ROOT, SLANT, QUARTER = ROOT / np.float32(2), np.float32(math.sqrt(ROOT)), np.float32(0.25)
AT_EDGES, MIN_MEAN = np.float32(constants.AT_EDGES), np.float32(constants.MIN_MEAN)
NARROWEST, MIN_CONTRAST = np.float32(constants.NARROWEST), np.float32(constants.MIN_CONTRAST)
NOISELESS, OVER_NINE = np.float32(1e-12), np.float32(1 / 3)  # square radiance; the root of nine pixels' share

Tap = namedtuple("Tap", "there light dy")
"""What taps read: a row of the guide and of luminance; and how far below the pixels it lies."""


@inlined
def bilateral_own(light, share, width, tolerance):
    """What differences from a pixel cost: a tolerance, and a square pixel by the spatial Gaussian, which is narrower at
    edges, where few of the four neighbours are on its surface (``share`` of them)."""
    sigma, scale = width * (AT_EDGES + (ONE - AT_EDGES) * QUARTER * share), SLANT / tolerance
    return Own(light * scale, scale, HALF_ROOT / (sigma * sigma))


@scalar
def unlit(room, run):
    """Let the light of taps count nothing, and neither their distance."""
    for i in range(np.uint64(run[1] - run[0])):
        room[i + LEVEL], room[i + SCALE], room[i + LIMIT] = ZERO, ZERO, ZERO


@scalar
def limit(room, light, width, tolerance, y, run, channels):
    """`bilateral_own` of the pixels of a run, whose sums of weights are those of the four neighbours; then no sums."""
    first, end = run
    own_light, wide, limit = light[y, first:end], width[y, first:end], tolerance[y, first:end]
    for i in range(np.uint64(end - first)):
        own = bilateral_own(own_light[i], room[i + TOTAL], wide[i], limit[i])
        room[i + LEVEL], room[i + SCALE], room[i + LIMIT] = own.level, own.scale, own.limit
        room[i + TOTAL] = ZERO
    room[ROWS * LENGTH : (ROWS + channels) * LENGTH] = ZERO


@contracted
@inlined
def bilateral_unlike(own, other, dx, dy):
    """What light and distance do to one tap of `reference.bilateral_reference`, as `weight_between` takes it."""
    away = other * own.scale - own.level
    return max(away * away, ROOT) + (own.limit * (dx * dx + dy * dy) - ROOT)


@contracted
@inlined
def _weight(i, j, room, tap, dx, kind):
    """The weight of pixel i's tap, j in what taps read."""
    own = Own(room[i + LEVEL], room[i + SCALE], room[i + LIMIT])
    return room_weight(i, room, j, tap.there, dx, tap.dy, kind, bilateral_unlike(own, tap.light[j], dx, tap.dy))


@contracted
@inlined
def _three(i, j, room, tap, dx, kind):
    """The weights of three taps."""
    further, last = dx + np.float32(1), dx + np.float32(2)
    return (
        _weight(i, j, room, tap, dx, kind),
        _weight(i, j + FIRST, room, tap, further, kind),
        _weight(i, j + SECOND, room, tap, last, kind),
    )


@contracted
@inlined
def _mix(values, at, weights):
    """Three weighted values."""
    return weights[0] * values[at] + weights[1] * values[at + FIRST] + weights[2] * values[at + SECOND]


@contracted
@scalar
def _add_nine(room, tap, values, base, size, count, dx, kind, planes):
    for i in range(count):
        a = _three(i, i, room, tap, dx, kind)
        b = _three(i, i + THIRD, room, tap, dx + np.float32(3), kind)
        c = _three(i, i + SIXTH, room, tap, dx + np.float32(6), kind)
        room[i + TOTAL] += (a[0] + a[1] + a[2]) + (b[0] + b[1] + b[2]) + (c[0] + c[1] + c[2])
        for k in range(len(planes)):
            at = base + np.uint64(k) * size + i
            mean = _mix(values, at, a) + _mix(values, at + THIRD, b) + _mix(values, at + SIXTH, c)
            room[SUMS + np.uint64(k) * NEXT + i] += mean


@contracted
@scalar
def _add_five(room, tap, values, base, size, count, dx, kind, planes):
    for i in range(count):
        a = _three(i, i, room, tap, dx, kind)
        d = _weight(i, i + THIRD, room, tap, dx + np.float32(3), kind)
        e = _weight(i, i + FOURTH, room, tap, dx + np.float32(4), kind)
        room[i + TOTAL] += (a[0] + a[1] + a[2]) + (d + e)
        for k in range(len(planes)):
            at = base + np.uint64(k) * size + i
            mean = _mix(values, at, a) + d * values[at + THIRD] + e * values[at + FOURTH]
            room[SUMS + np.uint64(k) * NEXT + i] += mean


@contracted
@scalar
def _add_one(room, tap, values, base, size, count, dx, kind, planes):
    for i in range(count):
        weight = _weight(i, i, room, tap, dx, kind)
        room[i + TOTAL] += weight
        for k in range(len(planes)):
            room[SUMS + np.uint64(k) * NEXT + i] += weight * values[base + np.uint64(k) * size + i]


@scalar
def taps_at_once(left):
    """How many taps of a row to add together, of those that are left."""
    return 9 if left >= 9 else (5 if left >= 5 else 1)


@scalar
def add_taps(room, guide, light, values, place, run, taps, kind, planes):
    """Add taps to the sums of a run; ``values`` are those of all pictures, and ``place`` is the first's in them."""
    offset, size = taps.first - run[0], np.uint64(guide.shape[1] * guide.shape[2])
    there, begin = there_row(guide, taps), taps.first + taps.dx
    tap = Tap(there, light[taps.y, begin : taps.end + taps.dx + taps.count - 1], np.float32(taps.dy))
    base, count, dx = (
        np.uint64(place + taps.y * guide.shape[2] + begin),
        np.uint64(taps.end - taps.first),
        np.float32(taps.dx),
    )
    part = room[offset:]
    if taps.count == 1:
        _add_one(part, tap, values, base, size, count, dx, kind, planes)
    elif taps.count == 5:
        _add_five(part, tap, values, base, size, count, dx, kind, planes)
    else:
        _add_nine(part, tap, values, base, size, count, dx, kind, planes)


@scalar
def finish(out, room, before, hit, y, run):
    """Means of a run from its sums; pixels that hit nothing are as before."""
    first, end = run
    known = hit[y, first:end]
    for c in range(out.shape[0]):
        new, old, row = out[c, y, first:end], before[c, y, first:end], np.uint64(c) * NEXT + SUMS
        for i in range(np.uint64(end - first)):
            mean = room[i + row] / max(room[i + TOTAL], LEAST)
            new[i] = mean if known[i] != ZERO else old[i]


@scalar
def noise_row(noise, column, variance, y):
    """A row of the 3x3 means' standard deviation: `edges.blurred` variance, its root, over the root of nine."""
    height, width = variance.shape
    above, here, below = variance[max(y - 1, 0)], variance[y], variance[min(y + 1, height - 1)]
    upper, lower = QUARTER if y > 0 else ZERO, QUARTER if y + 1 < height else ZERO
    norm = ONE / (upper + lower + QUARTER + QUARTER)
    for x in range(width):
        column[x] = (upper * above[x] + (QUARTER + QUARTER) * here[x] + lower * below[x]) * norm
    last = width - 1
    left, right, middle = column[: max(last - 1, 0)], column[2:], column[1 : max(last, 1)]
    inner = noise[1 : max(last, 1)]
    for i in range(inner.shape[0]):
        inner[i] = QUARTER * (left[i] + right[i]) + (QUARTER + QUARTER) * middle[i]
    for x in (0, last):
        beside = column[min(x + 1, last)] if x == 0 else column[x - 1]
        noise[x] = (column[x] + column[x] + beside) / (ONE + ONE + ONE) if width > 1 else column[x]
    for x in range(width):
        noise[x] = deviation_of(noise[x])


@inlined
def deviation_of(blurred):
    """The standard deviation of a 3x3 mean, from the blurred variance there."""
    return math.sqrt(max(blurred, ZERO) + NOISELESS) * OVER_NINE


@scalar
def limits_row(width, tolerance, column, light, variance, y, sigma, sensitivity, phi_color):
    """A row of `reference.limits_reference`."""
    wide, limit, here, spread = width[y], tolerance[y], light[y], variance[y]
    noise_row(limit, column, variance, y)
    for x in range(here.shape[0]):
        wide[x], limit[x] = limits_of(here[x], spread[x], limit[x], sigma, sensitivity, phi_color)


@inlined
def limits_of(light, variance, deviation, sigma, sensitivity, phi_color):
    """Width and tolerance of one pixel; ``deviation`` is that of the 3x3 mean."""
    size = abs(light)
    noise = math.sqrt(max(variance, NOISELESS)) / max(size, MIN_MEAN)
    width = sigma * (NARROWEST + (ONE - NARROWEST) * min(sensitivity * noise, ONE))
    return width, phi_color * deviation + MIN_CONTRAST * size
