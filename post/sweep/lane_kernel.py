"""Scratch memory of the compiled sweeps: receivers side by side, a lane each, and a row for each of their numbers.

A GPU has one lane a thread, so that each row is a number there: see `gbufrt.compute.bodies.Lanes`. On the CPU a
sweep runs the same steps for all lanes, so that the compiler turns each loop over lanes into vector instructions.
For that, every row has a constant place in one array: the compiler then sees that no row overlaps another. Three
things keep a loop scalar: a call of a function that is not `inlined`; a row whose place is not constant, which a slice
made before the loop avoids; and a choice between the numbers of two rows, which becomes a choice of a place. A loop
that reads pixels stays scalar in any case, and so is kept apart and does nothing else.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.each import parted
from gbufrt.compute.kernel import WIDTH, Lanes, allocating, inlined, scalar
from gbufrt.noise.noise import GOLDEN
from post.sweep import constants, slices
from post.sweep.constants import FOUND, SUMS
from post.sweep.layout import Receivers
from post.sweep.slice_kernel import turn

LANES = WIDTH
BELOW_ONE = np.float32(slices.BELOW_ONE)
ZERO, HALF, ONE, TWO_THIRDS, NEAREST = (np.float32(number) for number in (0, 0.5, 1, 2 / 3, 1e-9))
MIN_FACING, VANISHED = np.float32(constants.MIN_FACING), np.float32(constants.VANISHED)
PAIRS = 4  # of numbers in the largest pixel that taps read


def _rows(first: int, end: int) -> map[Lanes]:
    """Where rows ``first`` to ``end`` begin."""
    return map(Lanes, range(first * LANES, end * LANES, LANES))


# Each name below is where a row begins. Receivers, and the noise of a slice:
COLUMN, ROW, AT_X, AT_Y, AT_Z, AT_NX, AT_NY, AT_NZ, VX, VY, VZ, SCALE = _rows(0, 12)
SOLID, COS, SIN, JITTER, DITHER = _rows(12, 17)
# a slice, and what both of its sides share:
NX, NY, NZ, HX, HY, HZ, TX, TY, TZ, LEVEL, PLACE, COS_N, SIN_N = _rows(17, 30)
DX, DY, LENGTH, HALVED, RIGHT, LEFT, RIGHT_HIT, LEFT_HIT = _rows(30, 38)
# the side that is swept, and the tap before:
REACH, WHOLE, BEFORE, BEFORE_RISE, BEFORE_RUN = _rows(38, 43)
BEFORE_DISTANCE, BEFORE_Z, BEFORE_BACK_Z = _rows(43, 46)
# the tap:
TAP_X, TAP_Y, RISE, RUN, DISTANCE, Z, BACK_Z = _rows(46, 53)
FRONT, HIGH, LEAST, CROSSED = _rows(53, 57)
# what gathering adds, the plane of the tap before, whether the tap continues it, and light:
PLANE_X, PLANE_Y, PLANE_Z, PLANE_NX, PLANE_NY, PLANE_NZ, PLANE_COSINE = _rows(57, 64)
SAME, LIT, RED, GREEN, BLUE = _rows(64, 69)
# a group of sectors, and sums over the groups:
GROUP_RISE, GROUP_RUN, GROUP_OPEN, WHOLE_RISE, WHOLE_RUN = _rows(69, 74)
OPENED, OPEN_RISE, OPEN_RUN = _rows(74, 77)
ROWS = 77

Around = namedtuple("Around", "pixels wide tall left_out aspect rays radii limited sky terms turns margin parallel")
"""What is the same for all receivers of a picture, see `post.sweep.op.sweep_cpu`; ``wide`` by ``tall`` are stored, of
a margin that has ``left_out`` pixels more, see `post.margin.view`."""
Grid = namedtuple("Grid", "depth normal lens pose columns stride row column")
"""A picture's surfaces, its camera, and which pixels receive: ``columns`` a row, every ``stride``-th from the first."""
Scratch = namedtuple("Scratch", "rows parts spot pairs pixel covered sums place")
"""Scratch of one thread: see `new_lanes`."""


@allocating
def new_lanes(radii, sums, steps):
    """Scratch memory of one thread.

    Its arrays hold the rows above, the taps' parts of their side's reach, the place of each lane's tap in the picture,
    the pixels found there (in pairs of numbers, and as single numbers), the sectors covered within each radius, the
    sums, and the place of each lane's receiver.
    """
    pairs = np.empty(PAIRS * LANES, np.int64)
    return Scratch(
        np.zeros(ROWS * LANES, np.float32),
        np.empty(steps * LANES, np.float32),
        np.empty(LANES, np.uint32),
        pairs,
        pairs.view(np.float32),
        np.empty(radii * LANES, np.int32),
        np.empty(radii * sums * LANES, np.float32),
        np.empty(LANES, np.int64),
    )


@inlined
def receiver_of(rows, aspect, x):
    """One lane's `layout.Receivers`."""
    return Receivers(
        rows[COLUMN + x],
        rows[ROW + x],
        rows[AT_X + x],
        rows[AT_Y + x],
        rows[AT_Z + x],
        rows[AT_NX + x],
        rows[AT_NY + x],
        rows[AT_NZ + x],
        rows[VX + x],
        rows[VY + x],
        rows[VZ + x],
        rows[SCALE + x],
        aspect,
    )


@inlined
def keep_slice(rows, cut, x):
    """Store what later steps need of a `layout.Slice`."""
    rows[NX + x], rows[NY + x], rows[NZ + x] = cut.nx, cut.ny, cut.nz
    rows[HX + x], rows[HY + x], rows[HZ + x] = cut.hx, cut.hy, cut.hz
    rows[TX + x], rows[TY + x], rows[TZ + x] = cut.tx, cut.ty, cut.tz
    rows[LEVEL + x], rows[PLACE + x] = cut.level, cut.place
    rows[COS_N + x], rows[SIN_N + x] = cut.cos_n, cut.sin_n


@inlined
def _pixel(grid, place):
    """Row and column in the picture of a receiver."""
    line, column = parted(place, grid.columns)
    return line * grid.stride + grid.row, column * grid.stride + grid.column


@scalar
def fill_receivers(lanes, around, grid):
    """Make the receivers of all lanes, see `slices.receivers`, and how far the solids reach back there."""
    rows, place, edge = lanes.rows, lanes.place, np.int64(around.margin + 1)
    first = edge - around.left_out
    for x in range(LANES):
        line, column = _pixel(grid, place[x])
        rows[ROW + x], rows[COLUMN + x] = np.float32(line + edge), np.float32(column + edge)
        rows[AT_Z + x] = grid.depth[line, column]
        rows[AT_NX + x], rows[AT_NY + x] = grid.normal[0, line, column], grid.normal[1, line, column]
        rows[AT_NZ + x] = grid.normal[2, line, column]
        lanes.pairs[x] = around.pixels[(line + first) * around.wide + column + first, 0]
    lens, edge_px = grid.lens, np.float32(edge)
    focal_x, focal_y, center_x, center_y, jitter_x, jitter_y = lens[0], lens[1], lens[2], lens[3], lens[4], lens[5]
    xx, xy, xz = grid.pose[0, 0], grid.pose[0, 1], grid.pose[0, 2]
    yx, yy, yz = grid.pose[1, 0], grid.pose[1, 1], grid.pose[1, 2]
    zx, zy, zz = grid.pose[2, 0], grid.pose[2, 1], grid.pose[2, 2]
    for x in range(LANES):
        ray_x = (rows[COLUMN + x] - edge_px + HALF + jitter_x - center_x) / focal_x
        ray_y = (rows[ROW + x] - edge_px + HALF + jitter_y - center_y) / focal_y
        z, spread = rows[AT_Z + x], ONE if around.parallel else rows[AT_Z + x]
        rows[AT_X + x], rows[AT_Y + x] = ray_x * spread, ray_y * spread
        near = ZERO if around.parallel else ONE / math.sqrt(ray_x * ray_x + ray_y * ray_y + ONE)
        vx, vy, vz = -ray_x * near, -ray_y * near, -ONE if around.parallel else -near
        a, b, c = rows[AT_NX + x], rows[AT_NY + x], rows[AT_NZ + x]
        nx, ny, nz = xx * a + xy * b + xz * c, yx * a + yy * b + yz * c, zx * a + zy * b + zz * c
        lift = max(MIN_FACING - (nx * vx + ny * vy + nz * vz), ZERO)
        nx, ny, nz = nx + vx * lift, ny + vy * lift, nz + vz * lift
        scale = ONE / math.sqrt(nx * nx + ny * ny + nz * nz)
        rows[AT_NX + x], rows[AT_NY + x], rows[AT_NZ + x] = nx * scale, ny * scale, nz * scale
        rows[VX + x], rows[VY + x], rows[VZ + x] = vx, vy, vz
        rows[SCALE + x] = focal_x if around.parallel else focal_x / max(z, NEAREST)
        rows[SOLID + x] = lanes.pixel[2 * x + 1]


@scalar
def finish(lanes, sums, grid):
    """Turn the sums of one radius into visibility and bent normal, see `arcs.finish`; of light, into its mean."""
    rows, light = lanes.rows, sums.shape[0] // LANES - SUMS
    pose, place = grid.pose, lanes.place
    for x in range(LANES):
        scale = ONE / sums[x]
        share = min(max(sums[LANES + x] * scale, ZERO), ONE)
        known = TWO_THIRDS * share
        a = (sums[2 * LANES + x] - share * sums[5 * LANES + x]) * scale + known * rows[AT_NX + x]
        b = (sums[3 * LANES + x] - share * sums[6 * LANES + x]) * scale + known * rows[AT_NY + x]
        c = (sums[4 * LANES + x] - share * sums[7 * LANES + x]) * scale + known * rows[AT_NZ + x]
        square = a * a + b * b + c * c
        shorten = ONE / math.sqrt(max(square, VANISHED))
        sums[x] = share
        for k in range(3):
            sums[(1 + k) * LANES + x] = (pose[0, k] * a + pose[1, k] * b + pose[2, k] * c) * shorten
        if square <= VANISHED:
            line, column = _pixel(grid, place[x])
            for k in range(3):
                sums[(1 + k) * LANES + x] = grid.normal[k, line, column]
        for k in range(light):
            sums[(FOUND + k) * LANES + x] = sums[(SUMS + k) * LANES + x] * scale


@scalar
def fill_noise(lanes, around, noise, which, directions):
    """Read the noise of slice ``which`` for all lanes, see `slices.slice_noise`."""
    rows, shift, place = lanes.rows, np.float32(which * GOLDEN), lanes.place
    for x in range(LANES):
        k = place[x]
        share = (noise[0, k] + np.float32(which)) / np.float32(directions)
        rows[COS + x], rows[SIN + x] = turn(receiver_of(rows, around.aspect, x), share, around.turns)
        rows[JITTER + x], rows[DITHER + x] = noise[1, k] + shift, noise[2, k] + shift
    for x in range(LANES):
        rows[JITTER + x] -= np.floor(rows[JITTER + x])
        rows[DITHER + x] = (rows[DITHER + x] - np.floor(rows[DITHER + x])) * BELOW_ONE
