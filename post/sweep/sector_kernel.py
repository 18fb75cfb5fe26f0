"""Compiled sectors of a slice's arc and their sums, for all lanes at once: see `post.sweep.lane_kernel`.

Names and steps are those of the torch reference in `post.sweep.sectors` and `post.sweep.open_sky`, which is the
definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.sweep import constants
from post.sweep import lane_kernel as lane
from post.sweep.constants import PER_GROUP
from post.sweep.lane_kernel import LANES
from post.sweep.slice_kernel import HALF, ONE, ZERO

SECTORS, GROUPS, FREE = np.float32(constants.SECTORS), np.float32(constants.GROUPS), np.float32(constants.FREE)
FIELD = (1 << PER_GROUP) - 1


@inlined
def bits_between(low, high, seam, right, dither):
    """The sectors between two shares of a side, see `sectors.cover`."""
    first = np.int32((seam + low if right else seam - high) * SECTORS + dither)
    last = max(np.int32((seam + high if right else seam - low) * SECTORS + dither), first)
    return np.int32((1 << last) - (1 << first))


@inlined
def count(bits):
    """The number of sectors that are set: sums of two bits, then of two sums, and so on, all side by side."""
    twos = np.int32(bits - (np.int32(bits >> 1) & 0x55555555))
    fours = np.int32((twos & 0x33333333) + (np.int32(twos >> 2) & 0x33333333))
    eights = np.int32(np.int32(fours + np.int32(fours >> 4)) & 0x0F0F0F0F)
    halves = np.int32(eights + np.int32(eights >> 8))
    return np.int32(np.int32(halves + np.int32(halves >> 16)) & 63)


@inlined
def share(bits):
    """See `sectors.share`."""
    return np.float32(count(bits)) / SECTORS


@inlined
def _terms(terms, which):
    """One of the polynomials of `arcs.direction_polynomials`, lowest power first."""
    return (
        terms[0, which],
        terms[1, which],
        terms[2, which],
        terms[3, which],
        terms[4, which],
        terms[5, which],
        terms[6, which],
        terms[7, which],
        terms[8, which],
    )


@inlined
def _polynomial(t, s):
    """See `arcs.mean_directions`."""
    value = ((((t[8] * s + t[7]) * s + t[6]) * s + t[5]) * s + t[4]) * s + t[3]
    return ((value * s + t[2]) * s + t[1]) * s + t[0]


@inlined
def _open_share(rows, sky, group, rise, run, x):
    """See `open_sky.open_share`: of one group."""
    lift = rows[lane.HX + x] * sky[2] + rows[lane.HY + x] * sky[3] + rows[lane.HZ + x] * sky[4]
    slide = rows[lane.TX + x] * sky[2] + rows[lane.TY + x] * sky[3] + rows[lane.TZ + x] * sky[4]
    elevation = (rise * lift + run * slide) / math.sqrt(rise * rise + run * run + np.float32(1e-12))
    right = min(max(np.float32(group) + HALF - rows[lane.LEFT + x] * GROUPS + HALF, ZERO), ONE)
    unknown = (right * rows[lane.RIGHT_HIT + x] + (ONE - right) * rows[lane.LEFT_HIT + x]) * sky[1]
    return ONE - unknown * (ONE - sky[0] * min(max(elevation / FREE, ZERO), ONE))


@scalar
def _start_group(rows, around, group):
    """What all masks of a slice share: a group's mean direction and its openness where not covered."""
    rises, runs = _terms(around.terms, group), _terms(around.terms, constants.GROUPS + group)
    for x in range(LANES):
        sin_n = rows[lane.SIN_N + x]
        rise, run = _polynomial(rises, sin_n), _polynomial(runs, sin_n)
        rows[lane.GROUP_RISE + x], rows[lane.GROUP_RUN + x], rows[lane.GROUP_OPEN + x] = rise, run, ONE
    if around.sky.shape[0] > 0:
        sky = around.sky[0], around.sky[1], around.sky[2], around.sky[3], around.sky[4]
        for x in range(LANES):
            rise, run = rows[lane.GROUP_RISE + x], rows[lane.GROUP_RUN + x]
            rows[lane.GROUP_OPEN + x] = _open_share(rows, sky, group, rise, run, x)


@scalar
def _add_group(rows, covered, group):
    for x in range(LANES):
        rise, run = rows[lane.GROUP_RISE + x], rows[lane.GROUP_RUN + x]
        bits = (covered[x] >> (PER_GROUP * group)) & FIELD
        part = (ONE - np.float32(count(bits)) / np.float32(PER_GROUP)) * rows[lane.GROUP_OPEN + x]
        rows[lane.OPENED + x] += part
        rows[lane.OPEN_RISE + x] += part * rise
        rows[lane.OPEN_RUN + x] += part * run
        rows[lane.WHOLE_RISE + x] += rise
        rows[lane.WHOLE_RUN + x] += run


@inlined
def _add_direction(sums, k, rows, rise, run, x):
    sums[k + x] += rise * rows[lane.HX + x] + run * rows[lane.TX + x]
    sums[k + LANES + x] += rise * rows[lane.HY + x] + run * rows[lane.TY + x]
    sums[k + 2 * LANES + x] += rise * rows[lane.HZ + x] + run * rows[lane.TZ + x]


@scalar
def add_slices(rows, sums, covered, around):
    """See `sectors.slice_sums`: add every slice, covered as given, to its sums."""
    for x in range(5 * LANES):
        rows[lane.WHOLE_RISE + x] = ZERO
    for group in range(constants.GROUPS):
        _start_group(rows, around, group)
        _add_group(rows, covered, group)
    for x in range(LANES):
        sums[x] += ONE
        sums[LANES + x] += rows[lane.OPENED + x] / GROUPS
        rise, run = rows[lane.OPEN_RISE + x] / GROUPS, rows[lane.OPEN_RUN + x] / GROUPS
        _add_direction(sums, 2 * LANES, rows, rise, run, x)
        rise, run = rows[lane.WHOLE_RISE + x] / GROUPS, rows[lane.WHOLE_RUN + x] / GROUPS
        _add_direction(sums, 5 * LANES, rows, rise, run, x)
