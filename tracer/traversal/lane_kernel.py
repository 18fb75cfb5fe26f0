"""Rays side by side, a lane each: the step of `tracer.traversal.grid_kernel` for all of them at once.

One ray is a chain of latencies: place, brick, voxel, next face. Many rays in lanes overlap them, and their arithmetic
becomes vector instructions: four times as fast. Rays of any kind fit, because a lane whose ray ends takes the next.

Each row of numbers has a constant place in one array, so that the compiler sees that no row overlaps another. Loops
that read voxels stay scalar, and do nothing else. See `post.sweep.lane_kernel`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, inlined, scalar
from tracer.scene.grids import INDEX, NY, NZ

LANES = 128  # more fill the first cache, fewer cost more calls
BATCH = 1024  # rays that share lanes
GROUP = 32  # instances that bits tell apart
GOES, MEETS, LEAVES = 0, 1, 2
"""What a step did: went on in the same medium, met another one, or left the grid or the ray's span."""


def _rows(first: int, end: int) -> range:
    """Where rows ``first`` to ``end`` begin."""
    return range(first * LANES, end * LANES, LANES)


# The ray in mirrored coordinates, in which it rises along every axis, with the reciprocal of its direction; where it
# is, and where it ends:
OX, OY, OZ, DX, DY, DZ, IX, IY, IZ, T, T_END = _rows(0, 11)
# where its medium began, and its light:
BEGAN, RED, GREEN, BLUE = _rows(11, 15)
NUMBERS = 15
# Its cell, the one beyond the grid, and what both are mirrored by, with exclusive or: -1 where the ray falls, else 0:
CX, CY, CZ, END_X, END_Y, END_Z, MIRROR_X, MIRROR_Y, MIRROR_Z = _rows(0, 9)
# its number, its medium, whether it began there, the axis of the face that it came through, what the step did, and
# whether it is still in the cell where it began:
RAY, MEDIUM, WITHIN, AXIS, DID, FIRST = _rows(9, 15)
# the id at its cell, and places of the brick and of the voxel:
VALUE, BRICK, VOXEL = _rows(15, 18)
WHOLES = 18

Lanes = namedtuple("Lanes", "numbers wholes next_numbers next_wholes idle ends near queue")
"""Scratch of one thread: rows of float64, and of int32, each beginning at a name above; the same of the rays that take
a lane next; lanes whose rays are done; of each ray of a batch where it ends and which entries it comes near, a bit
each; and the rays that go through an entry."""


@allocating
def new_lanes():
    """Scratch memory of one thread."""
    return Lanes(
        np.zeros(NUMBERS * LANES),
        np.zeros(WHOLES * LANES, np.int32),
        np.zeros(NUMBERS * LANES),
        np.zeros(WHOLES * LANES, np.int32),
        np.zeros(LANES, np.int32),
        np.zeros(BATCH),
        np.zeros(BATCH, np.int64),
        np.zeros(BATCH, np.int32),
    )


@inlined
def move(lanes, source, target):
    """Put the ray of one lane into another."""
    if source != target:
        for row in range(NUMBERS):
            lanes.numbers[row * LANES + target] = lanes.numbers[row * LANES + source]
        for row in range(WHOLES):
            lanes.wholes[row * LANES + target] = lanes.wholes[row * LANES + source]


@inlined
def _turned(lanes, x, axis, number):
    """A coordinate of a lane's ray, mirrored, or mirrored back."""
    return -number if lanes.wholes[MIRROR_X + axis * LANES + x] < 0 else number


@inlined
def ray_of(lanes, x):
    """Origin and direction of a lane's ray, in grid coordinates."""
    rows = lanes.numbers
    return (
        (_turned(lanes, x, 0, rows[OX + x]), _turned(lanes, x, 1, rows[OY + x]), _turned(lanes, x, 2, rows[OZ + x])),
        (_turned(lanes, x, 0, rows[DX + x]), _turned(lanes, x, 1, rows[DY + x]), _turned(lanes, x, 2, rows[DZ + x])),
    )


@inlined
def cell_of(lanes, x):
    """The cell of a lane's ray."""
    wholes = lanes.wholes
    return (
        wholes[CX + x] ^ wholes[MIRROR_X + x],
        wholes[CY + x] ^ wholes[MIRROR_Y + x],
        wholes[CZ + x] ^ wholes[MIRROR_Z + x],
    )


@inlined
def put_cell(lanes, x, c):
    """Put a lane's ray into a cell."""
    wholes = lanes.wholes
    wholes[CX + x], wholes[CY + x] = c[0] ^ wholes[MIRROR_X + x], c[1] ^ wholes[MIRROR_Y + x]
    wholes[CZ + x] = c[2] ^ wholes[MIRROR_Z + x]


@inlined
def _next(o, d, t, cell, last, through):
    """One coordinate of the cell after a cube left at ``t``; ``through``: by the face across this axis."""
    along = np.int32(min(max(np.int32(np.floor(o + d * t)), cell), last))
    return np.int32(last + 1) if through else along


@inlined
def _leave(lanes, x, side, around, stays):
    """Leave the cube around a lane's cell, unless the ray ``stays``.

    Its side is ``side`` + 1, and beyond it are ``around`` empty cells more. Without branches, because they would be
    unpredictable.
    """
    rows, wholes = lanes.numbers, lanes.wholes
    cx, cy, cz = wholes[CX + x], wholes[CY + x], wholes[CZ + x]
    ox, oy, oz = rows[OX + x], rows[OY + x], rows[OZ + x]
    last_x, last_y = np.int32((cx | side) + around), np.int32((cy | side) + around)
    last_z = np.int32((cz | side) + around)
    tx = (np.int32(last_x + 1) - ox) * rows[IX + x]
    ty = (np.int32(last_y + 1) - oy) * rows[IY + x]
    tz = (np.int32(last_z + 1) - oz) * rows[IZ + x]
    t = min(min(tx, ty), tz)
    by_x = tx == t
    by_y = (ty == t) & (not by_x)
    by_z = not (by_x | by_y)
    nx = _next(ox, rows[DX + x], t, cx, last_x, by_x)
    ny = _next(oy, rows[DY + x], t, cy, last_y, by_y)
    nz = _next(oz, rows[DZ + x], t, cz, last_z, by_z)
    goes = (nx < wholes[END_X + x]) & (ny < wholes[END_Y + x]) & (nz < wholes[END_Z + x]) & (t < rows[T_END + x])
    rows[T + x] = rows[T + x] if stays else t
    wholes[CX + x], wholes[CY + x], wholes[CZ + x] = cx if stays else nx, cy if stays else ny, cz if stays else nz
    axis = np.int32(1) if by_y else (np.int32(2) if by_z else np.int32(0))
    wholes[AXIS + x] = wholes[AXIS + x] if stays else axis
    wholes[FIRST + x] = wholes[FIRST + x] if stays else np.int32(0)
    wholes[DID + x] = np.int32(MEETS) if stays else (np.int32(GOES) if goes else np.int32(LEAVES))


@scalar
def pass_through(lanes, x):
    """Take one lane a voxel further, whatever it is in."""
    _leave(lanes, x, np.int32(0), np.int32(0), False)


@scalar
def advance(lanes, used, bricks, index, box):
    """Take the first ``used`` lanes through the uniform cubes that they are in, and tell in ``DID`` what they did.

    A ray that meets another medium than its own stays where it is.
    """
    wholes = lanes.wholes
    first, ny, nz = box[INDEX], box[NY], box[NZ]
    for x in range(used):
        bx, by = (wholes[CX + x] ^ wholes[MIRROR_X + x]) >> 4, (wholes[CY + x] ^ wholes[MIRROR_Y + x]) >> 4
        wholes[BRICK + x] = first + (bx * ny + by) * nz + ((wholes[CZ + x] ^ wholes[MIRROR_Z + x]) >> 4)
    for x in range(used):
        wholes[BRICK + x] = index[wholes[BRICK + x]]
    for x in range(used):
        vx, vy = (wholes[CX + x] ^ wholes[MIRROR_X + x]) & 15, (wholes[CY + x] ^ wholes[MIRROR_Y + x]) & 15
        inner = (vx << 8) + (vy << 4) + ((wholes[CZ + x] ^ wholes[MIRROR_Z + x]) & 15)
        wholes[VOXEL + x] = (max(wholes[BRICK + x], 0) << 12) + inner
    for x in range(used):
        wholes[VALUE + x] = bricks[wholes[VOXEL + x]]
    for x in range(used):
        brick, code = wholes[BRICK + x], wholes[VALUE + x]
        far = brick <= 0
        side = np.int32(15) if far else np.int32((1 << max(-code, 0)) - 1)
        around = np.int32((-brick - 1) << 4) if far else np.int32(0)
        value = np.int32(0) if far else np.int32(max(code, 0))
        wholes[VALUE + x] = value
        _leave(lanes, x, side, around, value != wholes[MEDIUM + x])
