"""The compiled form of temporal upscaling: what is to be known of a frame's samples, row by row of the small picture.

Names and steps are those of the torch reference in `post.upsampling.upscale_reference`, the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from post.upsampling import constants
from post.upsampling.upscale_history_kernel import ELLIPSE, EXPECTED, SHEAR, remapped

ZERO, HALF, ONE, FOUR, TINY = (np.float32(x) for x in (0, 0.5, 1, 4, 1e-12))
ACROSS, FLAT = np.float32(1 - constants.ALONG), np.float32(constants.FLAT)
FASTEST = np.float32(constants.FASTEST)
TENSOR, SEEN = 3, 7


@scalar
def samples_row(out, sums, old, light, motion, lens, y, first):
    """What the history shows where samples lie, how otherwise their neighbours move, and ellipses along edges.

    ``sums`` is room for two columns more than ``out`` has. ``light`` and ``motion``, pixels of the small picture, reach
    two and one pixels beyond the picture. Of ``lens`` see `post.upsampling.upscale_op`.
    """
    width = out.shape[1]
    _tensor_row(sums, light, y, first)
    xx, xy, yy = sums[0], sums[1], sums[2]
    one, two, three = out[ELLIPSE], out[ELLIPSE + 1], out[ELLIPSE + 2]
    for x in range(width):
        a, b, c = xx[x] + xx[x + 1] + xx[x + 2], xy[x] + xy[x + 1] + xy[x + 2], yy[x] + yy[x + 1] + yy[x + 2]
        larger = HALF * (a + c + math.sqrt((a - c) * (a - c) + FOUR * b * b + TINY))
        share = ACROSS / (a + c + FLAT)
        one[x], two[x], three[x] = ONE - share * (larger - a), share * b, ONE - share * (larger - c)
    _shear_row(out[SHEAR], motion, lens, y, first)
    _, large_height, large_width = old.shape
    for x in range(width):
        at_x = np.float32(first + x) + HALF + lens[24] + motion[0, y + 1, first + x + 1]
        at_y = np.float32(y) + HALF + lens[25] + motion[1, y + 1, first + x + 1]
        at_x = min(max(at_x * lens[22], -ONE), np.float32(large_width + 1))
        at_y = min(max(at_y * lens[23], -ONE), np.float32(large_height + 1))
        out[EXPECTED, x], out[EXPECTED + 1, x], out[EXPECTED + 2, x] = remapped(old, at_x, at_y)


@scalar
def _tensor_row(sums, light, y, first):
    """Squares and products of differences, summed over three rows."""
    sums[:] = ZERO
    xx, xy, yy = sums[0], sums[1], sums[2]
    end = first + len(xx) + 2
    for k in range(3):
        above, here, below = light[y + k, first:end], light[y + k + 1, first:end], light[y + k + 2, first:end]
        for x in range(len(xx)):
            across, down = here[x + 2] - here[x], below[x + 1] - above[x + 1]
            xx[x] += across * across
            xy[x] += across * down
            yy[x] += down * down


@scalar
def _shear_row(out, motion, lens, y, first):
    """Lengths, pixels of the large picture."""
    out[:] = ZERO
    end = first + len(out) + 2
    here_x, here_y = motion[0, y + 1, first + 1 : end - 1], motion[1, y + 1, first + 1 : end - 1]
    for k in range(3):
        for i in range(3):
            there_x, there_y = motion[0, y + k, first + i : end], motion[1, y + k, first + i : end]
            for x in range(len(out)):
                apart_x, apart_y = (there_x[x] - here_x[x]) * lens[22], (there_y[x] - here_y[x]) * lens[23]
                out[x] = max(out[x], apart_x * apart_x + apart_y * apart_y)
    for x in range(len(out)):
        out[x] = min(math.sqrt(out[x]), FASTEST)
