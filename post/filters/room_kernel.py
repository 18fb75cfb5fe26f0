"""The joint bilateral kernel over a row of pixels, compiled: nine or five taps at a time, weighed and summed at once.

What pixels bring to their taps, and their sums, lie in one array, ``room``, its rows a constant apart. A compiler then
knows that they do not overlap and makes vector instructions of loops that read and write many of them, without a copy
of the weights in between. Names and steps are those of `post.filters.reference`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import contracted, inlined, scalar
from post.filters import constants
from post.filters.constants import DEPTH, HIT, NX, NY, NZ, ROUGHNESS
from post.filters.denoise_kernel import LEAST, Own, bilateral_own, bilateral_unlike
from post.filters.weight_kernel import ROOT, ZERO, edge_with, near_of_plane, power_of, there_row, weight_of

LENGTH = 1936  # pixels: the longest part of a row; rows of room must not lie a multiple of 4 KB apart
TO_X, TO_Y, TO_Z, ALONG, ACROSS, DOWN, AWAY, GLOSS, LEVEL, SCALE, LIMIT, TOTAL, SUMS = (
    np.uint64(k * LENGTH) for k in range(13)
)
ROWS = 12  # of room, before the sums of channels
NEXT = np.uint64(LENGTH)
ONE, TWO, THREE, FOUR, SIX = (np.uint64(k) for k in (1, 2, 3, 4, 6))
GLOSS_FALLOFF = ROOT / np.float32(constants.ROUGHNESS_SCALE)

Kind = namedtuple("Kind", "perspective further rough squares rest least")
"""How geometry counts, see `weight_kernel.Edge`. Whether a camera is perspective, cosines have a power that squarings
do not make, and roughness tells surfaces apart, are lengths of tuples: the compiler knows them."""
Tap = namedtuple("Tap", "there light dy")
"""What taps read: a row of the guide and of luminance; and how far below the pixels it lies."""


@scalar
def kind_of(guide, perspective, further, rough, squares, normal_power):
    """The constants of a weight."""
    edge = edge_with(guide, True, squares, normal_power)
    return Kind(perspective, further, rough, squares, edge.rest, edge.least)


@contracted
@scalar
def fill(room, guide, plane, y, run, depth_sensitivity):
    """What the pixels of a run of a row bring to their taps, but for their light: so far none counts."""
    first, end = run
    depth, nx, ny, nz = (
        guide[DEPTH, y, first:end],
        guide[NX, y, first:end],
        guide[NY, y, first:end],
        guide[NZ, y, first:end],
    )
    along, slope_x = plane[0, y, first:end], plane[1, y, first:end]
    slope_y, scale = plane[2, y, first:end], plane[3, y, first:end]
    rough = guide[ROUGHNESS if guide.shape[0] > ROUGHNESS else HIT, y, first:end]
    sensitivity = np.float32(depth_sensitivity)
    for i in range(np.uint64(end - first)):
        near = near_of_plane(along[i], slope_x[i], slope_y[i], scale[i], sensitivity)
        room[i + TO_X], room[i + TO_Y], room[i + TO_Z] = nx[i], ny[i], nz[i]
        room[i + ALONG], room[i + ACROSS], room[i + DOWN] = near.along, near.x, near.y
        room[i + AWAY], room[i + GLOSS] = near.along * depth[i], rough[i]
        room[i + LEVEL], room[i + SCALE], room[i + LIMIT], room[i + TOTAL] = ZERO, ZERO, ZERO, ZERO


@scalar
def limit(room, light, width, tolerance, y, run, channels):
    """`bilateral_own` of the pixels of a run, whose sums of weights are those of the four neighbours; then no sums."""
    first, end = run
    own_light, wide, limit = light[y, first:end], width[y, first:end], tolerance[y, first:end]
    for i in range(np.uint64(end - first)):
        own = bilateral_own(own_light[i], room[i + TOTAL], wide[i], limit[i])
        room[i + LEVEL], room[i + SCALE], room[i + LIMIT] = own.level, own.scale, own.limit
        room[i + TOTAL] = ZERO
    room[ROWS * LENGTH : (ROWS + channels) * LENGTH] = ZERO


@contracted
@inlined
def _weight(i, j, room, tap, dx, kind):
    """The weight of pixel i's tap, j in what taps read."""
    there, dy = tap.there, tap.dy
    depth, away = there.depth[j], room[i + AWAY]
    if len(kind.perspective) > 0:
        distance = depth * (room[i + ALONG] + room[i + DOWN] * dy + room[i + ACROSS] * dx) - away
    else:
        distance = depth * room[i + ALONG] + (room[i + DOWN] * dy - away + room[i + ACROSS] * dx)
    own = Own(room[i + LEVEL], room[i + SCALE], room[i + LIMIT])
    unlike = bilateral_unlike(own, tap.light[j], dx, dy) + abs(distance)
    if len(kind.rough) > 0:
        unlike += abs(room[i + GLOSS] - there.roughness[j]) * GLOSS_FALLOFF
    cosine = room[i + TO_X] * there.nx[j] + room[i + TO_Y] * there.ny[j] + room[i + TO_Z] * there.nz[j]
    weight = there.hit[j] * weight_of(cosine, unlike, kind)
    if len(kind.further) > 0:
        weight *= power_of(cosine, kind)
    return weight


@contracted
@inlined
def _three(i, j, room, tap, dx, kind):
    """The weights of three taps."""
    further, last = dx + np.float32(1), dx + np.float32(2)
    return (
        _weight(i, j, room, tap, dx, kind),
        _weight(i, j + ONE, room, tap, further, kind),
        _weight(i, j + TWO, room, tap, last, kind),
    )


@contracted
@inlined
def _mix(values, at, weights):
    """Three weighted values."""
    return weights[0] * values[at] + weights[1] * values[at + ONE] + weights[2] * values[at + TWO]


@contracted
@scalar
def _add_nine(room, tap, values, base, size, count, dx, kind, planes):
    for i in range(count):
        a = _three(i, i, room, tap, dx, kind)
        b = _three(i, i + THREE, room, tap, dx + np.float32(3), kind)
        c = _three(i, i + SIX, room, tap, dx + np.float32(6), kind)
        room[i + TOTAL] += (a[0] + a[1] + a[2]) + (b[0] + b[1] + b[2]) + (c[0] + c[1] + c[2])
        for k in range(len(planes)):
            at = base + np.uint64(k) * size + i
            mean = _mix(values, at, a) + _mix(values, at + THREE, b) + _mix(values, at + SIX, c)
            room[SUMS + np.uint64(k) * NEXT + i] += mean


@contracted
@scalar
def _add_five(room, tap, values, base, size, count, dx, kind, planes):
    for i in range(count):
        a = _three(i, i, room, tap, dx, kind)
        d = _weight(i, i + THREE, room, tap, dx + np.float32(3), kind)
        e = _weight(i, i + FOUR, room, tap, dx + np.float32(4), kind)
        room[i + TOTAL] += (a[0] + a[1] + a[2]) + (d + e)
        for k in range(len(planes)):
            at = base + np.uint64(k) * size + i
            mean = _mix(values, at, a) + d * values[at + THREE] + e * values[at + FOUR]
            room[SUMS + np.uint64(k) * NEXT + i] += mean


@contracted
@scalar
def _add_one(room, tap, values, base, size, count, dx, kind, planes):
    for i in range(count):
        weight = _weight(i, i, room, tap, dx, kind)
        room[i + TOTAL] += weight
        for k in range(len(planes)):
            room[SUMS + np.uint64(k) * NEXT + i] += weight * values[base + np.uint64(k) * size + i]


@scalar
def taps_at_once(left):
    """How many taps of a row to add together, of those that are left."""
    return 9 if left >= 9 else (5 if left >= 5 else 1)


@scalar
def parts_of(count):
    """Parts of a row for so many taps: see `weight_kernel.part_of`."""
    return 1 + 2 * count


@scalar
def add_taps(room, guide, light, values, place, run, taps, kind, planes):
    """Add taps to the sums of a run; ``values`` are those of all pictures, and ``place`` is the first's in them."""
    offset, size = taps.first - run[0], np.uint64(guide.shape[1] * guide.shape[2])
    there, begin = there_row(guide, taps), taps.first + taps.dx
    tap = Tap(there, light[taps.y, begin : taps.end + taps.dx + taps.count - 1], np.float32(taps.dy))
    base, count, dx = (
        np.uint64(place + taps.y * guide.shape[2] + begin),
        np.uint64(taps.end - taps.first),
        np.float32(taps.dx),
    )
    part = room[offset:]
    if taps.count == 1:
        _add_one(part, tap, values, base, size, count, dx, kind, planes)
    elif taps.count == 5:
        _add_five(part, tap, values, base, size, count, dx, kind, planes)
    else:
        _add_nine(part, tap, values, base, size, count, dx, kind, planes)


@scalar
def finish(out, room, before, hit, y, run):
    """Means of a run from its sums; pixels that hit nothing are as before."""
    first, end = run
    known = hit[y, first:end]
    for c in range(out.shape[0]):
        new, old, row = out[c, y, first:end], before[c, y, first:end], np.uint64(c) * NEXT + SUMS
        for i in range(np.uint64(end - first)):
            mean = room[i + row] / max(room[i + TOTAL], LEAST)
            new[i] = mean if known[i] != ZERO else old[i]
