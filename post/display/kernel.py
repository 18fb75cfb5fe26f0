"""The compiled forms of the AgX tone curve, the display's encoding, the vignette and the histogram that exposure is
metered by: a row of pixels as a body.

Names and steps are those of the torch references in `post.display.reference`, the definition. Logarithms and powers are
approximations that become vector instructions.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.approximations import exp2, log2
from gbufrt.compute.kernel import inlined, scalar
from gbufrt.luminance import REC709
from post.display import constants

ZERO, ONE, TINY = np.float32(0), np.float32(1), np.float32(constants.TINY)
RED, GREEN, BLUE = (np.float32(share) for share in REC709)
LEAST, RANGE = np.float32(constants.AGX_MIN_EV), np.float32(constants.AGX_MAX_EV - constants.AGX_MIN_EV)
C0, C1, C2, C3, C4, C5, C6 = (np.float32(c) for c in constants.AGX_CURVE)
GAMMA = np.float32(constants.AGX_DISPLAY_GAMMA)
HALF, TWO, THREE = np.float32(0.5), np.float32(2), np.float32(3)
BINS, DARKEST = np.int32(constants.BINS), np.float32(constants.DARKEST)
SPREAD = np.float32(constants.BINS / (constants.BRIGHTEST - constants.DARKEST))
LEAST_LIGHT, MOST_LIGHT = np.float32(2.0**constants.DARKEST), np.float32(2.0**constants.BRIGHTEST)
UNLIT = DARKEST - ONE
SRGB_KNEE, SRGB_SLOPE = np.float32(constants.SRGB_KNEE), np.float32(constants.SRGB_SLOPE)
SRGB_OFFSET, SRGB_SCALE = np.float32(constants.SRGB_OFFSET), np.float32(1 + constants.SRGB_OFFSET)
SRGB_POWER = np.float32(1 / constants.SRGB_GAMMA)


@inlined
def _graded(light, contrast):
    """One channel through the curve and its contrast."""
    x = min(max((log2(max(light, TINY)) - LEAST) / RANGE, ZERO), ONE)
    curve = (((((C6 * x + C5) * x + C4) * x + C3) * x + C2) * x + C1) * x + C0
    return exp2(contrast * log2(max(curve, TINY)))


@inlined
def _shown(value):
    """Display-linear light."""
    return exp2(GAMMA * log2(min(max(value, TINY), ONE)))


@inlined
def _mixed(shares, red, green, blue):
    """A row of a matrix times a colour."""
    return shares[0] * red + shares[1] * green + shares[2] * blue


@scalar
def _row_of(matrix, i):
    """A row as numbers: a loop that may write to what it reads is not vectorised."""
    return matrix[i, 0], matrix[i, 1], matrix[i, 2]


@scalar
def agx_row(out, color, y, first, end, exposure, contrast, saturation, inset, outset):
    """Pixels ``first`` to ``end`` of a row of AgX. ``outset`` is the inverse of ``inset``."""
    in_red, in_green, in_blue = _row_of(inset, 0), _row_of(inset, 1), _row_of(inset, 2)
    out_red, out_green, out_blue = _row_of(outset, 0), _row_of(outset, 1), _row_of(outset, 2)
    reds, greens, blues = color[0, y, first:end], color[1, y, first:end], color[2, y, first:end]
    new_reds, new_greens, new_blues = out[0, y, first:end], out[1, y, first:end], out[2, y, first:end]
    for x in range(reds.shape[0]):
        r, g, b = max(reds[x] * exposure, ZERO), max(greens[x] * exposure, ZERO), max(blues[x] * exposure, ZERO)
        red, green = _graded(_mixed(in_red, r, g, b), contrast), _graded(_mixed(in_green, r, g, b), contrast)
        blue = _graded(_mixed(in_blue, r, g, b), contrast)
        grey = RED * red + GREEN * green + BLUE * blue
        r, g, b = (
            grey + saturation * (red - grey),
            grey + saturation * (green - grey),
            grey + saturation * (blue - grey),
        )
        new_reds[x] = _shown(_mixed(out_red, r, g, b))
        new_greens[x] = _shown(_mixed(out_green, r, g, b))
        new_blues[x] = _shown(_mixed(out_blue, r, g, b))


@scalar
def encode_row(out, image, y, first, end):
    """Pixels ``first`` to ``end`` of a row of `post.display.reference.encode_reference`."""
    for c in range(out.shape[0]):
        row, given = out[c, y, first:end], image[c, y, first:end]
        for x in range(row.shape[0]):
            value = min(max(given[x], ZERO), ONE)
            curved = SRGB_SCALE * exp2(SRGB_POWER * log2(max(value, SRGB_KNEE))) - SRGB_OFFSET
            row[x] = curved if value > SRGB_KNEE else SRGB_SLOPE * value


@scalar
def vignette_row(out, image, y, first, end, strength, inner, span):
    """A row of `post.display.reference.vignette_reference`; ``span`` is from the inner circle to the outer."""
    height, width = np.float32(image.shape[1]), np.float32(image.shape[2])
    down, middle = np.float32(y) + HALF - HALF * height, HALF * width
    diagonal = math.sqrt(middle * middle + HALF * height * HALF * height)
    for c in range(out.shape[0]):
        row, given = out[c, y, first:end], image[c, y, first:end]
        for x in range(row.shape[0]):
            across = np.float32(first + x) + HALF - middle
            distance = math.sqrt(across * across + down * down) / diagonal
            t = min(max((distance - inner) / span, ZERO), ONE)
            row[x] = given[x] * (ONE - strength * t * t * (THREE - TWO * t))


@scalar
def histogram_row(count, total, stops, color, y):
    """Add a row to `post.display.reference.histogram_reference`; ``stops`` is room for it."""
    red, green, blue = color[0, y], color[1, y], color[2, y]
    for x in range(stops.shape[0]):
        light = RED * red[x] + GREEN * green[x] + BLUE * blue[x]
        stops[x] = log2(min(max(light, LEAST_LIGHT), MOST_LIGHT)) if light > ZERO else UNLIT
    for x in range(stops.shape[0]):
        if stops[x] > UNLIT:
            place = min(max(np.int32((stops[x] - DARKEST) * SPREAD), np.int32(0)), BINS - np.int32(1))
            count[place] += 1.0
            total[place] += stops[x]
