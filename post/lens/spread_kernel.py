"""The compiled form of a layer spread by its disc: a row of source pixels as a body.

Names and steps are those of the torch reference in `post.lens.reference`, the definition. A disc is spread directly,
without Fourier transforms: a source row, blurred along itself by row k of the disc, is added to the rows k above and k
below. From the disc's top row to its middle one the whole pixels of a row only become more, so their sum grows by two
taps at a time and loses no precision beside bright pixels. All channels of a pixel lie side by side, so that every loop
over a row becomes vector instructions, and rows where a layer has no share cost nothing.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import inlined, scalar

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)

Window = namedtuple("Window", "top bottom left right")
"""Output pixels: rows from ``top``, columns from ``left``, without ``bottom`` and ``right``."""
Disc = namedtuple("Disc", "reach weights inner outer")
"""Weights by row and column from the middle: 1 below ``inner[row]``, 0 from ``outer[row]`` on; rows up to ``reach``."""
Ramp = namedtuple("Ramp", "rise up fall down scale")
"""A share in a layer by the squared radius: from 0 at ``rise`` with slope ``up``, to 0 at ``fall``; then a factor."""


@scalar
def row_ranges(low, high, coc, window, reach):
    """Least and greatest signed square of each row that discs of a window reach; the first is ``top - reach``."""
    height, width = coc.shape
    first, end = max(window.left - reach, 0), min(window.right + reach, width)
    for i in range(window.bottom - window.top + 2 * reach):
        row = coc[min(max(window.top - reach + i, 0), height - 1), first:end]
        least, most = row[0], row[0]
        for x in range(row.shape[0]):
            least, most = min(least, row[x]), max(most, row[x])
        low[i], high[i] = least * abs(least), most * abs(most)


@inlined
def share_of(square, ramp):
    """The share in a layer by the squared radius."""
    return ramp.scale * max(min(min((square - ramp.rise) * ramp.up, (ramp.fall - square) * ramp.down), ONE), ZERO)


@scalar
def share_row(share, coc, ramp, window, reach, y):
    """The shares of a row from ``left - reach`` on, borders repeated; the first that is not 0, and the last's end."""
    height, width = coc.shape
    row, size = coc[min(max(y, 0), height - 1)], window.right - window.left + 2 * reach
    start = window.left - reach
    before, after = max(-start, 0), min(width - start, size)
    known, kept = row[start + before : start + after], share[before:after]
    for i in range(kept.shape[0]):
        kept[i] = share_of(known[i] * abs(known[i]), ramp)
    share[:before], share[after:size] = share[before], share[after - 1]
    first, end = 0, size
    while first < end and share[first] == ZERO:
        first += 1
    while end > first and share[end - 1] == ZERO:
        end -= 1
    return first, end


@scalar
def calm_row(share, color, level, window, reach, y, first, end):
    """Multiply shares by the calm weights of `reference.layers_reference`."""
    channels, height, width = color.shape
    row, scale = min(max(y, 0), height - 1), ONE / np.float32(channels)
    for i in range(first, end):
        x, total = min(max(window.left - reach + i, 0), width - 1), ZERO
        for c in range(channels):
            total += color[c, row, x]
        share[i] /= ONE + total * scale / level


@scalar
def source_row(source, color, share, window, reach, y, first, end):
    """Colour times share, then the share, side by side for each pixel of a row; 0 where there is no share."""
    channels, height, width = color.shape
    planes, row, start = channels + 1, min(max(y, 0), height - 1), window.left - reach
    source[: (window.right - window.left + 2 * reach) * planes] = ZERO
    low, high = min(max(-start, first), end), max(min(width - start, end), first)
    for c in range(channels):
        light = color[c, row]
        for i in range(first, low):
            source[i * planes + c] = light[0] * share[i]
        for i in range(low, high):
            source[i * planes + c] = light[start + i] * share[i]
        for i in range(max(high, low), end):
            source[i * planes + c] = light[width - 1] * share[i]
    for i in range(first, end):
        source[i * planes + channels] = share[i]


@scalar
def add_pair(sums, base, one, other, weight):
    """``base`` plus two weighted taps."""
    for i in range(sums.shape[0]):
        sums[i] = base[i] + weight * (one[i] + other[i])


@scalar
def grow_by_pair(sums, one, other, weight):
    """As `add_pair`, in place: a loop that may read what it wrote is not vectorised."""
    for i in range(sums.shape[0]):
        sums[i] += weight * (one[i] + other[i])


@scalar
def add_to(out, row):
    """Add a row to another."""
    for i in range(out.shape[0]):
        out[i] += row[i]


@scalar
def spread_row(out, source, whole, sums, disc, window, planes, y, first, end):
    """Add a source row, spread by a disc, to all rows of the window that it reaches."""
    reach, left = disc.reach, window.left
    low, high = max(first - reach, reach), min(end + reach, window.right - left + reach)
    begin, size = low * planes, (high - low) * planes
    place = begin - reach * planes
    inside, blurred = whole[:size], sums[:size]
    inside[:] = ZERO
    grown = 0
    for k in range(reach, max(window.top - y, y - window.bottom + 1, 0) - 1, -1):
        while grown < disc.inner[k]:
            shift = grown * planes
            one, other = source[begin - shift : begin - shift + size], source[begin + shift : begin + shift + size]
            grow_by_pair(inside, one, other, ONE if grown > 0 else HALF)
            grown += 1
        above, below = y - k >= window.top and y - k < window.bottom, k > 0 and y + k < window.bottom
        if y + k < window.top or not (above or below):
            continue
        row = blurred if disc.outer[k] > disc.inner[k] else inside
        for a in range(disc.inner[k], disc.outer[k]):
            shift, weight = a * planes, disc.weights[k, a] * (ONE if a > 0 else HALF)
            one, other = source[begin - shift : begin - shift + size], source[begin + shift : begin + shift + size]
            if a == disc.inner[k]:
                add_pair(blurred, inside, one, other, weight)
            else:
                grow_by_pair(blurred, one, other, weight)
        if above:
            add_to(out[y - k - window.top, place : place + size], row)
        if below:
            add_to(out[y + k - window.top, place : place + size], row)


@scalar
def spread(out, rows, color, coc, low, high, level, disc, ramp, window, margin):
    """Add a layer, spread by its disc, to a window; return whether there is any.

    ``rows`` are four rows of scratch; ``low`` and ``high`` are those of `row_ranges`, for a greater ``margin``.
    ``level`` is that of pixels that count half, or 0 where all count alike.
    """
    any_share, planes = False, color.shape[0] + 1
    share, source, whole, sums = rows[0], rows[1], rows[2], rows[3]
    for y in range(window.top - disc.reach, window.bottom + disc.reach):
        i = y - window.top + margin
        if high[i] <= ramp.rise or low[i] >= ramp.fall:
            continue
        first, end = share_row(share, coc, ramp, window, disc.reach, y)
        if end > first:
            any_share = True
            if level > ZERO:
                calm_row(share, color, level, window, disc.reach, y, first, end)
            source_row(source, color, share, window, disc.reach, y, first, end)
            spread_row(out, source, whole, sums, disc, window, planes, y, first, end)
    return any_share
