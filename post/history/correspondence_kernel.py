"""The compiled form of `post.history.reproject.correspondence_reference`: pixels of a row as a body.

Names and steps are those of the torch reference, which is the definition. Rows hold the pixels ``first`` to ``end`` and
nothing else. Of the previous frame only what is read is computed. An id or a length that is not there is an empty
picture.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import inlined, scalar
from post.history import constants

ZERO, HALF, ONE, NEAREST = np.float32(0), np.float32(0.5), np.float32(1), np.float32(1e-9)
STILL, FARTHEST = np.float32(constants.STILL), np.float32(constants.FARTHEST)

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
    z = past.depth[place]
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
