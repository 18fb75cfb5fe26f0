"""The compiled form of the sweeps of `post.sweep.reference`: a slice of every lane, see `post.sweep.lane_kernel`.

Names and steps are those of that torch reference, which is the definition, in the form without gradients.
`post.sweep.drivers` distributes the receivers.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.sweep import constants
from post.sweep import lane_kernel as lane
from post.sweep.constants import LIGHT, SUMS
from post.sweep.lane_kernel import LANES
from post.sweep.sector_kernel import add_slices, bits_between, share
from post.sweep.slice_kernel import HALF, ONE, TINY, ZERO, leaves_hit
from post.sweep.tap_kernel import (
    APART,
    measure_crossings,
    measure_taps,
    next_taps,
    place_ends,
    place_taps,
    read_taps,
    start_side,
    start_slice,
)

EDGE, LEDGE = np.float32(constants.EDGE), np.float32(constants.LEDGE)
ALIKE, FLATNESS = np.float32(constants.ALIKE), np.float32(constants.FLATNESS)


@scalar
def _find_ends(lanes, around):
    """Whether each slice leaves the picture at a surface, on its right and on its left; see `open_sky.leaves_hit`."""
    rows, pixel = lanes.rows, lanes.pixel
    place_ends(lanes, around, ONE)
    read_taps(lanes, around.pixels)
    for x in range(LANES):
        rows[lane.RIGHT_HIT + x] = leaves_hit(pixel[2 * x + 1])
    place_ends(lanes, around, -ONE)
    read_taps(lanes, around.pixels)
    for x in range(LANES):
        rows[lane.LEFT_HIT + x] = leaves_hit(pixel[2 * x + 1])


@inlined
def _crosses(rows, radius, x):
    """Whether a body that reaches from the previous tap to this one crosses a radius."""
    before, joined = rows[lane.BEFORE_DISTANCE + x], rows[lane.LEAST + x] < APART
    return joined & (before > ZERO) & (before < radius) & (rows[lane.DISTANCE + x] >= radius)


@inlined
def _first(rows, crossing, x):
    """Where a tap begins, without its joint to the tap before; see `occluders.blocked`."""
    front = rows[lane.FRONT + x]
    return front + (rows[lane.CROSSED + x] - front) * (ONE if crossing else ZERO)


@scalar
def _cover(rows, covered, radius, right):
    """Cover the sectors that every tap occludes within a radius."""
    for x in range(LANES):
        crossing = _crosses(rows, radius, x)
        low = min(_first(rows, crossing, x), rows[lane.LEAST + x])
        bits = bits_between(low, rows[lane.HIGH + x], rows[lane.LEFT + x], right, rows[lane.DITHER + x])
        covered[x] |= bits if crossing | (rows[lane.DISTANCE + x] < radius) else np.int32(0)


@scalar
def occlude(lanes, around):
    """See `reference._occlude`: add a slice of every lane to the sums of each radius."""
    rows, covered, radii = lanes.rows, lanes.covered, around.radii
    start_slice(lanes, around, not around.limited)
    if around.sky.shape[0] > 0:
        _find_ends(lanes, around)
    covered[:] = 0
    for right in (True, False):
        side = ONE if right else -ONE
        start_side(lanes, around, side, 1 if around.limited else around.margin + 1)
        for i in range(lanes.parts.shape[0] // LANES):
            place_taps(lanes, around, side, i)
            read_taps(lanes, around.pixels)
            measure_taps(lanes, around, side)
            if around.limited:
                measure_crossings(lanes, radii, side)
            for s in range(radii.shape[0]):
                _cover(rows, covered[s * LANES : (s + 1) * LANES], radii[s], right)
            next_taps(rows)
    for s in range(radii.shape[0]):
        sums = lanes.sums[s * SUMS * LANES : (s + 1) * SUMS * LANES]
        add_slices(rows, sums, covered[s * LANES : (s + 1) * LANES], around)


@inlined
def _flat(dx, dy, dz, one, other):
    """See `reference._flat`, of two points a step (dx, dy, dz) apart, and their normals."""
    alike = one[0] * other[0] + one[1] * other[1] + one[2] * other[2] > HALF
    off = max(abs(dx * one[0] + dy * one[1] + dz * one[2]), abs(dx * other[0] + dy * other[1] + dz * other[2]))
    return alike & (FLATNESS * math.sqrt(dx * dx + dy * dy + dz * dz + TINY) > off)


@inlined
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@scalar
def _start_planes(rows):
    """The tap before the first is the receiver itself."""
    for x in range(LANES):
        nx, ny, nz = rows[lane.AT_NX + x], rows[lane.AT_NY + x], rows[lane.AT_NZ + x]
        rows[lane.PLANE_X + x], rows[lane.PLANE_Y + x] = rows[lane.AT_X + x], rows[lane.AT_Y + x]
        rows[lane.PLANE_Z + x] = rows[lane.AT_Z + x]
        rows[lane.PLANE_NX + x], rows[lane.PLANE_NY + x], rows[lane.PLANE_NZ + x] = nx, ny, nz
        rows[lane.PLANE_COSINE + x] = nx * nx + ny * ny + nz * nz


@scalar
def _compare_planes(lanes, parallel):
    """Whether every tap continues the surface of the one before, and the share of its light that arrives.

    See `reference._flat`, `reference._facing` and `reference._edge_on`.
    """
    rows, pixel = lanes.rows, lanes.pixel
    for x in range(LANES):
        z, solid = pixel[2 * x], pixel[2 * x + 1]
        px, py = rows[lane.TAP_X + x] * (ONE if parallel else z), rows[lane.TAP_Y + x] * (ONE if parallel else z)
        normal = pixel[4 * LANES + 2 * x + 1], pixel[6 * LANES + 2 * x], pixel[6 * LANES + 2 * x + 1]
        before = rows[lane.PLANE_NX + x], rows[lane.PLANE_NY + x], rows[lane.PLANE_NZ + x]
        dx, dy, dz = px - rows[lane.PLANE_X + x], py - rows[lane.PLANE_Y + x], z - rows[lane.PLANE_Z + x]
        rows[lane.SAME + x] = ONE if _flat(dx, dy, dz, normal, before) else ZERO
        at = rows[lane.AT_NX + x], rows[lane.AT_NY + x], rows[lane.AT_NZ + x]
        eye = rows[lane.VX + x], rows[lane.VY + x], rows[lane.VZ + x]
        away = rows[lane.AT_X + x] - px, rows[lane.AT_Y + x] - py, rows[lane.AT_Z + x] - z
        cosine, cosine_before = _dot(normal, at), rows[lane.PLANE_COSINE + x]
        edge_on = (cosine > ALIKE) & (cosine_before > ALIKE) & (_dot(away, eye) > _dot(away, at) * _dot(at, eye))
        ledge = edge_on & (min(z + solid, rows[lane.BEFORE_BACK_Z + x]) - max(z, rows[lane.BEFORE_Z + x]) > ZERO)
        lit = ONE if _dot(away, normal) > ZERO else (LEDGE if ledge else ZERO)
        rows[lane.LIT + x] = ZERO if _flat(away[0], away[1], away[2], normal, at) else lit
        rows[lane.PLANE_X + x], rows[lane.PLANE_Y + x], rows[lane.PLANE_Z + x] = px, py, z
        rows[lane.PLANE_NX + x], rows[lane.PLANE_NY + x], rows[lane.PLANE_NZ + x] = normal
        rows[lane.PLANE_COSINE + x] = cosine


@scalar
def _cover_lit(lanes, radius, right):
    """Cover the sectors that every tap occludes, and add the light from those that it is the first to cover."""
    rows, covered, pixel = lanes.rows, lanes.covered, lanes.pixel
    for x in range(LANES):
        crossing, same = _crosses(rows, radius, x), rows[lane.SAME + x] > ZERO
        first, start = _first(rows, crossing, x), rows[lane.LEAST + x]
        low = min(first, start)
        farther = max(low - max(start - first, ZERO) * EDGE, ZERO)
        low = farther if same & (not crossing) else low
        bits = bits_between(low, rows[lane.HIGH + x], rows[lane.LEFT + x], right, rows[lane.DITHER + x])
        bits = bits if crossing | (rows[lane.DISTANCE + x] < radius) else np.int32(0)
        lit = share(bits & ~covered[x]) * rows[lane.LIT + x]
        covered[x] |= bits
        rows[lane.RED + x] += lit * pixel[2 * LANES + 2 * x]
        rows[lane.GREEN + x] += lit * pixel[2 * LANES + 2 * x + 1]
        rows[lane.BLUE + x] += lit * pixel[4 * LANES + 2 * x]


@scalar
def gather(lanes, around):
    """See `reference._gather`: add a slice of every lane to the sums."""
    rows, radii = lanes.rows, around.radii
    start_slice(lanes, around, True)
    if around.sky.shape[0] > 0:
        _find_ends(lanes, around)
    lanes.covered[:] = 0
    rows[lane.RED : lane.RED + LIGHT * LANES] = ZERO
    for right in (True, False):
        side = ONE if right else -ONE
        start_side(lanes, around, side, around.margin + 1)
        _start_planes(rows)
        for i in range(lanes.parts.shape[0] // LANES):
            place_taps(lanes, around, side, i)
            read_taps(lanes, around.pixels)
            _compare_planes(lanes, around.parallel)
            measure_taps(lanes, around, side)
            if around.limited:
                measure_crossings(lanes, radii, side)
            _cover_lit(lanes, radii[0], right)
            next_taps(rows)
    add_slices(rows, lanes.sums, lanes.covered, around)
    for x in range(LANES):
        for c in range(LIGHT):
            lanes.sums[(SUMS + c) * LANES + x] += rows[lane.RED + c * LANES + x]
