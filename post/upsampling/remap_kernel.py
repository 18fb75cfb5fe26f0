"""The compiled form of reading pictures between their pixels, a row of reads at a time.

Pictures are flat. Only `gather_row` and `gather_taps` read here and there, which no compiler turns into vector
instructions; every other loop becomes such. Names and steps are those of `post.upsampling.remap`, the definition.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import inlined, scalar
from post.upsampling import constants

ZERO, HALF, ONE, TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
FIRST, NEXT, SECOND = np.int32(0), np.int32(1), np.int32(2)
STEPPED = np.float32(constants.STEPPED)
TAPS, SHARES, FOUR = 8, 2, 4
"""Rows of scratch: columns and rows of taps, the latter times the width; how far reads lie between taps; and values."""


@inlined
def bounded(i, count):
    return min(max(i, 0), count - 1)


@inlined
def _within(i, last):
    return min(max(np.int32(i), FIRST), last)


@scalar
def taps_row(taps, shares, at_x, at_y, height, width):
    """The 4x4 pixels around each read, those of the border outside, and how far it lies between the middle ones."""
    wide, right, bottom = np.int32(width), np.int32(width - 1), np.int32(height - 1)
    u, v = shares[0], shares[1]
    one, two, three, four = taps[0], taps[1], taps[2], taps[3]
    for x in range(pixels(at_x.shape[0])):
        left = np.floor(at_x[x] - HALF)
        i, u[x] = np.int32(left), at_x[x] - HALF - left
        one[x], two[x] = _within(i - NEXT, right), _within(i, right)
        three[x], four[x] = _within(i + NEXT, right), _within(i + SECOND, right)
    one, two, three, four = taps[4], taps[5], taps[6], taps[7]
    for x in range(pixels(at_x.shape[0])):
        top = np.floor(at_y[x] - HALF)
        i, v[x] = np.int32(top), at_y[x] - HALF - top
        one[x], two[x] = _within(i - NEXT, bottom) * wide, _within(i, bottom) * wide
        three[x], four[x] = _within(i + NEXT, bottom) * wide, _within(i + SECOND, bottom) * wide


@scalar
def gather_row(out, picture, place):
    """What pixels hold; ``place`` is never below zero."""
    for x in range(pixels(out.shape[0])):
        out[x] = picture[np.uint32(place[x])]


@scalar
def gather_taps(four, picture, taps, row):
    """Four pixels of the same row for each read."""
    a, b, c, d = four[0], four[1], four[2], four[3]
    one, two, three, last = taps[0], taps[1], taps[2], taps[3]
    for x in range(pixels(row.shape[0])):
        i = row[x]
        a[x], b[x] = picture[np.uint32(one[x] + i)], picture[np.uint32(two[x] + i)]
        c[x], d[x] = picture[np.uint32(three[x] + i)], picture[np.uint32(last[x] + i)]


@scalar
def between_row(out, picture, taps, shares, four):
    """A picture between the four pixels in the middle."""
    a, b, c, d = four[0], four[1], four[2], four[3]
    left, right, upper, lower = taps[1], taps[2], taps[5], taps[6]
    for x in range(pixels(out.shape[0])):
        a[x], b[x] = picture[np.uint32(left[x] + upper[x])], picture[np.uint32(right[x] + upper[x])]
        c[x], d[x] = picture[np.uint32(left[x] + lower[x])], picture[np.uint32(right[x] + lower[x])]
    u, v = shares[0], shares[1]
    for x in range(pixels(out.shape[0])):
        above, below = (ONE - u[x]) * a[x] + u[x] * b[x], (ONE - u[x]) * c[x] + u[x] * d[x]
        out[x] = (ONE - v[x]) * above + v[x] * below


@scalar
def nearer_row(out, picture, then, tolerance, taps, shares, four):
    """Which share of the four pixels in the middle lies nearer than ``then`` by more than a factor."""
    a, b, c, d, u, v = four[0], four[1], four[2], four[3], shares[0], shares[1]
    left, right, upper, lower = taps[1], taps[2], taps[5], taps[6]
    for x in range(pixels(out.shape[0])):
        a[x], b[x] = picture[np.uint32(left[x] + upper[x])], picture[np.uint32(right[x] + upper[x])]
        c[x], d[x] = picture[np.uint32(left[x] + lower[x])], picture[np.uint32(right[x] + lower[x])]
    for x in range(pixels(out.shape[0])):
        a[x], b[x] = ONE if then[x] > a[x] * tolerance else ZERO, ONE if then[x] > b[x] * tolerance else ZERO
        c[x], d[x] = ONE if then[x] > c[x] * tolerance else ZERO, ONE if then[x] > d[x] * tolerance else ZERO
        above, below = (ONE - u[x]) * a[x] + u[x] * b[x], (ONE - u[x]) * c[x] + u[x] * d[x]
        out[x] = (ONE - v[x]) * above + v[x] * below


@inlined
def _sloped(near, up, here, f):
    """``near`` with what its slope adds on the way to its neighbour; it rises by ``up``, then by ``here``."""
    steepest = TWO * min(abs(up), abs(here))
    return near + min(max((up + here) * HALF, -steepest), steepest) * f * HALF


@inlined
def _moved(a, b, c, d, f):
    """See `post.upsampling.remap`; what is chosen is chosen without a jump."""
    g, up, here, down = ONE - f, b - a, c - b, d - c
    rising, next_rising = up * here > ZERO, here * down > ZERO
    step, next_step = here / (up + here if rising else ONE), down / (here + down if next_rising else ONE)
    sloped, next_sloped = g * _sloped(b, up, here, f), f * _sloped(c, here, down, -g)
    stepped = max(step - f, ZERO) * a + (ONE - max(step, f)) * c
    next_stepped = min(next_step, f) * b + max(f - next_step, ZERO) * d
    first = sloped + (stepped - sloped) * STEPPED if rising else g * b
    return first + (next_sloped + (next_stepped - next_sloped) * STEPPED if next_rising else f * c)


@scalar
def moved_row(out, four, f):
    a, b, c, d = four[0], four[1], four[2], four[3]
    for x in range(pixels(out.shape[0])):
        out[x] = _moved(a[x], b[x], c[x], d[x], f[x])


@scalar
def remapped_row(out, picture, taps, shares, four, rows):
    """One channel of a picture; ``four`` and ``rows`` are room for as many reads, four times each."""
    for k in range(FOUR):
        gather_taps(four, picture, taps, taps[FOUR + k])
        moved_row(rows[k], four, shares[0])
    moved_row(out, rows, shares[1])
