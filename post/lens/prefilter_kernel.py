"""The compiled form of `post.lens.shutter_reference.prefiltered`: a run of a row, or one pixel on a GPU, as a body."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import contracted, driver, scalar
from post.lens import constants

ZERO, HALF, ONE, TWO, THIRD = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2), np.float32(1 / 3)
OVERSHOOT = np.float32(constants.OVERSHOOT)


@contracted
def _sharpen(out, row, left, right, above, below, along, down, reach):
    """A run of pixels of one channel, given those beside them."""
    for x in range(out.shape[0]):
        own, a, b, c, d = row[x], left[x], right[x], above[x], below[x]
        across, up = min(abs(along[x]) * reach, ONE), min(abs(down[x]) * reach, ONE)
        across, up = HALF * across * (HALF - across * THIRD), HALF * up * (HALF - up * THIRD)
        sharp = own - across * (a + b - TWO * own) - up * (c + d - TWO * own)
        low, high = min(min(min(a, b), min(c, d)), own), max(max(max(a, b), max(c, d)), own)
        beyond = min(OVERSHOOT * (high - low), max(low, ZERO))
        out[x] = min(max(sharp, low - beyond), high + beyond)


@scalar
def _run(out, color, path, reach, y, first, end):
    """Pixels ``first`` to ``end`` of a row; at the border the picture repeats."""
    height, width = color.shape[1], color.shape[2]
    count, left, right = end - first, max(first - 1, 0), min(first + 1, width - 1)
    above, below = max(y - 1, 0), min(y + 1, height - 1)
    for c in range(color.shape[0]):
        row = color[c, y]
        _sharpen(
            out[c, y, first:end], row[first:end], row[left : left + count], row[right : right + count],
            color[c, above, first:end], color[c, below, first:end], path[0, y, first:end], path[1, y, first:end], reach,
        )  # fmt: skip


@driver
def prefilter_rows(out, color, path, reach, threads):
    """See `post.lens.shutter_reference.prefiltered`."""
    batch, _, height, width = color.shape
    for thread in prange(threads):
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            _run(out[b], color[b], path[b], np.float32(reach), y, 0, 1)
            if width > 2:
                _run(out[b], color[b], path[b], np.float32(reach), y, 1, width - 1)
            _run(out[b], color[b], path[b], np.float32(reach), y, width - 1, width)


@scalar
def prefilter_pixel(i, out, color, path, reach):
    """As `prefilter_rows`, one pixel."""
    b, y, x = pixel_of(i, color.shape[2], color.shape[3])
    _run(out[b], color[b], path[b], np.float32(reach), y, x, x + 1)


prefilter_each = Each(prefilter_pixel)
