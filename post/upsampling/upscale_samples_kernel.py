"""The compiled form of temporal upscaling: what is to be known of a frame's samples, row by row of the small picture.

Names and steps are those of the torch reference in `post.upsampling.upscale_reference`, the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import inlined, scalar
from gbufrt.luminance import REC709
from post.upsampling import constants
from post.upsampling.remap_kernel import FOUR, SHARES, between_row, gather_taps, moved_row, taps_row
from post.upsampling.upscale_history_kernel import ELLIPSE, EXPECTED, SHEAR

ZERO, HALF, ONE, FOUR_TIMES, TINY = (np.float32(x) for x in (0, 0.5, 1, 4, 1e-12))
ACROSS, FLAT = np.float32(1 - constants.ALONG), np.float32(constants.FLAT)
FASTEST, MATURE = np.float32(constants.FASTEST), np.float32(constants.MATURE)
RED, GREEN, BLUE = (np.float32(x) for x in REC709)
TENSOR, SEEN = 3, 7
AT, SHARE, VALUES, READS, LIGHTS = 0, 2, 2 + SHARES, 2 + SHARES + FOUR, 2 + SHARES + 2 * FOUR
"""Rows of scratch: where samples were, for reads, and luminance of the 4x4 pixels that are read."""
SCRATCH = LIGHTS + FOUR * FOUR


@scalar
def samples_row(out, sums, scratch, old, length, mirrored, size, light, motion, lens, y, first):
    """What the history shows where samples lie, how otherwise their neighbours move, and ellipses along edges.

    ``sums`` is room for two columns more than ``out`` has, ``scratch`` are taps and rows. ``old`` and ``length``
    are flat, of ``size``. ``mirrored`` is how far samples count alike, whatever their distance. ``light`` and
    ``motion``, pixels of the small picture, reach two and one pixels beyond the picture. Of ``lens`` see
    `post.upsampling.upscale_op`.
    """
    (taps, rows), (height, width) = scratch, size
    _tensor_row(sums, light, y, first)
    xx, xy, yy = sums[0], sums[1], sums[2]
    one, two, three = out[ELLIPSE], out[ELLIPSE + 1], out[ELLIPSE + 2]
    for x in range(pixels(out.shape[1])):
        a, b, c = xx[x] + xx[x + 1] + xx[x + 2], xy[x] + xy[x + 1] + xy[x + 2], yy[x] + yy[x + 1] + yy[x + 2]
        one[x], two[x], three[x] = _along(a, b, c)
    _shear_row(out[SHEAR], motion, lens, y, first)
    at_x, at_y, end = rows[AT], rows[AT + 1], first + out.shape[1] + 1
    motion_x, motion_y = motion[0, y + 1, first + 1 : end], motion[1, y + 1, first + 1 : end]
    right, bottom = np.float32(width + 1), np.float32(height + 1)
    for x in range(pixels(out.shape[1])):
        at_x[x] = (np.float32(np.int32(first + x)) + HALF + lens[24] + motion_x[x]) * lens[22]
        at_y[x] = (np.float32(y) + HALF + lens[25] + motion_y[x]) * lens[23]
        at_x[x], at_y[x] = min(max(at_x[x], -ONE), right), min(max(at_y[x], -ONE), bottom)
    shares, values, reads = rows[SHARE : SHARE + SHARES], rows[VALUES : VALUES + FOUR], rows[READS : READS + FOUR]
    taps_row(taps, shares, at_x, at_y, height, width)
    lights = rows[LIGHTS : LIGHTS + FOUR * FOUR]
    lights[:] = ZERO
    for k in range(3):
        for j in range(FOUR):
            gather_taps(values, old[k], taps, taps[FOUR + j])
            _add_rows(lights[FOUR * j : FOUR * j + FOUR], values, RED if k == 0 else (GREEN if k == 1 else BLUE))
            moved_row(reads[j], values, shares[0])
        moved_row(out[EXPECTED + k], reads, shares[1])
    between_row(reads[0], length, taps, shares, values)
    _ellipse_row(out, sums, lights, reads[0], mirrored[y, first : first + out.shape[1]])


@inlined
def _along(a, b, c):
    """The ellipse along the edge that a structure tensor tells of."""
    larger = HALF * (a + c + math.sqrt((a - c) * (a - c) + FOUR_TIMES * b * b + TINY))
    share = ACROSS / (a + c + FLAT)
    return ONE - share * (larger - a), share * b, ONE - share * (larger - c)


@scalar
def _add_rows(sums, values, share):
    for k in range(FOUR):
        total, value = sums[k], values[k]
        for x in range(pixels(total.shape[0])):
            total[x] += share * value[x]


@scalar
def _ellipse_row(out, sums, lights, length, mirrored):
    """Ellipses of this frame, but of the 4x4 pixels of the history as far as that has samples, and shows no mirrors."""
    sums[:] = ZERO
    xx, xy, yy = sums[0], sums[1], sums[2]
    for k in range(3):
        for i in range(3):
            one, two = lights[FOUR * k + i], lights[FOUR * k + i + 1]
            three, four = lights[FOUR * k + FOUR + i], lights[FOUR * k + FOUR + i + 1]
            for x in range(pixels(length.shape[0])):
                rising, falling = four[x] - one[x], two[x] - three[x]
                across, down = rising + falling, rising - falling
                xx[x] += across * across
                xy[x] += across * down
                yy[x] += down * down
    first, second, third = out[ELLIPSE], out[ELLIPSE + 1], out[ELLIPSE + 2]
    for x in range(pixels(length.shape[0])):
        share, (a, b, c) = min(length[x] / MATURE, ONE) * (ONE - mirrored[x]), _along(xx[x], xy[x], yy[x])
        first[x] += (a - first[x]) * share
        second[x] += (b - second[x]) * share
        third[x] += (c - third[x]) * share


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
