"""Scalar forms of the sectors of a slice's arc and of their sums. See `post.sweep.sweep_kernel`.

Names and steps are those of the torch reference in `post.sweep.sectors` and `post.sweep.open_sky`, which is the
definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from post.sweep import constants
from post.sweep.constants import FIRST_BITS, PER_GROUP
from post.sweep.slice_kernel import HALF, ONE, ZERO, leaves_hit

SECTORS, GROUPS, FREE = np.float32(constants.SECTORS), np.float32(constants.GROUPS), np.float32(constants.FREE)
FIELD = (1 << PER_GROUP) - 1


@scalar
def bits_between(low, high, dither):
    """The sectors between two shares of the arc, see `sectors.cover`."""
    first = np.int32(low * SECTORS + dither)
    last = max(np.int32(high * SECTORS + dither), first)
    return np.int32((1 << last) - (1 << first))


@scalar
def group_counts(bits):
    """Number of sectors set in each group, one bit field per group; see `sectors.group_shares`."""
    counts = bits & FIRST_BITS
    for bit in range(1, PER_GROUP):
        counts += (bits >> bit) & FIRST_BITS
    return counts


@scalar
def share(bits):
    """See `sectors.share`."""
    counts, total = group_counts(bits), 0
    for group in range(constants.GROUPS):
        total += (counts >> (PER_GROUP * group)) & FIELD
    return np.float32(total) / SECTORS


@scalar
def mean_direction(terms, sin_n, which):
    """See `arcs.mean_directions`: polynomials; each row of ``terms`` holds one power."""
    value = terms[terms.shape[0] - 1, which]
    for power in range(terms.shape[0] - 2, -1, -1):
        value = value * sin_n + terms[power, which]
    return value


@scalar
def _open_share(sky, cut, group, rise, run, seam, hits):
    """See `open_sky.open_share`: of one group."""
    lift = cut.hx * sky[2] + cut.hy * sky[3] + cut.hz * sky[4]
    slide = cut.tx * sky[2] + cut.ty * sky[3] + cut.tz * sky[4]
    elevation = (rise * lift + run * slide) / math.sqrt(rise * rise + run * run + np.float32(1e-12))
    right = min(max(np.float32(group) + HALF - seam * GROUPS + HALF, ZERO), ONE)
    unknown = (right * hits[0] + (ONE - right) * hits[1]) * sky[1]
    return ONE - unknown * (ONE - sky[0] * min(max(elevation / FREE, ZERO), ONE))


@scalar
def fill_groups(groups, around, at, cut, right, left):
    """What all masks of a slice share: each group's mean direction (2) and its openness where not covered."""
    sky, terms = around.sky, around.terms
    hits = (leaves_hit(around, at, right), leaves_hit(around, at, left))
    for group in range(constants.GROUPS):
        rise = mean_direction(terms, cut.sin_n, group)
        run = mean_direction(terms, cut.sin_n, constants.GROUPS + group)
        groups[group, 0], groups[group, 1] = rise, run
        groups[group, 2] = _open_share(sky, cut, group, rise, run, left.whole, hits) if sky.shape[0] > 0 else ONE


@scalar
def _add_direction(sums, cut, rise, run):
    sums[0] += rise * cut.hx + run * cut.tx
    sums[1] += rise * cut.hy + run * cut.ty
    sums[2] += rise * cut.hz + run * cut.tz


@scalar
def add_slice(sums, groups, cut, bits):
    """See `sectors.slice_sums`."""
    counts = group_counts(bits)
    opened, open_rise, open_run, whole_rise, whole_run = ZERO, ZERO, ZERO, ZERO, ZERO
    for group in range(constants.GROUPS):
        rise, run = groups[group, 0], groups[group, 1]
        covered = np.float32((counts >> (PER_GROUP * group)) & FIELD) / np.float32(PER_GROUP)
        part = (ONE - covered) * groups[group, 2]
        opened += part
        open_rise, open_run = open_rise + part * rise, open_run + part * run
        whole_rise, whole_run = whole_rise + rise, whole_run + run
    weight = cut.weight
    sums[0] += weight
    sums[1] += opened / GROUPS * weight
    _add_direction(sums[2:5], cut, open_rise / GROUPS * weight, open_run / GROUPS * weight)
    _add_direction(sums[5:8], cut, whole_rise / GROUPS * weight, whole_run / GROUPS * weight)
