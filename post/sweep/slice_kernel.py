"""Scalar forms shared by the compiled sweeps: one slice of a receiver, its sides, and the measure of its arc.

Names and steps are those of the torch reference in `post.sweep.slices` and `post.sweep.arcs`, which is the definition,
with selections where the reference multiplies by 0 or 1. All numbers are float32, as there: Python floats would turn
them into doubles, which round to other pixels and sectors.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.approximations import QUARTER, atan2
from gbufrt.compute.kernel import inlined
from post.sweep import constants
from post.sweep.layout import Slice

BIAS, FIRST, SNAP = np.float32(constants.BIAS), np.float32(constants.FIRST), np.float32(constants.SNAP)
ZERO, HALF, ONE, TWO, TINY = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2), np.float32(1e-20)
UPRIGHT = np.float32(constants.UPRIGHT)
LAST_COSINE, LAST_SHARE = np.float32(constants.COSINES - 1), np.float32(constants.SHARES - 1)


@inlined
def tangents(at):
    """See `turns.tangents`."""
    length = ONE / math.sqrt(ONE - at.vx * at.vx)
    ax, ay, az = (ONE - at.vx * at.vx) * length, -at.vx * at.vy * length, -at.vx * at.vz * length
    return (ax, ay, az), (at.vy * az - at.vz * ay, at.vz * ax - at.vx * az, at.vx * ay - at.vy * ax)


@inlined
def turn(at, share, table):
    """See `turns.turn`."""
    (ax, ay, az), (bx, by, bz) = tangents(at)
    along, aside = at.nx * ax + at.ny * ay + at.nz * az, at.nx * bx + at.ny * by + at.nz * bz
    length = math.sqrt(along * along + aside * aside)
    tilted = length > UPRIGHT
    along = along / max(length, UPRIGHT) if tilted else ONE
    aside = aside / max(length, UPRIGHT) if tilted else ZERO
    signed = TWO * share - ONE
    row = min(max(at.nx * at.vx + at.ny * at.vy + at.nz * at.vz, ZERO), ONE) * LAST_COSINE
    column = abs(signed) * LAST_SHARE
    i, j = min(np.int64(row), constants.COSINES - 2), min(np.int64(column), constants.SHARES - 2)
    down, right = row - np.float32(i), column - np.float32(j)
    upper = table[i, j, 0] + (table[i, j + 1, 0] - table[i, j, 0]) * right
    lower = table[i + 1, j, 0] + (table[i + 1, j + 1, 0] - table[i + 1, j, 0]) * right
    cosine = upper + (lower - upper) * down
    upper = table[i, j, 1] + (table[i, j + 1, 1] - table[i, j, 1]) * right
    lower = table[i + 1, j, 1] + (table[i + 1, j + 1, 1] - table[i + 1, j, 1]) * right
    sine = upper + (lower - upper) * down
    scale = ONE / math.sqrt(cosine * cosine + sine * sine)
    cosine, sine = cosine * scale, (sine if signed >= ZERO else -sine) * scale
    return along * cosine - aside * sine, aside * cosine + along * sine


@inlined
def cut_slice(at, cos_psi, sin_psi):
    """See `slices.cut_slice`."""
    (ax, ay, az), (bx, by, bz) = tangents(at)
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
        weight=ONE,  # pyright: ignore[reportArgumentType]
        step_x=(tx - slide * at.vx) * at.scale,
        step_y=(ty - slide * at.vy) * at.scale * at.aspect,
    )


@inlined
def right_share(cut):
    """Share of the arc on the right side, see `arcs.sides`."""
    return (cut.cos_n + (cut.n + QUARTER) * cut.sin_n) * (HALF / cut.measure)


@inlined
def pixels_to(edge, around, at, dx, dy):
    """Pixels in direction (dx, dy) to ``edge`` pixels before the end of the padded picture, see `arcs._borders`."""
    last = 2 * around.left_out - edge
    right, low = np.float32(around.wide + last) - HALF, np.float32(around.tall + last) - HALF
    first = np.float32(edge) - HALF
    x = max((right - at.column) * dx, (first - at.column) * dx) / max(dx * dx, np.float32(1e-12))
    y = max((low - at.row) * dy, (first - at.row) * dy) / max(dy * dy, np.float32(1e-12))
    return min(x, y)


@inlined
def arc_measure(rise, run, cos_n, sin_n, half, whole):
    """See `arcs.arc_measure`."""
    sine, cosine = run * cos_n + rise * sin_n, rise * cos_n - run * sin_n
    share = (run * sine / (rise * rise + run * run + TINY) + atan2(sine, cosine) * sin_n) * half
    share = max(min(share + SNAP, whole), ZERO)
    return whole if rise < ZERO else share


@inlined
def part_of_reach(which, jitter, steps, beyond):
    """Share of a side's reach at which a tap lies, see `slices.tap_pixels`; rounded once, as a power is."""
    t = np.float64((np.float32(which) + jitter) / np.float32(steps))
    return np.float32(t * t * math.sqrt(t) if beyond else t * math.sqrt(t))


@inlined
def leaves_hit(solid):
    """See `open_sky.leaves_hit`."""
    return ONE if solid > ZERO else ZERO
