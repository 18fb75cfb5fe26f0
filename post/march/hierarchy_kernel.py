"""The compiled form of `post.march.rays.depth_hierarchy`: cells of the pyramid as scalar bodies.

Names and steps are those of `post.march.hierarchy`, which is the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.each import pixel_of
from gbufrt.compute.kernel import inlined, scalar
from post.march import constants
from post.margin.kernel import rotated

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
NOTHING, STEEPEST, GRAZING = map(np.float32, (constants.NOTHING, constants.STEEPEST, constants.GRAZING))
NEAREST, TINY = np.float32(constants.NEAREST), np.float32(constants.TINY)


@inlined
def _parallel(n, z, solid, side):
    """As `_perspective`, of an orthographic camera, where view rays go along view z."""
    steep = ONE / min(n[2], -STEEPEST)
    return -z, n[0] * steep * side[0], n[1] * steep * side[1], -z - solid, side[1]


@inlined
def _perspective(n, z, solid, measured, side, ray):
    """A pixel's nearness, its change per pixel in x and y, nearness of the back, and a pixel's side in nearness.

    ``solid`` reaches back along the view ray where it is ``measured``, else along view z; ``side`` is that of a pixel
    at depth 1.
    """
    length = math.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ONE)
    q = ONE / max(z, NEAREST)
    steep = q / min(n[0] * ray[0] + n[1] * ray[1] + n[2], -GRAZING * length)
    across, down = n[0] * steep * side[0], n[1] * steep * side[1]
    share = min(q / max(abs(across) + abs(down), TINY), ONE)
    back = ONE / max(z + (solid / length if measured else solid), NEAREST)
    return q, across * share, down * share, back, q * side[1]


@inlined
def _write(plane, q, across, down, back):
    plane[0], plane[1], plane[2], plane[3] = q, across, down, back


@scalar
def planes_cell(i, planes, pyramid, depth, normal, hit, thickness, assumed, lens, pose, orthographic):
    """The pixels of a cell of level 1, and the cell; see `post.march.op.hierarchy_cpu`."""
    height, width = depth.shape[1:]
    tall, wide = (height + 1) // 2, (width + 1) // 2
    b, row, column = pixel_of(i, tall, wide)
    measured, side = thickness.shape[1] > 0, (ONE / lens[b, 0], ONE / lens[b, 1])
    nearest, deepest = -NOTHING, NOTHING
    for y in range(2 * row, min(2 * row + 2, height)):
        ray_y = (np.float32(y) + HALF + lens[b, 5] - lens[b, 3]) * side[1]
        for x in range(2 * column, min(2 * column + 2, width)):
            if not hit[b, y, x]:
                _write(planes[b, y, x], -NOTHING, ZERO, ZERO, NOTHING)
                continue
            ray = (np.float32(x) + HALF + lens[b, 4] - lens[b, 2]) * side[0], ray_y
            n, z = rotated(pose[b], normal[b], y, x), depth[b, y, x]
            solid = thickness[b, 0, y, x] if measured else np.float32(assumed)
            if orthographic:
                q, across, down, back, pixel = _parallel(n, z, solid, side)
            else:
                q, across, down, back, pixel = _perspective(n, z, solid, measured, side, ray)
            reach = abs(across) + abs(down)
            back = min(back, q - reach - pixel)
            _write(planes[b, y, x], q, across, down, back)
            nearest, deepest = max(nearest, q + HALF * reach), min(deepest, back)
    cell = pyramid[b, row * wide + column]
    cell[0], cell[1] = nearest, deepest


@scalar
def coarser_cell(i, pyramid, first, height, width):
    """A cell of the level that comes after one which begins at ``first`` and has so many rows and columns."""
    tall, wide = (height + 1) // 2, (width + 1) // 2
    b, row, column = pixel_of(i, tall, wide)
    nearest, deepest = -NOTHING, NOTHING
    for y in range(2 * row, min(2 * row + 2, height)):
        for x in range(2 * column, min(2 * column + 2, width)):
            cell = pyramid[b, first + y * width + x]
            nearest, deepest = max(nearest, cell[0]), min(deepest, cell[1])
    cell = pyramid[b, first + height * width + row * wide + column]
    cell[0], cell[1] = nearest, deepest
