"""The compiled form of the sweeps of `post.sweep.reference`: one slice of one receiver as a scalar body.

Names and steps are those of that torch reference, which is the definition, in the form without gradients. Angles
of taps that occlude nothing are not computed. `post.sweep.drivers` distributes the receivers.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import scalar
from post.sweep import constants
from post.sweep.sector_kernel import add_slice, bits_between, fill_groups, share
from post.sweep.slice_kernel import (
    FIRST,
    HALF,
    ONE,
    TINY,
    ZERO,
    arc_measure,
    cut_slice,
    fill_spread,
    look,
    side_of,
)

EDGE, LEDGE = np.float32(constants.EDGE), np.float32(constants.LEDGE)
ALIKE, FLATNESS = np.float32(constants.ALIKE), np.float32(constants.FLATNESS)
UNKNOWN = np.float32(-1)
LIGHT, NORMAL = 2, 5  # first channels of the scene's picture

Front = namedtuple("Front", "share rise run distance z back_z")
Scratch = namedtuple("Scratch", "covered light groups spread")
Plane = namedtuple("Plane", "x y z nx ny nz")


@scalar
def _start(around, at, side):
    """See `occluders.start`."""
    own = around.picture[np.int32(at.row), np.int32(at.column), 1]
    return Front(side.whole, ZERO, ZERO, ZERO, at.z, at.z + own)


@scalar
def _next_front(tap, side, distance):
    """The tap as predecessor of the next one; its share of the arc is measured on demand."""
    known = side.whole if tap.front_rise < ZERO else UNKNOWN
    return Front(known, tap.front_rise, tap.front_run, distance, tap.z, tap.back_z)


@scalar
def _share_of(front, side):
    return arc_measure(front.rise, front.run, side) if front.share < ZERO else front.share


@scalar
def _overlap(tap, before):
    """See `occluders.overlap`."""
    return min(tap.back_z, before.back_z) - max(tap.z, before.z)


@scalar
def _distance(tap):
    return math.sqrt(tap.front_rise * tap.front_rise + tap.front_run * tap.front_run + TINY)


@scalar
def _below(tap, before, side):
    """Whether neither the tap nor the one before rises above the receiver's plane: together they occlude nothing."""
    return tap.front_rise < ZERO and tap.back_rise < ZERO and before.share == side.whole


@scalar
def _crosses(before, distance, radius):
    """Whether a body that reaches from the previous tap to this one crosses a radius."""
    return before.distance > ZERO and before.distance < radius and distance >= radius


@scalar
def _front_at_the_radius(tap, before, side, radii, distance):
    """See `occluders._front_at_the_radius`."""
    radius = radii[radii.shape[0] - 1]
    for s in range(radii.shape[0] - 2, -1, -1):
        if radii[s] > before.distance:
            radius = radii[s]
    left = (distance - radius) / max(abs(distance - before.distance), np.float32(1e-9))
    rise, run = tap.front_rise, tap.front_run
    return arc_measure(rise + (before.rise - rise) * left, run + (before.run - run) * left, side)


@scalar
def _bits(low, high, seam, right, dither):
    """The sectors between two shares of a side."""
    return bits_between(seam + low, seam + high, dither) if right else bits_between(seam - high, seam - low, dither)


@scalar
def _occlude_side(covered, spread, around, at, side, seam, right, dither):
    """Cover the sectors that the taps of one side occlude, for each radius."""
    radii = around.radii
    limited = radii.shape[0] > 0
    widest = radii[radii.shape[0] - 1] if limited else ZERO
    reach = min(widest * side.length, side.border) if limited else side.frame
    before = _start(around, at, side)
    for i in range(spread.shape[0]):
        tap = look(around, at, side, FIRST + reach * spread[i])
        joined = _overlap(tap, before) > ZERO
        distance = _distance(tap) if limited else ONE
        stands = joined or tap.back_z > tap.z
        far = limited and distance >= widest and not (joined and _crosses(before, distance, widest))
        if stands and not far and not _below(tap, before, side):
            front = arc_measure(tap.front_rise, tap.front_run, side)
            high = arc_measure(tap.back_rise, tap.back_run, side)
            start = _share_of(before, side) if joined else front
            high = max(high, start) if joined else high
            for s in range(covered.shape[0]):
                low = front
                if limited and distance >= radii[s]:
                    if not (joined and _crosses(before, distance, radii[s])):
                        continue
                    low = _front_at_the_radius(tap, before, side, radii, distance)
                covered[s] |= _bits(min(low, start) if joined else low, high, seam, right, dither)
        before = _next_front(tap, side, distance)


@scalar
def occlude(sums, scratch, around, at, dice):
    """See `reference._occlude`: add a slice to the sums of each radius."""
    covered, cut = scratch.covered, cut_slice(at, dice[0], dice[1])
    right, left = side_of(around, at, cut, ONE), side_of(around, at, cut, -ONE)
    fill_spread(scratch.spread, dice[2], around.radii.shape[0] == 0)
    covered[:] = 0
    for onward in (True, False):
        side = right if onward else left
        _occlude_side(covered, scratch.spread, around, at, side, left.whole, onward, dice[3])
    fill_groups(scratch.groups, around, at, cut, right, left)
    for s in range(covered.shape[0]):
        add_slice(sums[s], scratch.groups, cut, covered[s])


@scalar
def _plane(around, tap):
    """See `reference._plane`."""
    x, y = (tap.x, tap.y) if around.parallel else (tap.x * tap.z, tap.y * tap.z)
    pixel = around.picture[tap.j, tap.i]
    return Plane(x, y, tap.z, pixel[NORMAL], pixel[NORMAL + 1], pixel[NORMAL + 2])


@scalar
def _flat(one, other):
    """See `reference._flat`."""
    if not one.nx * other.nx + one.ny * other.ny + one.nz * other.nz > HALF:
        return False
    dx, dy, dz = one.x - other.x, one.y - other.y, one.z - other.z
    off = max(abs(dx * one.nx + dy * one.ny + dz * one.nz), abs(dx * other.nx + dy * other.ny + dz * other.nz))
    return FLATNESS * math.sqrt(dx * dx + dy * dy + dz * dz + TINY) > off


@scalar
def _edge_on(plane, before, at):
    """See `reference._edge_on`."""
    if plane.nx * at.nx + plane.ny * at.ny + plane.nz * at.nz <= ALIKE:
        return False
    if before.nx * at.nx + before.ny * at.ny + before.nz * at.nz <= ALIKE:
        return False
    dx, dy, dz = at.x - plane.x, at.y - plane.y, at.z - plane.z
    toward_eye = dx * at.vx + dy * at.vy + dz * at.vz
    off_plane = (dx * at.nx + dy * at.ny + dz * at.nz) * (at.nx * at.vx + at.ny * at.vy + at.nz * at.vz)
    return toward_eye > off_plane


@scalar
def _facing(plane, at):
    """See `reference._facing`."""
    return (at.x - plane.x) * plane.nx + (at.y - plane.y) * plane.ny + (at.z - plane.z) * plane.nz > ZERO


@scalar
def _gathered_arc(tap, before, side, radii, distance, joined, same, crossing):
    """Shares of a side between which a tap occludes, see `occluders.blocked`."""
    first = arc_measure(tap.front_rise, tap.front_run, side)
    high = arc_measure(tap.back_rise, tap.back_run, side)
    if crossing:
        first = _front_at_the_radius(tap, before, side, radii, distance)
    if not joined:
        return first, high
    start = _share_of(before, side)
    low, high = min(first, start), max(high, start)
    if same and not crossing:
        low = max(low - max(start - first, ZERO) * EDGE, ZERO)
    return low, high


@scalar
def _gather_side(light, covered, spread, around, at, side, seam, right, dither):
    """The sectors covered after one side; the light from its taps is added to ``light``."""
    radii = around.radii
    limited = radii.shape[0] > 0
    widest = radii[0] if limited else ZERO
    reach = min(side.frame, widest * side.length) if limited else side.frame
    before, plane = _start(around, at, side), Plane(at.x, at.y, at.z, at.nx, at.ny, at.nz)
    whole = _bits(ZERO, side.whole, seam, right, dither)
    for i in range(spread.shape[0]):
        tap = look(around, at, side, FIRST + reach * spread[i])
        next_plane = _plane(around, tap)
        distance = _distance(tap) if limited else ONE
        if not _below(tap, before, side):
            overlaps = _overlap(tap, before) > ZERO
            same = _flat(next_plane, plane)
            joined = overlaps or same
            crossing = limited and joined and _crosses(before, distance, widest)
            if (joined or tap.back_z > tap.z) and (crossing or not limited or distance < widest):
                low, high = _gathered_arc(tap, before, side, radii, distance, joined, same, crossing)
                fresh = _bits(low, high, seam, right, dither) & ~covered
                if fresh != 0:
                    covered |= fresh
                    lit = ONE if _facing(next_plane, at) else ZERO
                    if lit == ZERO and overlaps and _edge_on(next_plane, plane, at):
                        lit = LEDGE
                    lit *= share(fresh)
                    for c in range(3):
                        light[c] += lit * around.picture[tap.j, tap.i, LIGHT + c]
                    if whole & ~covered == 0:
                        break
        before, plane = _next_front(tap, side, distance), next_plane
    return covered


@scalar
def gather(sums, scratch, around, at, dice):
    """See `reference._gather`: add a slice to the sums."""
    covered, light, cut = np.int32(0), scratch.light, cut_slice(at, dice[0], dice[1])
    right, left = side_of(around, at, cut, ONE), side_of(around, at, cut, -ONE)
    fill_spread(scratch.spread, dice[2], True)
    light[:] = ZERO
    for onward in (True, False):
        side = right if onward else left
        covered = _gather_side(light, covered, scratch.spread, around, at, side, left.whole, onward, dice[3])
    fill_groups(scratch.groups, around, at, cut, right, left)
    add_slice(sums[0], scratch.groups, cut, covered)
    for c in range(3):
        sums[0, 8 + c] += light[c] * cut.weight
