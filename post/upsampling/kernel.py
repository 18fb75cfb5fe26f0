"""The compiled form of joint bilateral upsampling: a row of pixels as a body.

Names and steps are those of the torch reference in `post.upsampling.reference`, the definition. A pixel has sixteen
samples around it, of which the inner four are its nearest; the others are weighed only where these say too little.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.approximations import exp2
from gbufrt.compute.kernel import inlined, scalar
from post.filters.kernel import edge_exponent, edge_of, guide_row, plane_row
from post.upsampling import constants

ZERO, ONE, TINY = np.float32(0), np.float32(1), np.float32(1e-30)
ENOUGH, ANY, ONLY_NEAR = np.float32(constants.ENOUGH), np.float32(constants.ANY), np.float32(constants.ONLY_NEAR)
SENSITIVITY, POWER = np.float32(constants.DEPTH_SENSITIVITY), np.float32(constants.NORMAL_POWER)
SPAN = 4  # samples around a pixel, in each direction

Grid = namedtuple("Grid", "stride row column rows columns")
"""Pixels from sample to sample, the first row and column that have one, and how many there are."""
Pixel = namedtuple("Pixel", "x y left top")
"""A pixel, and the column and row of the nearest sample to its left and above, in samples."""


@scalar
def upsampled_row(out, low, guide, plane, clear, weights, y, first, end, grid, perspective):
    """Pixels ``first`` to ``end`` of a row from samples ``low`` ``(C, h, w)``; ``weights`` is scratch for one pixel."""
    width = out.shape[2]
    edge = edge_of(guide, perspective, SENSITIVITY / np.float32(grid.stride), POWER)
    here, planes = guide_row(guide, y, 0, width), plane_row(plane, y, 0, width)
    for x in range(first, end):
        if here.hit[x] == ZERO:
            for c in range(out.shape[0]):
                out[c, y, x] = clear[c]
            continue
        at = Pixel(x, y, (x - grid.column) // grid.stride, (y - grid.row) // grid.stride)
        weights[:] = ZERO
        total, start, stop = _weigh(weights, 1, 3, ONE, at, grid, guide, here, planes, edge), 1, 3
        if total < ENOUGH:
            total += _weigh(weights, 0, SPAN, ONE - total / ENOUGH, at, grid, guide, here, planes, edge)
            start, stop = 0, SPAN
        scale = ONE / max(total, TINY)
        for c in range(out.shape[0]):
            value = ZERO
            for j in range(start, stop):
                row = min(max(at.top + j - 1, 0), grid.rows - 1)
                for i in range(start, stop):
                    value += weights[j * SPAN + i] * low[c, row, min(max(at.left + i - 1, 0), grid.columns - 1)]
            out[c, y, x] = value * scale


@inlined
def _weigh(weights, start, end, factor, at, grid, guide, here, planes, edge):
    """Add the weights of the nearest samples, from 1 to 3 both ways, or of all; the sum of what was added."""
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
            exponent = edge_exponent(at.x, here, planes, column, there, np.float32(column - at.x), dy, edge)
            same = there.hit[column] * exp2(exponent)
            if every:
                share, same = share + ONLY_NEAR, same + ANY * there.hit[column] + ANY * ANY
            weights[j * SPAN + i] += factor * share * same
            total += factor * share * same
    return total


@inlined
def _samples(pixels, stride):
    return np.float32(pixels) / np.float32(stride)
