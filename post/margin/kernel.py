"""The compiled form of `post.margin.op.scene`: pixels of a row of the padded picture.

Names and steps are those of `post.margin.reference`, which is the definition.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.margin import constants

ZERO, ONE = np.float32(0), np.float32(1)
LEAST_FACING = np.float32(constants.LEAST_FACING)


@inlined
def rotated(pose, normal, y, x):
    """A pixel's normal in view space."""
    a, b, c = normal[0, y, x], normal[1, y, x], normal[2, y, x]
    return (
        pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c,
        pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c,
        pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c,
    )


@inlined
def _continued(n, z, ray, beyond, parallel):
    """How much the plane through a border pixel faces the ray ``beyond`` it, and the depth where that meets it."""
    if parallel:
        level = n[0] * (ray[0] - beyond[0]) + n[1] * (ray[1] - beyond[1]) + n[2] * z
        facing = -n[2]
    else:
        level = n[0] * ray[0] * z + n[1] * ray[1] * z + n[2] * z
        facing = -(n[0] * beyond[0] + n[1] * beyond[1] + n[2])
    return facing, -level / max(facing, LEAST_FACING)


@scalar
def padded_row(out, depth, normal, reach, hit, light, lens, pose, margin, near, parallel, row, first, end):
    """Pixels ``first`` to ``end`` of a row of the padded picture, ``out`` ``(W', C)``, whose outermost are empty."""
    (height, width), edge = depth.shape, margin + 1
    y = min(max(row - edge, 0), height - 1)
    if row == 0 or row == height + 2 * edge - 1:
        out[first:end] = ZERO
        return
    for place in range(first, end):
        x = min(max(place - edge, 0), width - 1)
        if place == 0 or place == out.shape[0] - 1:
            out[place] = ZERO
            continue
        inner = x == place - edge and y == row - edge
        z, stands, n = depth[y, x], hit[y, x], (ZERO, ZERO, ZERO)
        if light.shape[0] > 0 or not inner:
            n = rotated(pose, normal, y, x)
        if stands and not inner:
            ray = lens[2] + np.float32(x) / lens[0], lens[3] + np.float32(y) / lens[1]
            beyond = lens[2] + np.float32(place - edge) / lens[0], lens[3] + np.float32(row - edge) / lens[1]
            facing, far = _continued(n, z, ray, beyond, parallel)
            stands, z = facing > LEAST_FACING and far > near, far
        out[place, 0], out[place, 1] = (z, reach[y, x]) if stands else (ZERO, ZERO)
        if light.shape[0] > 0:
            for c in range(3):
                out[place, 2 + c] = light[c, y, x] if inner and stands else ZERO
            out[place, 5], out[place, 6], out[place, 7] = n
