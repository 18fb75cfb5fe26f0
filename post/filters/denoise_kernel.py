"""Wavelets and moments over a row of pixels, compiled: five or three taps at a time, weighed and summed at once.

Names and steps are those of `post.filters.reference`; see `post.filters.weight_kernel.room_weight`.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import contracted, inlined, scalar
from post.filters import constants
from post.filters.constants import B3
from post.filters.weight_kernel import (
    LEAST,
    LEVEL,
    LIMIT,
    NEXT,
    ONE,
    ROOT,
    SCALE,
    SPREAD,
    SUMS,
    TOTAL,
    TWO,
    ZERO,
    Own,
    room_weight,
    there_row,
)  # fmt: skip

FLOOR, MIDDLE = np.float32(constants.FLOOR), np.float32(B3[2] * B3[2])
FIRST, SECOND, THIRD, FOURTH = (np.uint64(k) for k in (1, 2, 3, 4))
MEAN, SQUARE = SUMS, SUMS + NEXT


@contracted
@inlined
def wavelet_unlike(own, other, dx, dy):
    """What light and distance do to one tap of `reference.wavelet_reference`, as `weight_between` takes it."""
    return abs(other * own.scale - own.level) + own.limit * (dx * dx + dy * dy)


@inlined
def moments_of(total, mean, square, light):
    """Mean and unbiased variance from sums about the centre's ``light``."""
    count = max(total, LEAST)
    average = mean / count
    variance = max(square / count - average * average, ZERO)
    return average + light, variance * (count / max(count - ONE, ONE))


@inlined
def wavelet_own(light, noise, reach, phi_color):
    """What differences from a pixel cost: a unit of luminance, from its noise, and a square pixel."""
    scale = ROOT / (phi_color * noise + FLOOR * abs(light))
    return Own(light * scale, scale, ROOT * reach)


@scalar
def begin_wavelet(room, values, noise, reach, y, run, phi_color, planes):
    """`wavelet_own` of the pixels of a run, and their sums with the middle tap alone."""
    first, end = run
    light, phi = values[len(planes) - 1, y, first:end], np.float32(phi_color)
    wide = reach[min(y, reach.shape[0] - 1), first:end]
    deviation, variance = noise[first:end], values[len(planes), y, first:end]
    for i in range(np.uint64(end - first)):
        own = wavelet_own(light[i], deviation[i], wide[i], phi)
        room[i + LEVEL], room[i + SCALE], room[i + LIMIT] = own.level, own.scale, own.limit
        room[i + TOTAL], room[i + SPREAD] = MIDDLE, MIDDLE * MIDDLE * variance[i]
    for k in range(len(planes)):
        row, here = np.uint64(k) * NEXT + SUMS, values[k, y, first:end]
        for i in range(np.uint64(end - first)):
            room[i + row] = MIDDLE * here[i]


@contracted
@inlined
def _wavelet_weight(i, j, room, there, light, dx, dy, kind):
    own = Own(room[i + LEVEL], room[i + SCALE], room[i + LIMIT])
    return room_weight(i, room, j, there, dx, dy, kind, wavelet_unlike(own, light, dx, dy))


@contracted
@scalar
def _add_wavelet(room, there, values, base, size, count, step, dx, dy, shares, kind, planes, middle):
    """Five taps of a row; without the middle one where ``middle`` is empty."""
    gap, step, light = np.float32(step), np.uint64(step), np.uint64(len(planes) - 1) * size + base
    for i in range(count):
        j, m = i + step, i + step + step + step
        k, n = j + step, m + step
        a = shares[0] * _wavelet_weight(i, i, room, there, values[light + i], dx, dy, kind)
        b = shares[1] * _wavelet_weight(i, j, room, there, values[light + j], dx + gap, dy, kind)
        d = shares[1] * _wavelet_weight(i, m, room, there, values[light + m], -dx - gap, dy, kind)
        e = shares[0] * _wavelet_weight(i, n, room, there, values[light + n], -dx, dy, kind)
        c = ZERO
        if len(middle) > 0:
            c = shares[2] * _wavelet_weight(i, k, room, there, values[light + k], ZERO, dy, kind)
        room[i + TOTAL] += (a + b + c) + (d + e)
        for p in range(len(planes)):
            at = base + np.uint64(p) * size
            total = a * values[at + i] + b * values[at + j] + d * values[at + m] + e * values[at + n]
            if len(middle) > 0:
                total += c * values[at + k]
            room[SUMS + np.uint64(p) * NEXT + i] += total
        at = light + size
        spread = a * a * values[at + i] + b * b * values[at + j] + d * d * values[at + m] + e * e * values[at + n]
        if len(middle) > 0:
            spread += c * c * values[at + k]
        room[i + SPREAD] += spread


@contracted
@scalar
def _add_tap(room, there, values, base, size, count, dx, dy, share, kind, planes):
    light = np.uint64(len(planes) - 1) * size + base
    for i in range(count):
        weight = share * _wavelet_weight(i, i, room, there, values[light + i], dx, dy, kind)
        room[i + TOTAL] += weight
        room[i + SPREAD] += weight * weight * values[light + size + i]
        for k in range(len(planes)):
            room[SUMS + np.uint64(k) * NEXT + i] += weight * values[base + np.uint64(k) * size + i]


@scalar
def add_wavelet(room, guide, values, place, run, taps, down, kind, planes):
    """Add taps of row ``down`` of the B-spline to the sums of a run; ``values`` are those of all pictures, and
    ``place`` is the first's in them."""
    size = np.uint64(guide.shape[1] * guide.shape[2])
    there, begin, part = there_row(guide, taps), taps.first + taps.dx, room[taps.first - run[0] :]
    base, count = np.uint64(place + taps.y * guide.shape[2] + begin), np.uint64(taps.end - taps.first)
    dx, dy, share = np.float32(taps.dx), np.float32(taps.dy), B3[down]
    if taps.count == 1:
        across = np.float32(share * B3[taps.number])
        if taps.dx != 0 or taps.dy != 0:
            _add_tap(part, there, values, base, size, count, dx, dy, across, kind, planes)
        return
    shares = np.float32(share * B3[0]), np.float32(share * B3[1]), np.float32(share * B3[2])
    if taps.dy == 0:
        _add_wavelet(part, there, values, base, size, count, taps.step, dx, dy, shares, kind, planes, ())
    else:
        _add_wavelet(part, there, values, base, size, count, taps.step, dx, dy, shares, kind, planes, (0,))


@scalar
def finish_wavelet(out, room, before, hit, y, run, planes):
    """Means of a run from its sums, and their variance; pixels that hit nothing are as before."""
    first, end = run
    known = hit[y, first:end]
    for k in range(len(planes)):
        new, old, row = out[k, y, first:end], before[k, y, first:end], np.uint64(k) * NEXT + SUMS
        for i in range(np.uint64(end - first)):
            mean = room[i + row] / max(room[i + TOTAL], LEAST)
            new[i] = mean if known[i] != ZERO else old[i]
    new, old = out[len(planes), y, first:end], before[len(planes), y, first:end]
    for i in range(np.uint64(end - first)):
        total = room[i + TOTAL]
        left = room[i + SPREAD] / max(total * total, LEAST)
        new[i] = left if known[i] != ZERO else old[i]


@scalar
def begin_moments(room, light, y, run):
    """Sums of the moments about the light of the pixels of a run: none so far."""
    first, end = run
    here = light[y, first:end]
    for i in range(np.uint64(end - first)):
        room[i + LEVEL], room[i + MEAN], room[i + SQUARE] = here[i], ZERO, ZERO


@contracted
@inlined
def _moment(i, j, room, there, light, dx, dy, kind):
    """A weight, and that times the first and second power of a tap's light about the pixel's."""
    weight = room_weight(i, room, j, there, dx, dy, kind, ZERO)
    away = light[j] - room[i + LEVEL]
    return weight, weight * away, weight * away * away


@contracted
@scalar
def _add_five_moments(room, there, light, count, dx, dy, kind):
    for i in range(count):
        a = _moment(i, i, room, there, light, dx, dy, kind)
        b = _moment(i, i + FIRST, room, there, light, dx + ONE, dy, kind)
        c = _moment(i, i + SECOND, room, there, light, dx + TWO, dy, kind)
        d = _moment(i, i + THIRD, room, there, light, dx + TWO + ONE, dy, kind)
        e = _moment(i, i + FOURTH, room, there, light, dx + TWO + TWO, dy, kind)
        room[i + TOTAL] += (a[0] + b[0]) + c[0] + (d[0] + e[0])
        room[i + MEAN] += (a[1] + b[1]) + c[1] + (d[1] + e[1])
        room[i + SQUARE] += (a[2] + b[2]) + c[2] + (d[2] + e[2])


@contracted
@scalar
def _add_three_moments(room, there, light, count, dx, dy, kind):
    for i in range(count):
        a = _moment(i, i, room, there, light, dx, dy, kind)
        b = _moment(i, i + FIRST, room, there, light, dx + ONE, dy, kind)
        c = _moment(i, i + SECOND, room, there, light, dx + TWO, dy, kind)
        room[i + TOTAL] += a[0] + b[0] + c[0]
        room[i + MEAN] += a[1] + b[1] + c[1]
        room[i + SQUARE] += a[2] + b[2] + c[2]


@contracted
@scalar
def _add_moment(room, there, light, count, dx, dy, kind):
    for i in range(count):
        a = _moment(i, i, room, there, light, dx, dy, kind)
        room[i + TOTAL] += a[0]
        room[i + MEAN] += a[1]
        room[i + SQUARE] += a[2]


@scalar
def add_moments(room, guide, light, run, taps, kind):
    """Add taps to the sums of a run."""
    there, begin, part = there_row(guide, taps), taps.first + taps.dx, room[taps.first - run[0] :]
    row, count = light[taps.y, begin : taps.end + taps.dx + taps.count - 1], np.uint64(taps.end - taps.first)
    if taps.count == 1:
        _add_moment(part, there, row, count, np.float32(taps.dx), np.float32(taps.dy), kind)
    elif taps.count == 3:
        _add_three_moments(part, there, row, count, np.float32(taps.dx), np.float32(taps.dy), kind)
    else:
        _add_five_moments(part, there, row, count, np.float32(taps.dx), np.float32(taps.dy), kind)


@scalar
def moments_at_once(left):
    """How many taps of a row to add together, of those that are left."""
    return 5 if left >= 5 else (3 if left >= 3 else 1)


@scalar
def finish_moments(out, room, y, run):
    """`moments_of` the pixels of a run."""
    first, end = run
    means, variances = out[0, y, first:end], out[1, y, first:end]
    for i in range(np.uint64(end - first)):
        found = moments_of(room[i + TOTAL], room[i + MEAN], room[i + SQUARE], room[i + LEVEL])
        means[i], variances[i] = found
