"""The compiled form of `post.history.reproject.correspondence_reference`: pixels of a row as a body.

Names and steps are those of the torch reference, which is the definition. Rows hold the pixels ``first`` to ``end`` and
nothing else. Of the previous frame only what is read is computed. An id or a length that is not there is an empty
picture.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.each import pixel_of, pixels
from gbufrt.compute.kernel import inlined, scalar
from post.history import constants

ZERO, HALF, ONE, NEAREST = np.float32(0), np.float32(0.5), np.float32(1), np.float32(1e-9)
SHORT = np.float32(1e-12)
STILL, FARTHEST, ANY_WAY = (np.float32(x) for x in (constants.STILL, constants.FARTHEST, constants.ANY_WAY))

Lens = namedtuple("Lens", "focal_x focal_y center_x center_y jitter_x jitter_y")
"""In pixels."""


Channels = namedtuple("Channels", "depth normal hit kind")
"""Of a G-buffer; ``kind``: the ids of objects."""

Past = namedtuple("Past", "depth normal hit kind length height width lens parallel")
"""The previous frame: planes, each row after row in one, and its camera. Normals are in world space; see `WORLD`."""

HIT, OBJECT, POINT, FOOTPRINT = 3, 4, 5, 8
WORLD = 9  # normals once more, in world space: cosines are the same there, and what is read needs no rotation
EXPECTED = 12  # rows of what a pixel expects


@scalar
def lens_at(values):
    """The lens of the six numbers of `Camera.lens`."""
    return Lens(values[0], values[1], values[2], values[3], values[4], values[5])


@inlined
def point_of(past, place, row, column):
    """Position of a pixel of the previous frame in its view."""
    return _point_at(past, past.depth[place], row, column)


@inlined
def _point_at(past, z, row, column):
    spread = ONE if past.parallel else z
    across = (np.float32(column) + HALF + past.lens.jitter_x - past.lens.center_x) / past.lens.focal_x
    down = (np.float32(row) + HALF + past.lens.jitter_y - past.lens.center_y) / past.lens.focal_y
    return across * spread, down * spread, z


@scalar
def expected_row(out, surface, motion, motion_z, lens, before, pose, parallel, y, first, end):
    """What each pixel of a row expects of its surface in the previous frame, whose lens is ``before``."""
    depth, toward = surface.depth[y, first:end], motion_z[y, first:end]
    across, down = motion[0, y, first:end], motion[1, y, first:end]
    _identity_row(out, surface, pose, y, first, end)
    points_x, points_y, points_z, footprint = out[POINT], out[POINT + 1], out[POINT + 2], out[FOOTPRINT]
    line = np.float32(y) + HALF + lens.jitter_y
    for x in range(pixels(depth.shape[0])):
        z = depth[x] + toward[x]
        column, row = np.float32(first + x) + HALF + lens.jitter_x + across[x], line + down[x]
        spread = ONE if parallel else z
        points_x[x] = (column - before.center_x) / before.focal_x * spread
        points_y[x] = (row - before.center_y) / before.focal_y * spread
        points_z[x] = z
        footprint[x] = ONE / before.focal_y if parallel else ONE / (before.focal_y / max(z, NEAREST))


@scalar
def image_motion(i, out, depth, distance, lenses, moves, parallel, was_parallel):
    """One pixel of `post.history.virtual.virtual_motion`; ``moves``: from this view to the one before."""
    height, width = depth.shape[2:]
    b, y, x = pixel_of(i, height, width)
    lens, before, move, z = lens_at(lenses[b, 0]), lens_at(lenses[b, 1]), moves[b], depth[b, 0, y, x]
    column, row = np.float32(x) + HALF + lens.jitter_x, np.float32(y) + HALF + lens.jitter_y
    spread, beyond = ONE if parallel else z, distance[b, 0, y, x]
    across, down = (column - lens.center_x) / lens.focal_x * spread, (row - lens.center_y) / lens.focal_y * spread
    if parallel:
        z += beyond
    else:
        longer = ONE + beyond / max(math.sqrt(across * across + down * down + z * z), SHORT)
        across, down, z = across * longer, down * longer, z * longer
    there = move[2, 0] * across + move[2, 1] * down + move[2, 2] * z + move[2, 3]
    spread = ONE if was_parallel else max(there, NEAREST)
    there = move[0, 0] * across + move[0, 1] * down + move[0, 2] * z + move[0, 3]
    out[b, 0, y, x] = there / spread * before.focal_x + before.center_x - column
    there = move[1, 0] * across + move[1, 1] * down + move[1, 2] * z + move[1, 3]
    out[b, 1, y, x] = there / spread * before.focal_y + before.center_y - row


@scalar
def closer(i, out, one, other, signal, where):
    """One pixel of `post.history.virtual.closer`."""
    channels, height, width = signal.shape[1:]
    b, y, x = pixel_of(i, height, width)
    first = second = ZERO
    if where[b, 0, y, x]:
        for c in range(channels):
            for row in range(max(y - 1, 0), min(y + 2, height)):
                for column in range(max(x - 1, 0), min(x + 2, width)):
                    wanted = signal[b, c, row, column]
                    first += abs(one[b, c, row, column] - wanted)
                    second += abs(other[b, c, row, column] - wanted)
    out[b, 0, y, x] = second < first


@inlined
def _identity_row(out, surface, pose, y, first, end):
    """Normals in the previous view and in the world, whether there is a surface, and of which object."""
    a, b, c = surface.normal[0, y, first:end], surface.normal[1, y, first:end], surface.normal[2, y, first:end]
    for k in range(3):
        to_a, to_b, to_c, turned = pose[k, 0], pose[k, 1], pose[k, 2], out[k]
        given, kept = surface.normal[k, y, first:end], out[WORLD + k]
        for x in range(pixels(a.shape[0])):
            turned[x] = to_a * a[x] + to_b * b[x] + to_c * c[x]
            kept[x] = given[x]
    there, hit = surface.hit[y, first:end], out[HIT]
    for x in range(pixels(a.shape[0])):
        hit[x] = ONE if there[x] else ZERO
    kind, known = out[OBJECT], surface.kind.shape[0] > 0
    for x in range(pixels(a.shape[0])):
        kind[x] = surface.kind[y, first + x] if known else ZERO


@scalar
def shift_row(out, motion, y, first, end):
    """Where to look: what stands still but for rounding is read from one pixel, not from four."""
    for c in range(2):
        given, found = motion[c, y, first:end], out[c]
        for x in range(pixels(given.shape[0])):
            value = min(max(given[x] if given[x] == given[x] else ZERO, -FARTHEST), FARTHEST)
            whole = np.float32(math.floor(value + HALF))
            found[x] = whole if abs(value - whole) < STILL else value


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


@scalar
def nearest_same(now, past, x, row_at, column_at, plane, normal):
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
def keep_same(weights, places, scratch, now, past, columns, lines, dx, dy, plane, normal):
    """Set to zero the shares of a tap that shows another surface; leave its place in the picture. See `_same`.

    What is gathered goes to scratch first: a loop that gathers and computes is not vectorised.
    """
    hit, kind, count = now[HIT], now[OBJECT], pixels(weights.shape[0])
    values, distance, cosine = scratch
    for x in range(count):
        column, line = columns[x] + dx, lines[x] + dy
        inside = (column >= 0) & (column < past.width) & (line >= 0) & (line < past.height)
        places[x] = line * past.width + column if inside else 0
        weights[x] = weights[x] if inside else ZERO
    for x in range(count):
        weights[x] = weights[x] if past.hit[places[x]] == (hit[x] > ZERO) else ZERO
    if past.length.shape[0] > 0:
        gathered(values, past.length, places)
        for x in range(count):
            weights[x] = weights[x] if values[x] > ZERO else ZERO
    if past.kind.shape[0] > 0:
        gathered(values, past.kind, places)
        for x in range(count):
            weights[x] = weights[x] if values[x] == kind[x] else ZERO
    gathered(distance, past.depth, places)
    _distances(distance, now, past, columns, lines, dx, dy)
    cosine[:] = ZERO
    for c in range(3):
        gathered(values, past.normal[c], places)
        n = now[WORLD + c]
        for x in range(count):
            cosine[x] += n[x] * values[x]
    footprint = now[FOOTPRINT]
    for x in range(count):
        same = (abs(distance[x]) <= plane * footprint[x]) & (cosine[x] >= normal)
        weights[x] = weights[x] if same | (hit[x] == ZERO) else ZERO


@inlined
def gathered(values, picture, places):
    """Fill scratch from places of a picture."""
    for x in range(pixels(values.shape[0])):
        values[x] = picture[places[x]]


@inlined
def _distances(distance, now, past, columns, lines, dx, dy):
    """From the depth of each tap: how far it lies from the plane of the pixel that reads it."""
    n_x, n_y, n_z = now[0], now[1], now[2]
    p_x, p_y, p_z = now[POINT], now[POINT + 1], now[POINT + 2]
    for x in range(pixels(distance.shape[0])):
        across, down, away = _point_at(past, distance[x], lines[x] + dy, columns[x] + dx)
        distance[x] = n_x[x] * (across - p_x[x]) + n_y[x] * (down - p_y[x]) + n_z[x] * (away - p_z[x])
