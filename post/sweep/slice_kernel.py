"""Scalar forms shared by the compiled sweeps: one slice of a receiver, its sides and taps.

Names and steps are those of the torch reference in `post.sweep.slices` and `post.sweep.arcs`, which is the definition,
with branches where the reference multiplies by 0 or 1. All numbers are float32, as there: Python floats would turn
them into doubles, which round to other pixels and sectors.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from gbufrt.compute.kernel import scalar
from post.sweep import constants
from post.sweep.layout import Receivers, Side, Slice

BIAS, FIRST, SNAP = np.float32(constants.BIAS), np.float32(constants.FIRST), np.float32(constants.SNAP)
ZERO, HALF, ONE, TINY = np.float32(0), np.float32(0.5), np.float32(1), np.float32(1e-20)
QUARTER, HALF_TURN = np.float32(math.pi / 2), np.float32(math.pi)
FOLD = np.float32(math.tan(math.pi / 8))

Around = namedtuple("Around", "picture rays radii sky terms margin parallel")
"""What is the same for all receivers of a picture, see `post.sweep.op.sweep_cpu`."""
Tap = namedtuple("Tap", "front_rise front_run back_rise back_run z back_z x y i j")
"""See `arcs.Tap`; column and row in the picture in place of the further channels."""


@scalar
def atan2(y, x):
    """The angle of (x, y), to 2e-7: a library's scalar form would take most of a sweep's time.

    Source: S. L. Moshier, Cephes library, atanf: an odd polynomial up to the tangent of an eighth of pi; the addition
    theorem reduces larger tangents to that range.
    """
    across, along = abs(y), abs(x)
    small, large = min(across, along), max(across, along)
    folds = small > FOLD * large
    t = (small - large if folds else small) / max(small + large if folds else large, TINY)
    z = t * t
    value = ((np.float32(8.05374449538e-2) * z - np.float32(1.38776856032e-1)) * z + np.float32(1.99777106478e-1)) * z
    angle = t + t * z * (value - np.float32(3.33329491539e-1)) + (HALF * QUARTER if folds else ZERO)
    angle = QUARTER - angle if across > along else angle
    angle = HALF_TURN - angle if x < ZERO else angle
    return -angle if y < ZERO else angle


@scalar
def receiver_at(planes, aspect, b, y, x):
    """One of `slices.Receivers`."""
    one = planes[:, b, y, x]
    return Receivers(
        one[0], one[1], one[2], one[3], one[4], one[5], one[6], one[7], one[8], one[9], one[10], one[11], aspect
    )


@scalar
def dice_at(random, which, y, x):
    """See `slices.slice_noise`."""
    return random[which, y, x, 0], random[which, y, x, 1], random[which, y, x, 2], random[which, y, x, 3]


@scalar
def cut_slice(at, cos_psi, sin_psi):
    """See `slices.cut_slice`."""
    length = ONE / math.sqrt(ONE - at.vx * at.vx)
    ax, ay, az = (ONE - at.vx * at.vx) * length, -at.vx * at.vy * length, -at.vx * at.vz * length
    bx, by, bz = at.vy * az - at.vz * ay, at.vz * ax - at.vx * az, at.vx * ay - at.vy * ax
    tx, ty, tz = cos_psi * ax + sin_psi * bx, cos_psi * ay + sin_psi * by, cos_psi * az + sin_psi * bz
    slide = tz / at.vz
    across = at.nx * tx + at.ny * ty + at.nz * tz
    toward = at.nx * at.vx + at.ny * at.vy + at.nz * at.vz
    projected = math.sqrt(across * across + toward * toward)
    cos_n, sin_n = toward / projected, across / projected
    n = atan2(sin_n, cos_n)
    measure = cos_n + n * sin_n
    nx, ny, nz = at.nx / projected, at.ny / projected, at.nz / projected
    across_x, across_y = cos_n * tx - sin_n * at.vx, cos_n * ty - sin_n * at.vy
    across_z = cos_n * tz - sin_n * at.vz
    return Slice(
        nx=nx,
        ny=ny,
        nz=nz,
        hx=cos_n * at.vx + sin_n * tx,
        hy=cos_n * at.vy + sin_n * ty,
        hz=cos_n * at.vz + sin_n * tz,
        tx=across_x,
        ty=across_y,
        tz=across_z,
        level=at.x * nx + at.y * ny + at.z * (nz + BIAS),
        place=at.x * across_x + at.y * across_y + at.z * across_z,
        cos_n=cos_n,
        sin_n=sin_n,
        n=n,
        measure=measure,
        weight=projected * measure,
        step_x=(tx - slide * at.vx) * at.scale,
        step_y=(ty - slide * at.vy) * at.scale * at.aspect,
    )


@scalar
def side_of(around, at, cut, sign):
    """See `arcs.sides`: the right side for ``sign`` 1, the left one for -1."""
    length: Any = math.sqrt(cut.step_x * cut.step_x + cut.step_y * cut.step_y)
    dx, dy, half = sign * (cut.step_x / length), sign * (cut.step_y / length), HALF / cut.measure
    whole = (cut.cos_n + (cut.n + QUARTER) * cut.sin_n) * half
    frame, border = _border(around, around.margin + 1, at, dx, dy), _border(around, 1, at, dx, dy)
    other = Slice(
        cut.nx,
        cut.ny,
        cut.nz,
        cut.hx,
        cut.hy,
        cut.hz,
        sign * cut.tx,
        sign * cut.ty,
        sign * cut.tz,
        cut.level,
        sign * cut.place,
        cut.cos_n,
        sign * cut.sin_n,
        sign * cut.n,
        cut.measure,
        cut.weight,
        cut.step_x,
        cut.step_y,
    )
    return Side(other, dx, dy, length, frame, border, half, whole if sign > ZERO else ONE - whole)


@scalar
def _border(around, edge, at, dx, dy):
    """See `arcs._borders`."""
    height, width = around.picture.shape[:2]
    right, low = np.float32(width - edge) - HALF, np.float32(height - edge) - HALF
    first = np.float32(edge) - HALF
    x = max((right - at.column) * dx, (first - at.column) * dx) / max(dx * dx, np.float32(1e-12))
    y = max((low - at.row) * dy, (first - at.row) * dy) / max(dy * dy, np.float32(1e-12))
    return min(x, y)


@scalar
def _pixel(around, at, side, px):
    """Whole column and row ``px`` pixels from the receiver, and the same clamped to the picture."""
    column, row = np.rint(at.column + side.dx * px), np.rint(at.row + side.dy * px)
    i = min(max(np.int32(column), np.int32(0)), np.int32(around.picture.shape[1] - 1))
    j = min(max(np.int32(row), np.int32(0)), np.int32(around.picture.shape[0] - 1))
    return column, row, i, j


@scalar
def look(around, at, side, px):
    """See `arcs.look`."""
    cut, rays = side.cut, around.rays
    column, row, i, j = _pixel(around, at, side, px)
    z, solid = around.picture[j, i, 0], around.picture[j, i, 1]
    x, y = rays[0] + rays[2] * column, rays[1] + rays[3] * row
    rise, run = x * cut.nx + y * cut.ny, x * cut.tx + y * cut.ty
    if around.parallel:
        rise_by_z, run_by_z = cut.nz, cut.tz
        rise, run = rise + z * cut.nz - cut.level, run + z * cut.tz - cut.place
    else:
        rise_by_z, run_by_z = rise + cut.nz, run + cut.tz
        rise, run = z * rise_by_z - cut.level, z * run_by_z - cut.place
    return Tap(rise, run, rise + solid * rise_by_z, run + solid * run_by_z, z, z + solid, x, y, i, j)


@scalar
def arc_measure(rise, run, side):
    """See `arcs.arc_measure`."""
    if rise < ZERO:
        return side.whole
    cos_n, sin_n = side.cut.cos_n, side.cut.sin_n
    sine, cosine = run * cos_n + rise * sin_n, rise * cos_n - run * sin_n
    share = (run * sine / (rise * rise + run * run + TINY) + atan2(sine, cosine) * sin_n) * side.half
    return max(min(share + SNAP, side.whole), ZERO)


@scalar
def fill_spread(spread, jitter, beyond):
    """Shares of a side's reach at which its taps lie, see `slices.tap_pixels`; rounded once, as a power is."""
    for i in range(spread.shape[0]):
        t = np.float64((np.float32(i) + jitter) / np.float32(spread.shape[0]))
        spread[i] = t * t * math.sqrt(t) if beyond else t * math.sqrt(t)


@scalar
def leaves_hit(around, at, side):
    """See `open_sky.leaves_hit`."""
    _, _, i, j = _pixel(around, at, side, side.frame)
    return ONE if around.picture[j, i, 1] > ZERO else ZERO
