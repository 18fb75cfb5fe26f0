"""The compiled form of joint bilateral upsampling: a row of pixels as a body.

Names and steps are those of the torch reference in `post.upsampling.reference`, the definition. A pixel has sixteen
samples around it, of which the inner four are its nearest; the others are weighed only where these say too little.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import contracted, inlined, scalar
from post.filters.kernel import guide_row
from post.filters.weight_kernel import Near, edge_weight, edge_with, near_row
from post.upsampling import constants

ZERO, ONE, TINY = np.float32(0), np.float32(1), np.float32(1e-30)
ENOUGH, ELSEWHERE, FAR_SHARE = (
    np.float32(constants.ENOUGH),
    np.float32(constants.ELSEWHERE),
    np.float32(constants.FAR_SHARE),
)
SENSITIVITY, POWER = np.float32(constants.DEPTH_SENSITIVITY), np.float32(constants.NORMAL_POWER)
SQUARINGS = (0,) * round(math.log2(constants.NORMAL_POWER))  # of a cosine: see `weight_kernel`
SPAN = 4  # samples around a pixel, in each direction

Grid = namedtuple("Grid", "stride row column rows columns")
"""Pixels from sample to sample, the first row and column that have one, and how many there are."""
Pixel = namedtuple("Pixel", "x y left top")
"""A pixel, and the column and row of the nearest sample to its left and above, in samples."""


@scalar
def upsampled_row(out, low, guide, plane, clear, weights, near, y, first, end, grid, perspective):
    """Pixels ``first`` to ``end`` of a row from samples ``low`` ``(C, h, w)``; ``weights`` is room for those around a
    pixel, and ``near`` ``(3, end - first)`` for the pixels' `weight_kernel.Near`.
    """
    edge = edge_with(guide, perspective, SQUARINGS, POWER)
    near_row(near, plane, y, first, end, SENSITIVITY / np.float32(grid.stride))
    here, planes = guide_row(guide, y, first, end), Near(near[0], near[1], near[2])
    for x in range(first, end):
        if here.hit[x - first] == ZERO:
            for c in range(out.shape[0]):
                out[c, y, x] = clear[c]
            continue
        at = Pixel(x, y, (x - grid.column) // grid.stride, (y - grid.row) // grid.stride)
        if _is_sample(at, grid):
            for c in range(out.shape[0]):
                out[c, y, x] = low[c, at.top, at.left]
            continue
        weights[:] = ZERO
        total, start, stop = _weigh(weights, 1, 3, ONE, at, grid, guide, x - first, here, planes, edge), 1, 3
        if total < ENOUGH:
            total += _weigh(weights, 0, SPAN, ONE - total / ENOUGH, at, grid, guide, x - first, here, planes, edge)
            start, stop = 0, SPAN
        _mix(out, low, weights, ONE / max(total, TINY), start, stop, at, grid)


@inlined
def _is_sample(at, grid):
    """Whether a pixel is itself a sample: it then keeps its value, because all its weight is its own."""
    inside = at.top >= 0 and at.left >= 0
    across, down = at.left * grid.stride + grid.column, at.top * grid.stride + grid.row
    return inside and across == at.x and down == at.y


@contracted
@inlined
def _mix(out, low, weights, scale, start, end, at, grid):
    """A pixel from its samples by their weights."""
    for c in range(out.shape[0]):
        out[c, at.y, at.x] = ZERO
    for j in range(start, end):
        row = min(max(at.top + j - 1, 0), grid.rows - 1)
        for i in range(start, end):
            weight = weights[j * SPAN + i] * scale
            if weight != ZERO:
                column = min(max(at.left + i - 1, 0), grid.columns - 1)
                for c in range(out.shape[0]):
                    out[c, at.y, at.x] += weight * low[c, row, column]


@contracted
@inlined
def _weigh(weights, start, end, factor, at, grid, guide, number, here, planes, edge):
    """Add the weights of the nearest samples, from 1 to 3 both ways, or of all; the sum of what was added.

    ``number`` is the pixel's in ``here`` and ``planes``.
    """
    every, total = end == SPAN, ZERO
    reach = ONE + ONE if every else ONE
    across, down = _samples(at.x - grid.column, grid.stride), _samples(at.y - grid.row, grid.stride)
    for j in range(start, end):
        away = ONE - abs(np.float32(at.top + j - 1) - down) / reach
        row = min(max(at.top + j - 1, 0), grid.rows - 1) * grid.stride + grid.row
        there, dy = guide_row(guide, row, 0, guide.shape[2]), np.float32(row - at.y)
        for i in range(start, end):
            share = (ONE - abs(np.float32(at.left + i - 1) - across) / reach) * away
            if share == ZERO and not every:
                continue
            column = min(max(at.left + i - 1, 0), grid.columns - 1) * grid.stride + grid.column
            same = edge_weight(number, here, planes, column, there, np.float32(column - at.x), dy, edge, ZERO)
            if every:
                share, same = share + FAR_SHARE, same + ELSEWHERE * there.hit[column] + ELSEWHERE * ELSEWHERE
            weights[j * SPAN + i] += factor * share * same
            total += factor * share * same
    return total


@inlined
def _samples(pixels, stride):
    return np.float32(pixels) / np.float32(stride)
