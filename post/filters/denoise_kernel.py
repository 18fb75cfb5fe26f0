"""The compiled denoisers: how a wavelet, a joint bilateral kernel and moments weigh their taps, a row at a time.

Names and steps are those of the torch reference in `post.filters.reference`, the definition; what they share is in
`post.filters.weight_kernel`.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import contracted, inlined, scalar
from post.filters import constants
from post.filters.constants import B3
from post.filters.kernel import guide_row
from post.filters.weight_kernel import ROOT, edge_weight, near_of, there_row, weigh_further

ZERO, ONE, QUARTER = np.float32(0), np.float32(1), np.float32(0.25)
HALF_ROOT, SLANT = ROOT / np.float32(2), np.float32(math.sqrt(ROOT))
LEAST, NOISELESS, THIRD = np.float32(1e-6), np.float32(1e-12), np.float32(1 / 3)
FLOOR, AT_EDGES = np.float32(constants.FLOOR), np.float32(constants.AT_EDGES)
NARROWEST, MIN_CONTRAST = np.float32(constants.NARROWEST), np.float32(constants.MIN_CONTRAST)
MIN_MEAN = np.float32(constants.MIN_MEAN)

Own = namedtuple("Own", "level scale limit")
"""What a pixel holds against its taps, in roots of exponents: a factor on light, its own light times that, and what a
square pixel away costs."""


@scalar
def own_of(limits, taps):
    """The pixels of a row of `Own` that taps serve."""
    return Own(limits[0, taps.first : taps.end], limits[1, taps.first : taps.end], limits[2, taps.first : taps.end])


@contracted
@inlined
def wavelet_unlike(own, other, dx, dy):
    """What light and distance do to one tap of `reference.wavelet_reference`, as `weight_between` takes it."""
    return abs(other * own.scale - own.level) + own.limit * (dx * dx + dy * dy)


@contracted
@inlined
def wavelet_weight(i, here, near, own, j, there, other, dx, dy, edge):
    """One tap of `reference.wavelet_reference`, without its share."""
    one = Own(own.level[i], own.scale[i], own.limit[i])
    return edge_weight(i, here, near, j, there, dx, dy, edge, wavelet_unlike(one, other[j], dx, dy))


@contracted
@scalar
def wavelet_weights(weights, guide, near, light, limits, y, taps, shares, edge):
    """The weights of taps of `reference.wavelet_reference` for a row of pixels; ``shares`` are the B-spline's."""
    here, there, near = guide_row(guide, y, taps.first, taps.end), there_row(guide, taps), near_of(near, taps)
    size, step, gap = np.uint64(taps.end - taps.first), np.uint64(taps.step), np.float32(taps.step)
    one, two, three = weights[0, :size], weights[1, :size], weights[2, :size]
    own = own_of(limits, taps)
    other = light[taps.y, taps.first + taps.dx : taps.end + taps.dx + (taps.count - 1) * taps.step]
    dx, dy = np.float32(taps.dx), np.float32(taps.dy)
    if taps.count == 1:
        share = shares[taps.number]
        for i in range(size):
            one[i] = share * wavelet_weight(i, here, near, own, i, there, other, dx, dy, edge)
    else:
        a, b, c = shares
        for i in range(size):
            j, k = i + step, i + step + step
            one[i] = a * wavelet_weight(i, here, near, own, i, there, other, dx, dy, edge)
            two[i] = b * wavelet_weight(i, here, near, own, j, there, other, dx + gap, dy, edge)
            three[i] = c * wavelet_weight(i, here, near, own, k, there, other, dx + gap + gap, dy, edge)
    weigh_further(weights, guide, y, taps, edge)


@contracted
@inlined
def bilateral_unlike(own, other, dx, dy):
    """What light and distance do to one tap of `reference.bilateral_reference`, as `weight_between` takes it."""
    away = other * own.scale - own.level
    return max(away * away, ROOT) + (own.limit * (dx * dx + dy * dy) - ROOT)


@contracted
@scalar
def add_moments(sums, weights, light, y, taps):
    """Add taps to the sums of `reference.moments_reference`; they are about the centre's value."""
    first, end = taps.first, taps.end
    total, mean, square, here = sums[0, first:end], sums[1, first:end], sums[2, first:end], light[y, first:end]
    for k in range(taps.count):
        shift = taps.dx + k * taps.step
        row, there = weights[k, : end - first], light[taps.y, first + shift : end + shift]
        for i in range(row.shape[0]):
            away, weight = there[i] - here[i], row[i]
            total[i] += weight
            mean[i] += weight * away
            square[i] += weight * away * away


@inlined
def moments_of(total, mean, square, light):
    """Mean and unbiased variance from sums about the centre's ``light``."""
    count = max(total, LEAST)
    average = mean / count
    variance = max(square / count - average * average, ZERO)
    return average + light, variance * (count / max(count - ONE, ONE))


@scalar
def finish_moments(out, total, mean, square, light, y):
    """`moments_of` a row."""
    means, variances, here = out[0, y], out[1, y], light[y]
    for x in range(here.shape[0]):
        means[x], variances[x] = moments_of(total[x], mean[x], square[x], here[x])


@scalar
def noise_row(noise, column, variance, y):
    """A row of the 3x3 means' standard deviation: `edges.blurred` variance, its root, over the root of nine."""
    height, width = variance.shape
    above, here, below = variance[max(y - 1, 0)], variance[y], variance[min(y + 1, height - 1)]
    upper, lower = QUARTER if y > 0 else ZERO, QUARTER if y + 1 < height else ZERO
    norm = ONE / (upper + lower + QUARTER + QUARTER)
    for x in range(width):
        column[x] = (upper * above[x] + (QUARTER + QUARTER) * here[x] + lower * below[x]) * norm
    last = width - 1
    left, right, middle = column[: max(last - 1, 0)], column[2:], column[1 : max(last, 1)]
    inner = noise[1 : max(last, 1)]
    for i in range(inner.shape[0]):
        inner[i] = QUARTER * (left[i] + right[i]) + (QUARTER + QUARTER) * middle[i]
    for x in (0, last):
        beside = column[min(x + 1, last)] if x == 0 else column[x - 1]
        noise[x] = (column[x] + column[x] + beside) / (ONE + ONE + ONE) if width > 1 else column[x]
    for x in range(width):
        noise[x] = deviation_of(noise[x])


@inlined
def deviation_of(blurred):
    """The standard deviation of a 3x3 mean, from the blurred variance there."""
    return math.sqrt(max(blurred, ZERO) + NOISELESS) * THIRD


@inlined
def wavelet_own(light, noise, reach, phi_color):
    """What differences from a pixel cost: a unit of luminance, from its noise, and a square pixel."""
    scale = ROOT / (phi_color * noise + FLOOR * abs(light))
    return Own(light * scale, scale, ROOT * reach)


@scalar
def wavelet_limits(limits, light, reach, y, phi_color):
    """`wavelet_own` of a row, whose noise ``limits`` holds first."""
    here, wide, phi = light[y], reach[y], np.float32(phi_color)
    level, scale, square = limits[0], limits[1], limits[2]
    for x in range(here.shape[0]):
        own = wavelet_own(here[x], level[x], wide[x], phi)
        level[x], scale[x], square[x] = own.level, own.scale, own.limit


@scalar
def spline_shares(i, j):
    """The B-spline's shares of the taps (i, j), (i + 1, j) and (i + 2, j)."""
    down, last = B3[j + 2], len(B3) - 1
    return np.float32(down * B3[i + 2]), np.float32(down * B3[i + 3]), np.float32(down * B3[min(i + 4, last)])


@scalar
def center_row(sums, values, y, run):
    """Begin the sums of a run of a row with the wavelet's middle tap."""
    share, channels = np.float32(B3[2] * B3[2]), values.shape[0] - 1
    first, end = run
    for c in range(channels):
        total, here = sums[c, first:end], values[c, y, first:end]
        for i in range(total.shape[0]):
            total[i] = share * here[i]
    spread, here = sums[channels + 1, first:end], values[channels, y, first:end]
    sums[channels, first:end] = share
    for i in range(spread.shape[0]):
        spread[i] = share * share * here[i]


@inlined
def bilateral_own(light, share, width, tolerance):
    """What differences from a pixel cost: a tolerance, and a square pixel by the spatial Gaussian, which is narrower at
    edges, where few of the four neighbours are on its surface (``share`` of them)."""
    sigma, scale = width * (AT_EDGES + (ONE - AT_EDGES) * QUARTER * share), SLANT / tolerance
    return Own(light * scale, scale, HALF_ROOT / (sigma * sigma))


@scalar
def limits_row(width, tolerance, column, light, variance, y, sigma, sensitivity, phi_color):
    """A row of `reference.limits_reference`."""
    wide, limit, here, spread = width[y], tolerance[y], light[y], variance[y]
    noise_row(limit, column, variance, y)
    for x in range(here.shape[0]):
        wide[x], limit[x] = limits_of(here[x], spread[x], limit[x], sigma, sensitivity, phi_color)


@inlined
def limits_of(light, variance, deviation, sigma, sensitivity, phi_color):
    """Width and tolerance of one pixel; ``deviation`` is that of the 3x3 mean."""
    size = abs(light)
    noise = math.sqrt(max(variance, NOISELESS)) / max(size, MIN_MEAN)
    width = sigma * (NARROWEST + (ONE - NARROWEST) * min(sensitivity * noise, ONE))
    return width, phi_color * deviation + MIN_CONTRAST * size


@scalar
def finish_row(out, sums, total, before, hit, y):
    """Means of a row from their sums; pixels that hit nothing are as before."""
    new, old, known = out[y], before[y], hit[y]
    for x in range(total.shape[0]):
        new[x] = sums[x] / max(total[x], LEAST) if known[x] != ZERO else old[x]
