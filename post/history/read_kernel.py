"""The compiled form of reading a history: pixels ``first`` to ``end`` of a row of this frame as a body.

Names and steps are those of `post.history.reproject` and `post.history.catmull_rom`, which are the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import inlined, scalar
from post.history import constants
from post.history.correspondence_kernel import FOOTPRINT, HIT, OBJECT, POINT, WORLD, point_of

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
ANY_WAY = np.float32(constants.ANY_WAY)
KEPT, WHOLE, FARTHEST = np.float32(constants.KEPT), np.float32(constants.WHOLE), np.float32(constants.FARTHEST)


@scalar
def _same(now, past, x, row, column, plane, normal):
    """Whether a pixel of the previous frame shows the surface that pixel ``x`` of the row expects."""
    if row < 0 or column < 0 or row >= past.height or column >= past.width:
        return False
    place, hit = row * past.width + column, now[HIT, x] > ZERO
    if past.hit[place] != hit or (past.length.shape[0] > 0 and not past.length[place] > ZERO):
        return False
    if past.kind.shape[0] > 0 and np.float32(past.kind[place]) != now[OBJECT, x]:
        return False
    if not hit:
        return True
    across, down, away = point_of(past, place, row, column)
    if normal <= ANY_WAY:
        return abs(away - now[POINT + 2, x]) <= plane * now[FOOTPRINT, x]
    distance = now[0, x] * (across - now[POINT, x]) + now[1, x] * (down - now[POINT + 1, x])
    distance += now[2, x] * (away - now[POINT + 2, x])
    cosine = ZERO
    for c in range(3):
        cosine += now[WORLD + c, x] * past.normal[c, place]
    return abs(distance) <= plane * now[FOOTPRINT, x] and cosine >= normal


@inlined
def _tap(plane, past, row, column):
    """A number of the pixel, or of the nearest one of the picture."""
    return plane[min(max(row, 0), past.height - 1) * past.width + min(max(column, 0), past.width - 1)]


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
def _add_sharp(out, image, now, past, y, first, x, top, left, fy, fx, plane, normal):
    """Read sixteen taps; outer ones that are not on the surface give their share to the nearest of the four.

    The result is held between the least and the greatest tap read, because negative weights may ring.
    """
    channels, used = image.shape[0], 0
    for c in range(channels):
        out[c, y, first + x] = ZERO
    for j in range(4):
        for i in range(4):
            weight, row, column = _spline(fy, j) * _spline(fx, i), j - 1, i - 1
            if weight == ZERO:
                continue
            inner = 0 <= row <= 1 and 0 <= column <= 1
            if not inner and not _same(now, past, x, top + row, left + column, plane, normal):
                row, column = min(max(row, 0), 1), min(max(column, 0), 1)
            for c in range(channels):
                out[c, y, first + x] += weight * _tap(image[c], past, top + row, left + column)
            used |= 1 << (4 * (row + 1) + column + 1)
    for c in range(channels):
        low, high = np.float32(np.inf), np.float32(-np.inf)
        for k in range(16):
            if used & (1 << k):
                value = _tap(image[c], past, top + k // 4 - 1, left + k % 4 - 1)
                low, high = min(low, value), max(high, value)
        out[c, y, first + x] = min(max(out[c, y, first + x], low), high)


@scalar
def _nearest(now, past, x, row_at, column_at, plane, normal):
    """The nearest of the 3x3 pixels that shows the surface: whether there is one, its row and column."""
    near_row, near_column = math.floor(row_at + HALF), math.floor(column_at + HALF)
    found, best, best_row, best_column = False, np.float32(np.inf), np.int64(0), np.int64(0)
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            row, column = np.int64(near_row) + dy, np.int64(near_column) + dx
            across, down = np.float32(column) - column_at, np.float32(row) - row_at
            distance = across * across + down * down
            if distance < best and _same(now, past, x, row, column, plane, normal):
                found, best, best_row, best_column = True, distance, row, column
    return found, best_row, best_column


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
        most = max(most, weights[x])
    return most > ZERO


@scalar
def _keep_same(weights, places, distance, cosine, now, past, columns, lines, dx, dy, plane, normal):
    """Set to zero the shares of a tap that shows another surface; leave its place in the picture. See `_same`."""
    hit, kind, count = now[HIT], now[OBJECT], pixels(weights.shape[0])
    for x in range(count):
        column, line = columns[x] + dx, lines[x] + dy
        inside = (column >= 0) & (column < past.width) & (line >= 0) & (line < past.height)
        places[x] = line * past.width + column if inside else 0
        weights[x] = weights[x] if inside else ZERO
    for x in range(count):
        weights[x] = weights[x] if past.hit[places[x]] == (hit[x] > ZERO) else ZERO
    if past.length.shape[0] > 0:
        for x in range(count):
            weights[x] = weights[x] if past.length[places[x]] > ZERO else ZERO
    if past.kind.shape[0] > 0:
        for x in range(count):
            weights[x] = weights[x] if np.float32(past.kind[places[x]]) == kind[x] else ZERO
    _distances(distance, now, past, places, columns, lines, dx, dy)
    cosine[:] = ZERO
    for c in range(3):
        n, there = now[WORLD + c], past.normal[c]
        for x in range(count):
            cosine[x] += n[x] * there[places[x]]
    footprint = now[FOOTPRINT]
    for x in range(count):
        same = (abs(distance[x]) <= plane * footprint[x]) & (cosine[x] >= normal)
        weights[x] = weights[x] if same | (hit[x] == ZERO) else ZERO


@inlined
def _distances(distance, now, past, places, columns, lines, dx, dy):
    """How far each tap lies from the plane of the pixel that reads it."""
    n_x, n_y, n_z = now[0], now[1], now[2]
    p_x, p_y, p_z = now[POINT], now[POINT + 1], now[POINT + 2]
    for x in range(pixels(distance.shape[0])):
        across, down, away = point_of(past, places[x], lines[x] + dy, columns[x] + dx)
        distance[x] = n_x[x] * (across - p_x[x]) + n_y[x] * (down - p_y[x]) + n_z[x] * (away - p_z[x])


@scalar
def _add_taps(out, image, weights, places, y, first, end):
    """Add one tap of every pixel."""
    for c in range(image.shape[0]):
        row, picture = out[c, y, first:end], image[c]
        for x in range(pixels(weights.shape[0])):
            row[x] += weights[x] * picture[places[x]] if weights[x] > ZERO else ZERO


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
def read_row(out, image, now, past, shift, plane, normal, search, sharp, columns, lines, places, rows, y, first, end):
    """Read a history: its channels, then the support of the footprint, then 1 if there is any history, or half if that
    is of what lies as deep alone.

    Plane after plane: pixel after pixel, the planes of common sizes would drive one another out of the cache.
    """
    weights, fine, distance, cosine, total = rows[:4], rows[4:6], rows[6], rows[7], rows[8]
    channels, count = image.shape[0], pixels(total.shape[0])
    _footprints(columns, lines, fine, weights, shift[0], shift[1], y, first)
    total[:] = ZERO
    for k in range(4):
        if _any(weights[k]):
            row, tap = (columns, lines, k % 2, k // 2), (weights[k], places[k], distance, cosine)
            _keep_same(*tap, now, past, *row, plane, normal)
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
        if search > 0 and valid[x] == ZERO:
            column, line = np.float32(columns[x]) + fx, np.float32(lines[x]) + fy
            found, near_row, near = _nearest(now, past, x, line, column, plane, normal)
            valid[x] = ONE if found else ZERO
            if search > 1 and not found:
                found, near_row, near = _nearest(now, past, x, line, column, plane, ANY_WAY)
                valid[x] = HALF if found else ZERO
            if found:
                for c in range(channels):
                    out[c, y, first + x] = image[c, near_row * past.width + near]
        elif sharp and total[x] > WHOLE and (fx > ZERO or fy > ZERO):
            top, left = np.int64(lines[x]), np.int64(columns[x])
            _add_sharp(out, image, now, past, y, first, x, top, left, fy, fx, plane, normal)
