"""The compiled form of reading a history: pixels ``first`` to ``end`` of a row of this frame as a body.

Names and steps are those of `post.history.reproject` and `post.history.catmull_rom`, which are the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import inlined, scalar
from post.history import constants
from post.history.correspondence_kernel import ANY_WAY, FARTHEST, HALF, ONE, ZERO, gathered, keep_same, nearest_same

KEPT, WHOLE, INFINITE = np.float32(constants.KEPT), np.float32(constants.WHOLE), np.float32(np.inf)
INNER, ALL = 4, 16  # taps of a bilinear footprint, and of a sharp one, which begin with these
ROWS = ALL + 7  # of scratch: shares of taps, and what else `read_row` keeps


@inlined
def _spline(f, which):
    """One of `catmull_rom_weights`."""
    square, cube = f * f, f * f * f
    if which == 0:
        return square - HALF * (f + cube)
    if which == 1:
        return ONE - np.float32(2.5) * square + np.float32(1.5) * cube
    if which == 2:
        return HALF * f + np.float32(2) * square - np.float32(1.5) * cube
    return HALF * (cube - square)


@scalar
def _footprints(columns, lines, fine, weights, across, down, y, first):
    """Where each pixel reads: the first pixel of its bilinear footprint, the place in it, and the shares."""
    for x in range(pixels(columns.shape[0])):
        column = np.float32(first + x) + min(max(across[x], -FARTHEST), FARTHEST)
        line = np.float32(y) + min(max(down[x], -FARTHEST), FARTHEST)
        left, top = math.floor(column), math.floor(line)
        fx, fy = column - np.float32(left), line - np.float32(top)
        columns[x], lines[x], fine[0, x], fine[1, x] = left, top, fx, fy
        weights[0, x], weights[1, x] = (ONE - fx) * (ONE - fy), fx * (ONE - fy)
        weights[2, x], weights[3, x] = (ONE - fx) * fy, fx * fy


@scalar
def _any(weights):
    """Whether a tap has a share at any pixel: where nothing moves, only the first has."""
    most = ZERO
    for x in range(pixels(weights.shape[0])):
        most = max(most, abs(weights[x]))
    return most > ZERO


@scalar
def _sharpen(weights, fine, sharp, lost, scratch, places, now, past, columns, lines, plane, normal):
    """Sixteen taps in place of four where ``sharp`` is one: outer ones that are not on the surface give their share to
    the nearest of the four."""
    count = pixels(sharp.shape[0])
    for k in range(INNER):
        _spline_row(weights[k], fine, sharp, k // 2, k % 2, weights[k])
    k = INNER
    for j in range(-1, 3):
        for i in range(-1, 3):
            row, column = min(max(j, 0), 1), min(max(i, 0), 1)
            if j == row and i == column:
                continue
            share, near = weights[k], weights[2 * row + column]
            lost[:] = ZERO
            _spline_row(share, fine, sharp, j, i, lost)
            if _any(share):
                for x in range(count):
                    lost[x] = share[x]
                keep_same(share, places[k], scratch, now, past, columns, lines, i, j, plane, normal)
                for x in range(count):
                    near[x] += lost[x] - share[x]
            k += 1


@inlined
def _spline_row(out, fine, sharp, j, i, other):
    """Shares of the tap ``j`` rows below and ``i`` columns right of the first; the others where not ``sharp``."""
    for x in range(pixels(out.shape[0])):
        share = _spline(fine[1, x], j + 1) * _spline(fine[0, x], i + 1)
        out[x] = share if sharp[x] > ZERO else other[x]


@scalar
def _sum_taps(row, values, picture, weights, places, used):
    """Add the taps of every pixel, of those that have a share at any."""
    row[:] = ZERO
    for k in range(INNER):
        if used & (1 << k):
            gathered(values, picture, places[k])
            weight = weights[k]
            for x in range(pixels(row.shape[0])):
                row[x] += weight[x] * values[x] if weight[x] != ZERO else ZERO


@scalar
def _sum_held(row, scratch, sharp, picture, weights, places, used):
    """As `_sum_taps`, of all sixteen, held between the least and the greatest tap: negative weights may ring."""
    values, low, high = scratch
    row[:], low[:], high[:] = ZERO, INFINITE, -INFINITE
    for k in range(ALL):
        if used & (1 << k):
            gathered(values, picture, places[k])
            weight = weights[k]
            for x in range(pixels(row.shape[0])):
                value, share = values[x], weight[x]
                row[x] += share * value if share != ZERO else ZERO
                low[x] = value if (share != ZERO) & (value < low[x]) else low[x]
                high[x] = value if (share != ZERO) & (value > high[x]) else high[x]
    for x in range(pixels(row.shape[0])):
        row[x] = min(max(row[x], low[x]), high[x]) if sharp[x] > ZERO else row[x]


@scalar
def any_wanted(wanted, y, first, end):
    """Whether a pixel of a part of a row is to be read."""
    found = False
    for x in range(first, end):
        found |= wanted[y, x]
    return found


@scalar
def leave_out(out, wanted, y, first, end):
    """No history for those pixels of a part of a row that are not to be read."""
    for c in range(out.shape[0]):
        for x in range(first, end):
            if not wanted[y, x]:
                out[c, y, x] = ZERO


@scalar
def read_row(
    out, marks, image, now, past, shift, plane, normal, search, sharp, columns, lines, places, rows, y, first, end
):
    """Read a history, and as marks the support of the footprint, then 1 if there is any history, or half if that is of
    what lies as deep alone.

    Plane after plane: pixel after pixel, the planes of common sizes would drive one another out of the cache.
    """
    weights, fine, total, lost, scratch = rows[:ALL], rows[ALL:-5], rows[-5], rows[-4], (rows[-3], rows[-2], rows[-1])
    channels, count = image.shape[0], pixels(total.shape[0])
    _footprints(columns, lines, fine, weights, shift[0], shift[1], y, first)
    total[:] = ZERO
    for k in range(INNER):
        if _any(weights[k]):
            keep_same(weights[k], places[k], scratch, now, past, columns, lines, k % 2, k // 2, plane, normal)
            for x in range(count):
                total[x] += weights[k, x]
    support, valid = marks[0, y, first:end], marks[1, y, first:end]
    for x in range(count):
        kept = total[x] > KEPT
        support[x], valid[x] = total[x] if kept else ZERO, ONE if kept else ZERO
        for k in range(INNER):
            weights[k, x] = weights[k, x] / total[x] if kept else ZERO
        total[x] = ONE if sharp and total[x] > WHOLE and (fine[0, x] > ZERO or fine[1, x] > ZERO) else ZERO
    finer = _any(total)
    if finer:
        _sharpen(weights, fine, total, lost, scratch, places, now, past, columns, lines, plane, normal)
    used = 0
    for k in range(ALL if finer else INNER):
        used |= (1 << k) if _any(weights[k]) else 0
    for c in range(channels):
        row = out[c, y, first:end]
        if finer:
            _sum_held(row, scratch, total, image[c], weights, places, used)
        else:
            _sum_taps(row, lost, image[c], weights, places, used)
    for x in range(count):
        if search > 0 and valid[x] == ZERO:
            column, line = np.float32(columns[x]) + fine[0, x], np.float32(lines[x]) + fine[1, x]
            found, near_row, near = nearest_same(now, past, x, line, column, plane, normal)
            valid[x] = ONE if found else ZERO
            if search > 1 and not found:
                found, near_row, near = nearest_same(now, past, x, line, column, plane, ANY_WAY)
                valid[x] = HALF if found else ZERO
            if found:
                for c in range(channels):
                    out[c, y, first + x] = image[c, near_row * past.width + near]
