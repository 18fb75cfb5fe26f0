"""The compiled form of reading a history: one pixel of this frame as a scalar body.

Names and steps are those of `post.history.reproject` and `post.history.catmull_rom`, which are the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from post.history import constants

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
KEPT, WHOLE, FARTHEST = np.float32(constants.KEPT), np.float32(constants.WHOLE), np.float32(1e6)
HIT, OBJECT, POINT, FOOTPRINT = 3, 4, 5, 8


@scalar
def _same(now, before, b, y, x, row, column, plane, normal):
    """Whether a pixel of the previous frame shows the surface that this pixel expects."""
    if row < 0 or column < 0 or row >= before.shape[1] or column >= before.shape[2]:
        return False
    tap = before[b, row, column]
    if tap[HIT] != now[b, HIT, y, x] or tap[OBJECT] != now[b, OBJECT, y, x]:
        return False
    if now[b, HIT, y, x] == ZERO:
        return True
    distance, cosine = ZERO, ZERO
    for c in range(3):
        distance += now[b, c, y, x] * (tap[POINT + c] - now[b, POINT + c, y, x])
        cosine += now[b, c, y, x] * tap[c]
    return abs(distance) <= plane * now[b, FOOTPRINT, y, x] and cosine >= normal


@scalar
def _add(out, image, b, y, x, row, column, weight):
    """Add a weighted tap to a pixel."""
    tap = image[b, min(max(row, 0), image.shape[1] - 1), min(max(column, 0), image.shape[2] - 1)]
    for c in range(tap.shape[0]):
        out[b, c, y, x] += weight * tap[c]


@scalar
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
def _add_sharp(out, image, now, before, b, y, x, top, left, fy, fx, plane, normal):
    """Read sixteen taps; outer ones that are not on the surface give their share to the nearest of the four.

    The result is held between the least and the greatest tap read, because negative weights may ring.
    """
    used = 0
    for j in range(4):
        for i in range(4):
            weight, row, column = _spline(fy, j) * _spline(fx, i), j - 1, i - 1
            inner = 0 <= row <= 1 and 0 <= column <= 1
            if not inner and not _same(now, before, b, y, x, top + row, left + column, plane, normal):
                row, column = min(max(row, 0), 1), min(max(column, 0), 1)
            _add(out, image, b, y, x, top + row, left + column, weight)
            if weight != ZERO:
                used |= 1 << (4 * (row + 1) + column + 1)
    for c in range(image.shape[3]):
        low, high = np.float32(np.inf), np.float32(-np.inf)
        for k in range(16):
            if used & (1 << k):
                row, column = top + k // 4 - 1, left + k % 4 - 1
                value = image[b, min(max(row, 0), image.shape[1] - 1), min(max(column, 0), image.shape[2] - 1), c]
                low, high = min(low, value), max(high, value)
        out[b, c, y, x] = min(max(out[b, c, y, x], low), high)


@scalar
def _nearest(now, before, b, y, x, row_at, column_at, plane, normal):
    """The nearest of the 3x3 pixels that shows the surface: whether there is one, its row and column."""
    near_row, near_column = math.floor(row_at + HALF), math.floor(column_at + HALF)
    found, best, best_row, best_column = False, np.float32(np.inf), np.int64(0), np.int64(0)
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            row, column = np.int64(near_row) + dy, np.int64(near_column) + dx
            across, down = np.float32(column) - column_at, np.float32(row) - row_at
            distance = across * across + down * down
            if distance < best and _same(now, before, b, y, x, row, column, plane, normal):
                found, best, best_row, best_column = True, distance, row, column
    return found, best_row, best_column


@scalar
def read(index, out, image, now, before, shift, plane, normal, search, sharp):
    """Read a history at one pixel: its channels, then the support of the footprint, then 1 if there is any history."""
    _, channels, height, width = out.shape
    b, y, x = index // (height * width), index // width % height, index % width
    column_at = np.float32(x) + min(max(shift[b, 0, y, x], -FARTHEST), FARTHEST)
    row_at = np.float32(y) + min(max(shift[b, 1, y, x], -FARTHEST), FARTHEST)
    left, top = np.int64(math.floor(column_at)), np.int64(math.floor(row_at))
    fx, fy = column_at - np.float32(left), row_at - np.float32(top)
    plane, normal = np.float32(plane), np.float32(normal)
    total, used = ZERO, 0
    for k in range(4):
        if _same(now, before, b, y, x, top + k // 2, left + k % 2, plane, normal):
            total += (fx if k % 2 else ONE - fx) * (fy if k // 2 else ONE - fy)
            used |= 1 << k
    for c in range(channels):
        out[b, c, y, x] = ZERO
    if total > KEPT:
        out[b, channels - 2, y, x], out[b, channels - 1, y, x] = total, ONE
        if sharp and total > WHOLE:
            _add_sharp(out, image, now, before, b, y, x, top, left, fy, fx, plane, normal)
            return
        for k in range(4):
            if used & (1 << k):
                share = (fx if k % 2 else ONE - fx) * (fy if k // 2 else ONE - fy)
                _add(out, image, b, y, x, top + k // 2, left + k % 2, share / total)
    elif search:
        found, row, column = _nearest(now, before, b, y, x, row_at, column_at, plane, normal)
        if found:
            out[b, channels - 1, y, x] = ONE
            _add(out, image, b, y, x, row, column, ONE)
