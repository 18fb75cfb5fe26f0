"""The compiled form of reading a history: pixels ``first`` to ``end`` of a row of this frame as a body.

Names and steps are those of `post.history.reproject` and `post.history.catmull_rom`, which are the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.history import constants

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
KEPT, WHOLE, FARTHEST = np.float32(constants.KEPT), np.float32(constants.WHOLE), np.float32(constants.FARTHEST)
HIT, OBJECT, POINT, FOOTPRINT = 3, 4, 5, 8


@scalar
def _same(now, before, y, x, row, column, plane, normal):
    """Whether a pixel of the previous frame shows the surface that this pixel expects."""
    if row < 0 or column < 0 or row >= before.shape[1] or column >= before.shape[2]:
        return False
    if before[HIT, row, column] != now[HIT, y, x] or before[OBJECT, row, column] != now[OBJECT, y, x]:
        return False
    if now[HIT, y, x] == ZERO:
        return True
    distance, cosine = ZERO, ZERO
    for c in range(3):
        distance += now[c, y, x] * (before[POINT + c, row, column] - now[POINT + c, y, x])
        cosine += now[c, y, x] * before[c, row, column]
    return abs(distance) <= plane * now[FOOTPRINT, y, x] and cosine >= normal


@inlined
def _tap(image, c, row, column):
    """A number of the pixel, or of the nearest one of the picture."""
    return image[c, min(max(row, 0), image.shape[1] - 1), min(max(column, 0), image.shape[2] - 1)]


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
def _add_sharp(out, image, now, before, y, x, top, left, fy, fx, plane, normal):
    """Read sixteen taps; outer ones that are not on the surface give their share to the nearest of the four.

    The result is held between the least and the greatest tap read, because negative weights may ring.
    """
    channels, used = image.shape[0], 0
    for c in range(channels):
        out[c, y, x] = ZERO
    for j in range(4):
        for i in range(4):
            weight, row, column = _spline(fy, j) * _spline(fx, i), j - 1, i - 1
            if weight == ZERO:
                continue
            inner = 0 <= row <= 1 and 0 <= column <= 1
            if not inner and not _same(now, before, y, x, top + row, left + column, plane, normal):
                row, column = min(max(row, 0), 1), min(max(column, 0), 1)
            for c in range(channels):
                out[c, y, x] += weight * _tap(image, c, top + row, left + column)
            used |= 1 << (4 * (row + 1) + column + 1)
    for c in range(channels):
        low, high = np.float32(np.inf), np.float32(-np.inf)
        for k in range(16):
            if used & (1 << k):
                value = _tap(image, c, top + k // 4 - 1, left + k % 4 - 1)
                low, high = min(low, value), max(high, value)
        out[c, y, x] = min(max(out[c, y, x], low), high)


@scalar
def _nearest(now, before, y, x, row_at, column_at, plane, normal):
    """The nearest of the 3x3 pixels that shows the surface: whether there is one, its row and column."""
    near_row, near_column = math.floor(row_at + HALF), math.floor(column_at + HALF)
    found, best, best_row, best_column = False, np.float32(np.inf), np.int64(0), np.int64(0)
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            row, column = np.int64(near_row) + dy, np.int64(near_column) + dx
            across, down = np.float32(column) - column_at, np.float32(row) - row_at
            distance = across * across + down * down
            if distance < best and _same(now, before, y, x, row, column, plane, normal):
                found, best, best_row, best_column = True, distance, row, column
    return found, best_row, best_column


@scalar
def _footprints(columns, lines, fine, weights, across, down, y, first):
    """Where each pixel reads: the first pixel of its bilinear footprint, the place in it, and the shares."""
    for x in range(columns.shape[0]):
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
    for x in range(weights.shape[0]):
        most = max(most, weights[x])
    return most > ZERO


@scalar
def _keep_same(weights, places, distance, cosine, now, before, columns, lines, dx, dy, plane, normal, y, first, end):
    """Set to zero the shares of a tap that shows another surface; leave its place in the picture. See `_same`."""
    channels, height, width = before.shape
    there = before.reshape(channels, height * width)
    hit, kind, hit_there, kind_there = now[HIT, y, first:end], now[OBJECT, y, first:end], there[HIT], there[OBJECT]
    for x in range(weights.shape[0]):
        column, line = columns[x] + dx, lines[x] + dy
        inside = (column >= 0) & (column < width) & (line >= 0) & (line < height)
        places[x] = line * width + column if inside else 0
        weights[x] = weights[x] if inside else ZERO
    for x in range(weights.shape[0]):
        alike = (hit_there[places[x]] == hit[x]) & (kind_there[places[x]] == kind[x])
        weights[x] = weights[x] if alike else ZERO
        distance[x], cosine[x] = ZERO, ZERO
    for c in range(3):
        n, p, n_there, p_there = now[c, y, first:end], now[POINT + c, y, first:end], there[c], there[POINT + c]
        for x in range(weights.shape[0]):
            distance[x] += n[x] * (p_there[places[x]] - p[x])
            cosine[x] += n[x] * n_there[places[x]]
    footprint = now[FOOTPRINT, y, first:end]
    for x in range(weights.shape[0]):
        same = (abs(distance[x]) <= plane * footprint[x]) & (cosine[x] >= normal)
        weights[x] = weights[x] if same | (hit[x] == ZERO) else ZERO


@scalar
def _add_taps(out, image, weights, places, y, first, end):
    """Add one tap of every pixel."""
    channels, height, width = image.shape
    there = image.reshape(channels, height * width)
    for c in range(channels):
        row, picture = out[c, y, first:end], there[c]
        for x in range(weights.shape[0]):
            row[x] += weights[x] * picture[places[x]] if weights[x] > ZERO else ZERO


@scalar
def read_row(out, image, now, before, shift, plane, normal, search, sharp, columns, lines, places, rows, y, first, end):
    """Read a history: its channels, then the support of the footprint, then 1 if there is any history.

    Plane after plane: pixel after pixel, the planes of common sizes would drive one another out of the cache.
    """
    channels, count = image.shape[0], end - first
    weights, fine, distance, cosine, total = rows[:4], rows[4:6], rows[6], rows[7], rows[8]
    _footprints(columns, lines, fine, weights, shift[0, y, first:end], shift[1, y, first:end], y, first)
    total[:] = ZERO
    for k in range(4):
        if _any(weights[k]):
            row, tap = (columns, lines, k % 2, k // 2), (weights[k], places[k], distance, cosine)
            _keep_same(*tap, now, before, *row, plane, normal, y, first, end)
            for x in range(count):
                total[x] += weights[k, x]
    support, valid = out[channels, y, first:end], out[channels + 1, y, first:end]
    for x in range(count):
        kept = total[x] > KEPT
        support[x], valid[x] = total[x] if kept else ZERO, ONE if kept else ZERO
        for k in range(4):
            weights[k, x] = weights[k, x] / total[x] if kept else ZERO
    for c in range(channels):
        out[c, y, first:end] = ZERO
    for k in range(4):
        if _any(weights[k]):
            _add_taps(out, image, weights[k], places[k], y, first, end)
    for x in range(count):
        fx, fy = fine[0, x], fine[1, x]
        if search and valid[x] == ZERO:
            column, line = np.float32(columns[x]) + fx, np.float32(lines[x]) + fy
            found, near_row, near = _nearest(now, before, y, first + x, line, column, plane, normal)
            if found:
                valid[x] = ONE
                for c in range(channels):
                    out[c, y, first + x] = image[c, near_row, near]
        elif sharp and total[x] > WHOLE and (fx > ZERO or fy > ZERO):
            top, left = np.int64(lines[x]), np.int64(columns[x])
            _add_sharp(out, image, now, before, y, first + x, top, left, fy, fx, plane, normal)
