"""The compiled form of `post.history.reproject.correspondence_reference`: pixels of a row as a body.

Names and steps are those of the torch reference, which is the definition. Rows hold the pixels ``first`` to ``end``.
An id or a length that is not there is an empty picture.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.history import constants

ZERO, HALF, ONE, NEAREST = np.float32(0), np.float32(0.5), np.float32(1), np.float32(1e-9)
STILL, FARTHEST = np.float32(constants.STILL), np.float32(constants.FARTHEST)

Lens = namedtuple("Lens", "focal_x focal_y center_x center_y jitter_x jitter_y")
"""In pixels."""


Channels = namedtuple("Channels", "depth normal hit kind")
"""Of a G-buffer; ``kind``: the ids of objects."""


@scalar
def lens_at(values):
    """The lens of the six numbers of `Camera.lens`."""
    return Lens(values[0], values[1], values[2], values[3], values[4], values[5])


@scalar
def expected_row(out, surface, motion, motion_z, lens, before, pose, parallel, y, first, end):
    """What each pixel of a row expects of its surface in the previous frame, whose lens is ``before``."""
    depth, toward = surface.depth[y, first:end], motion_z[y, first:end]
    across, down = motion[0, y, first:end], motion[1, y, first:end]
    _identity_row(out, surface, pose, y, first, end)
    points_x, points_y = out[5, y, first:end], out[6, y, first:end]
    points_z, footprint = out[7, y, first:end], out[8, y, first:end]
    line = np.float32(y) + HALF + lens.jitter_y
    for x in range(depth.shape[0]):
        z = depth[x] + toward[x]
        column, row = np.float32(first + x) + HALF + lens.jitter_x + across[x], line + down[x]
        spread = ONE if parallel else z
        points_x[x] = (column - before.center_x) / before.focal_x * spread
        points_y[x] = (row - before.center_y) / before.focal_y * spread
        points_z[x] = z
        footprint[x] = ONE / before.focal_y if parallel else ONE / (before.focal_y / max(z, NEAREST))


@scalar
def actual_row(out, surface, length, lens, pose, parallel, y, first, end):
    """What the pixels of a row of the previous frame hold; where there is no history they match nothing."""
    depth = surface.depth[y, first:end]
    _identity_row(out, surface, pose, y, first, end)
    hit, points_x = out[3, y, first:end], out[5, y, first:end]
    points_y, points_z = out[6, y, first:end], out[7, y, first:end]
    if length.shape[0] > 0:
        known = length[y, first:end]
        for x in range(depth.shape[0]):
            hit[x] = hit[x] if known[x] > ZERO else -ONE
    ray_y = (np.float32(y) + HALF + lens.jitter_y - lens.center_y) / lens.focal_y
    for x in range(depth.shape[0]):
        spread = ONE if parallel else depth[x]
        points_x[x] = (np.float32(first + x) + HALF + lens.jitter_x - lens.center_x) / lens.focal_x * spread
        points_y[x] = ray_y * spread
        points_z[x] = depth[x]


@inlined
def _identity_row(out, surface, pose, y, first, end):
    """Normals in a view, whether there is a surface, and of which object."""
    a, b, c = surface.normal[0, y, first:end], surface.normal[1, y, first:end], surface.normal[2, y, first:end]
    for k in range(3):
        to_a, to_b, to_c, turned = pose[k, 0], pose[k, 1], pose[k, 2], out[k, y, first:end]
        for x in range(a.shape[0]):
            turned[x] = to_a * a[x] + to_b * b[x] + to_c * c[x]
    there, hit = surface.hit[y, first:end], out[3, y, first:end]
    for x in range(a.shape[0]):
        hit[x] = ONE if there[x] else ZERO
    kind, known = out[4, y, first:end], surface.kind.shape[0] > 0
    for x in range(a.shape[0]):
        kind[x] = surface.kind[y, first + x] if known else ZERO


@scalar
def shift_row(out, motion, y, first, end):
    """Where to look: what stands still but for rounding is read from one pixel, not from four."""
    for c in range(2):
        given, found = motion[c, y, first:end], out[c, y, first:end]
        for x in range(given.shape[0]):
            value = min(max(given[x] if given[x] == given[x] else ZERO, -FARTHEST), FARTHEST)
            whole = np.float32(math.floor(value + HALF))
            found[x] = whole if abs(value - whole) < STILL else value
