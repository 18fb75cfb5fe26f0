"""The compiled form of `post.lens.arc_reference`: a run of a row, or one pixel on a GPU, as a body.

What a run reads and writes lies in one array, ``room``, as in `post.filters.weight_kernel`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import contracted, driver, inlined, scalar
from post.lens import constants

ZERO, ONE, TWO = np.float32(0), np.float32(1), np.float32(2)
QUARTER, HALF, SIXTH = np.float32(1 / 4), np.float32(1 / 2), np.float32(1 / 6)
STEEP, TILT = np.float32(constants.STEEP**2), np.float32(constants.TILT**2)
LENGTH = np.uint64(1936)  # pixels: the longest part of a row
STEP = np.uint64(1)
OUT_Y, OWN_X, ABOVE_X, BELOW_X = LENGTH, np.uint64(2) * LENGTH, np.uint64(4) * LENGTH, np.uint64(6) * LENGTH
MOST, UNTURNED = np.float32(constants.MOST_SINE), np.float32(constants.UNTURNED)


@inlined
def _counts(x, y):
    square = x * x + y * y
    return ONE if square > ZERO and square < STEEP else ZERO


@inlined
def _slope(own_x, own_y, after_x, after_y, before_x, before_y):
    """How motion changes from pixel to pixel; a change of 0 tells nothing, as that beyond a border."""
    after_x, after_y, before_x, before_y = after_x - own_x, after_y - own_y, own_x - before_x, own_y - before_y
    after, before = _counts(after_x, after_y), _counts(before_x, before_y)
    scale = ONE / max(after + before, ONE)
    return (after * after_x + before * before_x) * scale, (after * after_y + before * before_y) * scale


@contracted
@inlined
def _turned(own, left, right, above, below):
    """Of one pixel's motion and those beside it, each a pair."""
    (x, y), (across_x, across_y) = own, _slope(own[0], own[1], right[0], right[1], left[0], left[1])
    down_x, down_y = _slope(x, y, below[0], below[1], above[0], above[1])
    curl, wide, askew = HALF * (across_y - down_x), across_x - down_y, across_y + down_x
    shear = QUARTER * (wide * wide + askew * askew)
    trust = min(max(TWO - shear / max(TILT * curl * curl, UNTURNED), ZERO), ONE)
    sine = min(max(curl * trust, -MOST), MOST)
    half = sine / (ONE + math.sqrt(ONE - sine * sine))
    longer = (ONE + SIXTH * half * half) / math.sqrt(ONE + half * half)
    return (x + half * y) * longer, (y - half * x) * longer


@inlined
def _both(room, i):
    return room[i], room[i + LENGTH]


@contracted
@scalar
def _turn(room, count):
    """The first rows of ``room`` from the others."""
    for i in range(count):
        own, above, below = i + OWN_X + STEP, i + ABOVE_X, i + BELOW_X
        left, right = _both(room, own - STEP), _both(room, own + STEP)
        room[i], room[i + OUT_Y] = _turned(_both(room, own), left, right, _both(room, above), _both(room, below))


@scalar
def _copy(out, values):
    for i in range(values.shape[0]):
        out[i] = values[i]


@scalar
def _run(out, motion, y, first, end, room):
    """Pixels ``first`` to ``end`` of a row; at the border the picture repeats."""
    height, width = motion.shape[1], motion.shape[2]
    count, size = end - first, np.int64(LENGTH)
    for k in range(2):
        own, row = room[(2 + k) * size :], motion[k, y]
        own[0], own[count + 1] = row[max(first - 1, 0)], row[min(end, width - 1)]
        _copy(own[1:], row[first:end])
        _copy(room[(4 + k) * size :], motion[k, max(y - 1, 0), first:end])
        _copy(room[(6 + k) * size :], motion[k, min(y + 1, height - 1), first:end])
    _turn(room, np.uint64(count))
    for k in range(2):
        _copy(out[k, y, first:end], room[k * size : k * size + count])


@driver
def turn_rows(out, motion, threads):
    """See `post.lens.arc_op.turned`."""
    batch, _, height, width = motion.shape
    most = np.int64(LENGTH) - 2
    for thread in prange(threads):
        room = np.empty(8 * np.int64(LENGTH), dtype=np.float32)
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            for first in range(0, width, most):
                _run(out[b], motion[b], y, first, min(first + most, width), room)


@inlined
def _pair(motion, y, x):
    return motion[0, y, x], motion[1, y, x]


@scalar
def turn_pixel(i, out, motion):
    """As `turn_rows`, one pixel."""
    b, y, x = pixel_of(i, motion.shape[2], motion.shape[3])
    there = motion[b]
    left, right = _pair(there, y, max(x - 1, 0)), _pair(there, y, min(x + 1, motion.shape[3] - 1))
    above, below = _pair(there, max(y - 1, 0), x), _pair(there, min(y + 1, motion.shape[2] - 1), x)
    out[b, 0, y, x], out[b, 1, y, x] = _turned(_pair(there, y, x), left, right, above, below)


turn_each = Each(turn_pixel)
