"""The compiled form of `post.lens.arc_reference`: a run of a row, or one pixel on a GPU, as a body."""

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
def _turn(out_x, out_y, own, left, right, above, below):
    """A run of pixels, given those beside them, ``(2, N)`` each."""
    own_x, own_y, left_x, left_y, right_x, right_y = own[0], own[1], left[0], left[1], right[0], right[1]
    above_x, above_y, below_x, below_y = above[0], above[1], below[0], below[1]
    for i in range(out_x.shape[0]):
        x, y = own_x[i], own_y[i]
        across_x, across_y = _slope(x, y, right_x[i], right_y[i], left_x[i], left_y[i])
        down_x, down_y = _slope(x, y, below_x[i], below_y[i], above_x[i], above_y[i])
        curl, wide, askew = HALF * (across_y - down_x), across_x - down_y, across_y + down_x
        shear = QUARTER * (wide * wide + askew * askew)
        trust = min(max(TWO - shear / max(TILT * curl * curl, UNTURNED), ZERO), ONE)
        sine = min(max(curl * trust, -MOST), MOST)
        half = sine / (ONE + math.sqrt(ONE - sine * sine))
        longer = (ONE + SIXTH * half * half) / math.sqrt(ONE + half * half)
        out_x[i], out_y[i] = (x + half * y) * longer, (y - half * x) * longer


@scalar
def _run(out, motion, y, first, end):
    """Pixels ``first`` to ``end`` of a row; at the border the picture repeats."""
    height, width = motion.shape[1], motion.shape[2]
    count, left, right = end - first, max(first - 1, 0), min(first + 1, width - 1)
    row = motion[:, y]
    _turn(
        out[0, y, first:end], out[1, y, first:end], row[:, first:end], row[:, left : left + count],
        row[:, right : right + count], motion[:, max(y - 1, 0), first:end],
        motion[:, min(y + 1, height - 1), first:end],
    )  # fmt: skip


@driver
def turn_rows(out, motion, threads):
    """See `post.lens.arc_op.turned`."""
    batch, _, height, width = motion.shape
    for thread in prange(threads):
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            _run(out[b], motion[b], y, 0, 1)
            if width > 2:
                _run(out[b], motion[b], y, 1, width - 1)
            _run(out[b], motion[b], y, width - 1, width)


@scalar
def turn_pixel(i, out, motion):
    """As `turn_rows`, one pixel."""
    b, y, x = pixel_of(i, motion.shape[2], motion.shape[3])
    _run(out[b], motion[b], y, x, x + 1)


turn_each = Each(turn_pixel)
