"""Scratch memory of the compiled sweeps: receivers side by side, a lane each, and a row for each of their numbers.

A sweep runs the same steps for all lanes, so that the compiler turns each loop over lanes into vector instructions.
For that, every row has a constant place in one array: the compiler then sees that no row overlaps another. Three
things keep a loop scalar: a call of a function that is not `inlined`; a row whose place is not constant, which a slice
made before the loop avoids; and a choice between the numbers of two rows, which becomes a choice of a place. A loop
that reads pixels stays scalar in any case, and so is kept apart and does nothing else.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from gbufrt.noise.noise import GOLDEN
from post.sweep import slices
from post.sweep.layout import Receivers
from post.sweep.slice_kernel import turn

LANES = 256  # enough to spread the cost of a call and of reading what was just stored; all rows stay in a core's cache
BELOW_ONE = np.float32(slices.BELOW_ONE)
PAIRS = 4  # of numbers in the largest pixel that taps read

# Each name below is where a row begins. Receivers, and the noise of a slice:
COLUMN, ROW, AT_X, AT_Y, AT_Z, AT_NX, AT_NY, AT_NZ, VX, VY, VZ, SCALE = range(0, 12 * LANES, LANES)
SOLID, COS, SIN, JITTER, DITHER = range(12 * LANES, 17 * LANES, LANES)
# a slice, and what both of its sides share:
NX, NY, NZ, HX, HY, HZ, TX, TY, TZ, LEVEL, PLACE, COS_N, SIN_N = range(17 * LANES, 30 * LANES, LANES)
DX, DY, LENGTH, HALVED, RIGHT, LEFT, RIGHT_HIT, LEFT_HIT = range(30 * LANES, 38 * LANES, LANES)
# the side that is swept, and the tap before:
REACH, WHOLE, BEFORE, BEFORE_RISE, BEFORE_RUN = range(38 * LANES, 43 * LANES, LANES)
BEFORE_DISTANCE, BEFORE_Z, BEFORE_BACK_Z = range(43 * LANES, 46 * LANES, LANES)
# the tap:
TAP_X, TAP_Y, RISE, RUN, DISTANCE, Z, BACK_Z = range(46 * LANES, 53 * LANES, LANES)
FRONT, HIGH, LEAST, CROSSED = range(53 * LANES, 57 * LANES, LANES)
# what gathering adds, the plane of the tap before, whether the tap continues it, and light:
PLANE_X, PLANE_Y, PLANE_Z, PLANE_NX, PLANE_NY, PLANE_NZ, PLANE_COSINE = range(57 * LANES, 64 * LANES, LANES)
SAME, LIT, RED, GREEN, BLUE = range(64 * LANES, 69 * LANES, LANES)
# a group of sectors, and sums over the groups:
GROUP_RISE, GROUP_RUN, GROUP_OPEN, WHOLE_RISE, WHOLE_RUN = range(69 * LANES, 74 * LANES, LANES)
OPENED, OPEN_RISE, OPEN_RUN = range(74 * LANES, 77 * LANES, LANES)
ROWS = 77

Around = namedtuple("Around", "pixels width height aspect rays radii limited sky terms turns margin parallel")
"""What is the same for all receivers of a picture, see `post.sweep.op.sweep_cpu`."""
Lanes = namedtuple("Lanes", "rows parts index pairs pixel covered sums place")
"""Scratch of one thread: see `new_lanes`."""


@scalar
def new_lanes(radii, sums, steps):
    """Scratch memory of one thread.

    Its arrays hold the rows above, the taps' parts of their side's reach, the place of each lane's tap in the picture,
    the pixels found there (in pairs of numbers, and as single numbers), the sectors covered within each radius, the
    sums, and the place of each lane's receiver.
    """
    pairs = np.empty(PAIRS * LANES, np.int64)
    return Lanes(
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


@scalar
def fill_receivers(lanes, planes, around):
    """Read the receivers of all lanes, and how far the solids reach back there."""
    rows, place = lanes.rows, lanes.place
    for x in range(LANES):
        for k in range(planes.shape[0]):
            rows[k * LANES + x] = planes[k, place[x]]
        own = np.int64(rows[ROW + x]) * around.width + np.int64(rows[COLUMN + x])
        lanes.pairs[x] = around.pixels[own, 0]
        rows[SOLID + x] = lanes.pixel[2 * x + 1]


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
