"""The compiled forms of the functions of `post.history.antilag` whose names end on ``reference``: pixels of a row as a
body.

Names and steps are those of that torch code, which is the definition. As in `post.filters.kernel`, neighbours are
shifted rows, and every loop over a row becomes vector instructions. Rows of scratch begin at ``first``. A state's
planes are the mean (C), the fast mean (lead), two moments, the sum of squared weights, and the age.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import in_lanes, inlined, scalar
from gbufrt.luminance import REC709
from post.history import constants
from post.history.constants import POOL

ZERO, ONE, TWO, EIGHT, NINE = np.float32(0), np.float32(1), np.float32(2), np.float32(8), np.float32(9)
TINY, LEAST = np.float32(1e-12), np.float32(1e-6)
RED, GREEN, BLUE = (np.float32(share) for share in REC709)
YOUNG, LEAST_POOL = np.float32(constants.YOUNG), LEAST * np.float32((2 * POOL + 1) ** 2)
NOTICED, FAST_FRAMES = np.float32(constants.NOTICED), np.float32(constants.FAST_FRAMES)
LEAST_FAST, LEAST_MOMENTS = np.float32(1 - constants.FAST_BLEND), np.float32(1 - constants.MOMENTS_BLEND)
FEW_MOMENTS = np.float32((1 + constants.MOMENTS_BLEND) / (1 - constants.MOMENTS_BLEND))


@inlined
def luminance_of(planes, lead, y, x):
    """`signals.luminance` of one pixel."""
    if lead < 3:
        return planes[0, y, x]
    return RED * planes[0, y, x] + GREEN * planes[1, y, x] + BLUE * planes[2, y, x]


@inlined
def _own_variance(first, second, age):
    """`antilag.sample_variance` of one pixel."""
    count = min(max(age, TWO), FEW_MOMENTS)
    return max(second - first * first, ZERO) * count / (count - ONE)


@inlined
def _pooled_variance(first, second, age, sums):
    """`antilag.typical_variance` of one pixel, from its window's sums: of the variance of those with a history long
    enough and their number, of the second and the first moment of all that have one, and their number."""
    own, mature, square, mean, visible = sums
    mean /= max(visible, LEAST_POOL)
    around = square / max(visible, LEAST_POOL) - mean * mean
    typical = max(_own_variance(first, second, age), own / max(mature, LEAST_POOL))
    return max(typical, around) if age < YOUNG else typical


@scalar
def _noise_pixel(noise, sums, state, plane, y, x, end):
    """As `noise_row`, of one pixel: a GPU's thread keeps its sums in registers."""
    means, squares, ages, own, mature = state[plane], state[plane + 1], state[plane + 3], ZERO, ZERO
    (height, width), square, mean, visible = means.shape, ZERO, ZERO, ZERO
    for row in range(max(y - POOL, 0), min(y + POOL + 1, height)):
        for column in range(max(x - POOL, 0), min(x + POOL + 1, width)):
            r, k = np.uint64(row), np.uint64(column)  # never below zero: nothing to wrap
            first, second, age = means[r, k], squares[r, k], ages[r, k]
            old, seen = ONE if age >= YOUNG else ZERO, ONE if age > ZERO else ZERO
            own, mature = own + _own_variance(first, second, age) * old, mature + old
            square, mean, visible = square + second * seen, mean + first * seen, visible + seen
    found = own, mature, square, mean, visible
    noise[0] = _pooled_variance(means[y, x], squares[y, x], ages[y, x], found)


@in_lanes(_noise_pixel)
@scalar
def noise_row(noise, sums, state, plane, y, first, end):
    """A row of `antilag.typical_variance`; ``plane`` is that of the first moment."""
    mean, square, ages = state[plane], state[plane + 1], state[plane + 3]
    height, width = mean.shape
    begin, stop = max(first - POOL, 0), min(end + POOL, width)
    start, after = begin - first + POOL, stop - first + POOL
    sums[:] = 0
    for row in range(max(y - POOL, 0), min(y + POOL + 1, height)):
        m1, m2, age = mean[row, begin:stop], square[row, begin:stop], ages[row, begin:stop]
        s0, s1, s2 = sums[0, start:after], sums[1, start:after], sums[2, start:after]
        s3, s4 = sums[3, start:after], sums[4, start:after]
        for x in range(age.shape[0]):
            mature, visible = ONE if age[x] >= YOUNG else ZERO, ONE if age[x] > ZERO else ZERO
            s0[x] += _own_variance(m1[x], m2[x], age[x]) * mature
            s1[x] += mature
            s2[x] += m2[x] * visible
            s3[x] += m1[x] * visible
            s4[x] += visible
    m1, m2, age = mean[y, first:end], square[y, first:end], ages[y, first:end]
    for x in range(age.shape[0]):
        own, mature, second, average, visible = ZERO, ZERO, ZERO, ZERO, ZERO
        for k in range(2 * POOL + 1):
            own += sums[0, x + k]
            mature += sums[1, x + k]
            second += sums[2, x + k]
            average += sums[3, x + k]
            visible += sums[4, x + k]
        noise[x] = _pooled_variance(m1[x], m2[x], age[x], (own, mature, second, average, visible))


@scalar
def sample_row(sample, sums, signal, state, noise, lead, firefly, y, first, end):
    """A row of `antilag.without_fireflies`."""
    channels, height, width = signal.shape
    ages, scale = state[state.shape[0] - 1, y, first:end], sums[2]
    sums[:2] = 0
    top, bottom = max(y - 1, 0), min(y + 2, height)
    for row in range(top, bottom):
        for x in range(max(first - 1, 0), min(end + 1, width)):
            light = luminance_of(signal, lead, row, x)
            sums[0, x - first + 1] += light
            sums[1, x - first + 1] += light * light
    for x in range(pixels(noise.shape[0])):
        light = luminance_of(signal, lead, y, first + x)
        nine = NINE / np.float32((bottom - top) * (min(first + x + 2, width) - max(first + x - 1, 0)))
        around = (nine * (sums[0, x] + sums[0, x + 1] + sums[0, x + 2]) - light) / EIGHT
        square = (nine * (sums[1, x] + sums[1, x + 1] + sums[1, x + 2]) - light * light) / EIGHT
        spread = max(square - around * around, ZERO)
        own = luminance_of(state, lead, y, first + x) + firefly * math.sqrt(noise[x] + TINY)
        limit = max(own, around + firefly * math.sqrt(spread + TINY))
        cut = ages[x] > ZERO and light > limit and limit > ZERO and firefly > ZERO
        scale[x] = limit / max(light, TINY) if cut else ONE
    for c in range(channels):
        given, kept = signal[c, y, first:end], sample[c, y, first:end]
        for x in range(pixels(kept.shape[0])):
            kept[x] = given[x] * (scale[x] if c < lead else ONE)


@scalar
def differences_row(out, signal, noise, state, first, lead, y, begin, end):
    """Pixels ``begin`` to ``end`` of a row of `antilag.differences_reference`."""
    fast, slow = state[state.shape[0] - lead - 4 :], first.shape[0] > 0
    for c in range(lead):
        new, quick = out[c, y, begin:end], fast[c, y, begin:end]
        if slow:
            shift, old = first[c, y, begin:end], state[c, y, begin:end]
            for x in range(pixels(new.shape[0])):
                new[x] = quick[x] + shift[x] - old[x]
        else:
            own = signal[c, y, begin:end]
            for x in range(pixels(new.shape[0])):
                new[x] = own[x] - quick[x]
    ages, variance, left = state[state.shape[0] - 1, y, begin:end], noise[y, begin:end], out[lead, y, begin:end]
    for x in range(pixels(left.shape[0])):
        age = max(ages[x], ONE)
        left[x] = variance[x] * (ONE / min(age, FAST_FRAMES) + (ONE / age if slow else ONE))


@scalar
def unexplained_row(out, explained, averaged, state, lead, clamp, slow, y, first, end):
    """A row of `antilag.unexplained_reference`; ``explained`` holds the largest difference first, then the share."""
    fast = state[state.shape[0] - lead - 4 :]
    ages, spread = state[state.shape[0] - 1, y, first:end], averaged[lead, y, first:end]
    for x in range(pixels(explained.shape[0])):
        explained[x] = ZERO
    for c in range(lead):
        difference = averaged[c, y, first:end]
        for x in range(pixels(explained.shape[0])):
            explained[x] = max(explained[x], abs(difference[x]))
    for x in range(pixels(explained.shape[0])):
        floor = NOTICED * abs(luminance_of(fast, lead, y, first + x)) + LEAST
        allowed = clamp * math.sqrt(max(spread[x], ZERO) + TINY) + floor
        left = min(allowed / max(explained[x], TINY), ONE)
        explained[x] = left * left
    light = state if slow else fast
    for c in range(lead):
        shift, difference, old = out[c, y, first:end], averaged[c, y, first:end], light[c, y, first:end]
        for x in range(pixels(explained.shape[0])):
            known = difference[x] * (ONE - explained[x]) if ages[x] > ZERO else ZERO
            shift[x] = max(known, -max(old[x], ZERO))
    if slow:
        share = out[lead, y, first:end]
        for x in range(pixels(explained.shape[0])):
            share[x] = explained[x]


@scalar
def age_row(out, alpha, slow, state, longest, y, first, end):
    """The length and the sum of squared weights of a row, and the share ``alpha`` that this frame's sample gets."""
    follows = slow.shape[0] > 0
    explained = slow[max(slow.shape[0], 1) - 1, y, first:end] if follows else alpha
    last = out.shape[0] - 1
    ages, shares, most = state[last, y, first:end], state[last - 1, y, first:end], longest[y, first:end]
    lengths, squares = out[last, y, first:end], out[last - 1, y, first:end]
    for x in range(pixels(alpha.shape[0])):
        age = ages[x]
        younger = ONE + (age - ONE) * explained[x] if follows and age > ONE else age
        length = min(younger + ONE, max(most[x], ONE)) if age > ZERO else ONE
        weight = ONE / length
        squares[x] = shares[x] * age / max(younger, LEAST) * (ONE - weight) * (ONE - weight) + weight * weight
        lengths[x], alpha[x] = length, weight


@scalar
def blend_row(out, alpha, sample, fast, slow, state, lead, y, first, end):
    """The means and moments of a row with this frame's sample, first moved by ``fast`` and ``slow`` if not empty."""
    width, follows, channels = pixels(alpha.shape[0]), fast.shape[0] > 0, sample.shape[0]
    for c in range(channels):
        new, old, own = out[c, y, first:end], state[c, y, first:end], sample[c, y, first:end]
        if follows and c < lead:
            shift = slow[c, y, first:end]
            for x in range(width):
                before = old[x] + shift[x]
                new[x] = before + alpha[x] * (own[x] - before)
        else:
            for x in range(width):
                new[x] = old[x] + alpha[x] * (own[x] - old[x])
    for c in range(lead):
        new, old, own = out[channels + c, y, first:end], state[channels + c, y, first:end], sample[c, y, first:end]
        if follows:
            shift = fast[c, y, first:end]
            for x in range(width):
                before = old[x] + shift[x]
                new[x] = before + max(alpha[x], LEAST_FAST) * (own[x] - before)
        else:
            for x in range(width):
                new[x] = old[x] + max(alpha[x], LEAST_FAST) * (own[x] - old[x])
    mean, square = out[channels + lead, y, first:end], out[channels + lead + 1, y, first:end]
    old_mean, old_square = state[channels + lead, y, first:end], state[channels + lead + 1, y, first:end]
    for x in range(width):
        quick, light = max(alpha[x], LEAST_MOMENTS), luminance_of(sample, lead, y, first + x)
        shift = luminance_of(fast, lead, y, first + x) if follows else ZERO
        first_moment = old_mean[x] + shift
        second = old_square[x] + shift * (TWO * old_mean[x] + shift)
        mean[x] = first_moment + quick * (light - first_moment)
        square[x] = second + quick * (light * light - second)
