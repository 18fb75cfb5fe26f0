"""The compiled forms of `post.filters.around`: a row of pixels as a body.

Sums and least values over a square are taken over its rows first and along the row then, so that a wide square costs
its sides. Rows of scratch have a margin on both sides for what is not in the picture.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.approximations import LOG2_E, falling_exp2
from gbufrt.compute.each import pixel_of
from gbufrt.compute.kernel import contracted, inlined, scalar
from post.filters import constants
from post.filters.constants import DEPTH, HIT, NX, NY, NZ, ROUGHNESS
from post.filters.kernel import edge_weights, tap_at

ZERO, ONE, ENDLESS = np.float32(0), np.float32(1), np.float32(np.inf)
HALF, KINDRED_DEPTH = np.float32(0.5), LOG2_E * np.float32(constants.KINDRED_DEPTH)
KINDRED_ROUGHNESS = LOG2_E / np.float32(constants.ROUGHNESS_SCALE)
LEAST, SAME = np.float32(constants.LEAST_SHARE), np.float32(constants.SAME)
AWAY = np.float32(constants.KINDRED_AWAY)


@inlined
def _rows_around(y, radius, height):
    return range(max(y - radius, 0), min(y + radius + 1, height))


@scalar
def _slide(sums, along, radius):
    """Sums along a row: those of the ``2 radius + 1`` numbers from each on."""
    sums[:] = 0
    for k in range(2 * radius + 1):
        taps = along[k : k + sums.shape[0]]
        for x in range(sums.shape[0]):
            sums[x] += taps[x]


@scalar
def pooled_row(out, scratch, value, mask, radius, y):
    """A row of `around.pooled`; ``scratch`` is two rows with margins, and two without."""
    channels, height, width = value.shape
    total, count, (sums, counted) = scratch[0], scratch[1], (scratch[2, :width], scratch[3, :width])
    least = LEAST * np.float32((2 * radius + 1) ** 2)
    for c in range(channels):
        shared = mask.shape[0] == 1
        m = 0 if shared else c
        if c == 0 or not shared:
            count[:] = 0
            within = count[radius : radius + width]
            for row in _rows_around(y, radius, height):
                counts = mask[m, row]
                for x in range(width):
                    within[x] += counts[x]
            _slide(counted, count, radius)
        total[:] = 0
        within = total[radius : radius + width]
        for row in _rows_around(y, radius, height):
            given, counts = value[c, row], mask[m, row]
            for x in range(width):
                within[x] += given[x] * counts[x]
        _slide(sums, total, radius)
        line = out[c, y]
        for x in range(width):
            line[x] = sums[x] / max(counted[x], least)


@scalar
def least_row(out, scratch, value, radius, y):
    """A row of `around.least`; ``scratch`` is a row with margins."""
    height, width = value.shape
    scratch[:] = ENDLESS
    within, line = scratch[radius : radius + width], out[y]
    for row in _rows_around(y, radius, height):
        given = value[row]
        for x in range(width):
            within[x] = min(within[x], given[x])
    line[:] = ENDLESS
    for k in range(2 * radius + 1):
        taps = scratch[k : k + width]
        for x in range(width):
            line[x] = min(line[x], taps[x])


@scalar
def alike_row(same, weights, guide, plane, edge, y):
    """A row of `around.alike`; ``weights`` is a row of scratch."""
    _, height, width = same.shape
    same[:, y] = False
    for k in range(9):
        tap = tap_at(y, 0, width, k % 3 - 1, k // 3 - 1, (height, width))
        if tap.end == tap.first:
            continue
        row, used = same[k, y, tap.first : tap.end], weights[: tap.end - tap.first]
        edge_weights(used, guide, plane, y, tap, edge)
        hit, there = guide[HIT, y, tap.first : tap.end], guide[HIT, tap.y, tap.first + tap.dx : tap.end + tap.dx]
        for i in range(used.shape[0]):
            row[i] = used[i] > SAME or (hit[i] == ZERO and there[i] == ZERO)


@contracted
@scalar
def kindred_pixel(i, out, value, mask, where, guide, plane, radius):
    """One pixel of `around.kindred`."""
    b, y, x = pixel_of(i, mask.shape[1], mask.shape[2])
    height, width, channels = mask.shape[1], mask.shape[2], value.shape[1]
    for c in range(channels):
        out[b, c, y, x] = ZERO
    if where[b, y, x]:
        here, given, counts, footprint, total = guide[b], value[b], mask[b], KINDRED_DEPTH * plane[b, 3, y, x], ZERO
        nx, ny, nz, depth, roughness = here[NX, y, x], here[NY, y, x], here[NZ, y, x], here[DEPTH, y, x], here[-1, y, x]
        for row in range(max(y - radius, 0), min(y + radius + 1, height)):
            first = max(x - radius, 0)
            for column in range(first + (first + row + x + y) % 2, min(x + radius + 1, width), 2):
                r, k = np.uint64(row), np.uint64(column)  # never below zero: nothing to wrap
                cosine = nx * here[NX, r, k] + ny * here[NY, r, k] + nz * here[NZ, r, k]
                if cosine > AWAY:
                    half, unlike = HALF + HALF * cosine, footprint * abs(here[DEPTH, r, k] - depth)
                    if here.shape[0] > ROUGHNESS:
                        unlike += KINDRED_ROUGHNESS * abs(here[ROUGHNESS, r, k] - roughness)
                    cube = half * half * half
                    weight = counts[r, k] * cube * cube * falling_exp2(-unlike)
                    total += weight
                    for c in range(channels):
                        out[b, c, y, x] += weight * given[np.uint64(c), r, k]
        for c in range(channels):
            out[b, c, y, x] /= max(total, LEAST)
