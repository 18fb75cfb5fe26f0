"""Edge weights of the filters' taps, compiled.

The cosine between normals is raised to its power by squaring it, as often as the length of a tuple says, which the
compiler knows. The other factors are exponentials: their exponents are added up, and the root of their product, a
polynomial, is squared together with the cosine. Names and steps are those of `post.filters.edges.edge_weight`.

Filters weigh a row of pixels at a time. What these bring to their taps, and their sums, lie in one array, ``room``, its
rows a constant apart. A compiler then knows that they do not overlap and makes vector instructions of loops that read
and write many of them, without a copy of the weights in between.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.approximations import exp2, falling_exp2, log2
from gbufrt.compute.kernel import contracted, inlined, scalar
from post.filters import constants
from post.filters.constants import DEPTH, HIT, NX, NY, NZ, ROUGHNESS
from post.filters.kernel import ROUGHNESS_FALLOFF, Guide, guide_row

LEAST = np.float32(1e-6)
ZERO, ONE, TWO = np.float32(0), np.float32(1), np.float32(2)
SHARED = 5  # squarings of an exponential's root
ROOT = np.float32(0.5**SHARED)  # of exponents: what is added up in place of them
# exp(-32 y) as the 32nd power of a polynomial: within 5e-8, and 1e-6 of itself down to a weight of 0.007, since sums of
# small weights count where all are small; by weighted least squares towards the least maximum
R1, R2, R3, R4 = np.float32(0.9999996), np.float32(0.4999737), np.float32(0.16613403), np.float32(0.0379261)
FARTHEST = np.float32(1.2)  # exponents end here, at a weight of 6e-17
GLOSS_FALLOFF = ROOT / np.float32(constants.ROUGHNESS_SCALE)
LEAST_LOG = np.float32(-62)  # of a cosine's power, to base 2
FAINTEST = np.float32(1e-10)  # weight of a tap beside its pixel, which counts itself: lesser ones, squared and times a
# variance, are denormal numbers, for each of which processors of Intel take over a hundred cycles

Edge = namedtuple("Edge", "perspective squares rest least roughness")
"""How geometry counts: squarings of the cosine (their number is the length), its power beyond these, the least cosine,
and roughness."""
Own = namedtuple("Own", "level scale limit")
"""What a pixel holds against its taps, in roots of exponents: a factor on light, its own light times that, and what a
square pixel away costs."""
Near = namedtuple("Near", "along x y")
"""A row of `edges.Surface.plane`, in roots of exponents for a pixel footprint of distance."""


@scalar
def edge_with(guide, perspective, squares, normal_power):
    """The constants of an edge weight."""
    squared = ONE
    for _ in range(len(squares)):
        squared *= TWO
    roughness = ROUGHNESS_FALLOFF if guide.shape[0] > ROUGHNESS else ZERO
    return Edge(perspective, squares, np.float32(normal_power) - squared, exp2(LEAST_LOG / squared), roughness)


@inlined
def near_of_plane(along, slope_x, slope_y, scale, depth_sensitivity):
    """`Near` of one pixel of the planes."""
    footprint = ROOT * depth_sensitivity * scale
    return Near(footprint * along, footprint * slope_x, footprint * slope_y)


@contracted
@scalar
def near_row(near, plane, y, first, end, depth_sensitivity):
    """Pixels ``first`` to ``end`` of a row of `Near`, for ``near`` ``(3, end - first)``."""
    along, slope_x = plane[0, y, first:end], plane[1, y, first:end]
    slope_y, scale = plane[2, y, first:end], plane[3, y, first:end]
    out_along, out_x, out_y = near[0], near[1], near[2]
    sensitivity = np.float32(depth_sensitivity)
    for x in range(along.shape[0]):
        one = near_of_plane(along[x], slope_x[x], slope_y[x], scale[x], sensitivity)
        out_along[x], out_x[x], out_y[x] = one.along, one.x, one.y


@scalar
def there_row(guide, taps):
    """What taps read of the guide."""
    return guide_row(guide, taps.y, taps.first + taps.dx, taps.end + taps.dx + (taps.count - 1) * taps.step)


@inlined
def guide_at(guide, i):
    """Of rows, one pixel as numbers."""
    return Guide(guide.depth[i], guide.nx[i], guide.ny[i], guide.nz[i], guide.hit[i], guide.roughness[i])


@inlined
def _cosine(here, there):
    return here.nx * there.nx + here.ny * there.ny + here.nz * there.nz


@contracted
@inlined
def weight_of(cosine, unlike, edge):
    """A cosine to its power, as far as squarings make it, times the exponential of -``unlike`` / `ROOT`."""
    cosine, unlike = max(cosine, edge.least), min(unlike, FARTHEST)
    for _ in range(len(edge.squares) - SHARED):
        cosine = cosine * cosine
    root = ONE - unlike * (R1 - unlike * (R2 - unlike * (R3 - unlike * R4)))
    for _ in range(SHARED - len(edge.squares)):
        root = root * root
    weight = cosine * root
    for _ in range(min(len(edge.squares), SHARED)):
        weight = weight * weight
    return weight


@contracted
@inlined
def weight_between(here, near, there, dx, dy, edge, unlike):
    """`edges.edge_weight` of a pixel and its tap, given as numbers, times the exponential of -``unlike`` / `ROOT`, but
    for the factors of `power_between` and `gloss_between`."""
    factor = there.depth if edge.perspective else ONE
    distance = near.along * (there.depth - here.depth) + (near.x * dx + near.y * dy) * factor
    return there.hit * weight_of(_cosine(here, there), unlike + abs(distance), edge)


@contracted
@inlined
def power_of(cosine, edge):
    """The power of a cosine that squarings do not make."""
    return exp2(edge.rest * log2(min(max(cosine, edge.least), ONE)))


@contracted
@inlined
def power_between(here, there, edge):
    """`power_of` the cosine between a pixel and its tap."""
    return power_of(_cosine(here, there), edge)


@contracted
@inlined
def gloss_between(here, there, edge):
    """What a difference of roughness leaves of a weight."""
    return falling_exp2(-abs(here.roughness - there.roughness) * edge.roughness)


@contracted
@inlined
def edge_weight(i, here, near, j, there, dx, dy, edge, unlike):
    """`weight_between` of pixel i and its tap j, in rows."""
    own = Near(near.along[i], near.x[i], near.y[i])
    return weight_between(guide_at(here, i), own, guide_at(there, j), dx, dy, edge, unlike)


LENGTH = 1936  # pixels: the longest part of a row; rows of room must not lie a multiple of 4 KB apart
TO_X, TO_Y, TO_Z, ALONG, ACROSS, DOWN, AWAY, GLOSS, LEVEL, SCALE, LIMIT, TOTAL, SPREAD, SUMS = (
    np.uint64(k * LENGTH) for k in range(14)
)
ROWS = 13  # of room, before the sums of channels
NEXT = np.uint64(LENGTH)
Kind = namedtuple("Kind", "perspective further rough squares rest least")
"""How geometry counts, see `Edge`. Whether a camera is perspective, cosines have a power that squarings
do not make, and roughness tells surfaces apart, are lengths of tuples: the compiler knows them."""


@scalar
def kind_of(guide, perspective, further, rough, squares, normal_power):
    """The constants of a weight."""
    edge = edge_with(guide, True, squares, normal_power)
    return Kind(perspective, further, rough, squares, edge.rest, edge.least)


@contracted
@scalar
def fill(room, guide, plane, y, run, depth_sensitivity):
    """What the pixels of a run of a row bring to their taps, but for their light; none counted so far."""
    first, end = run
    depth, nx = guide[DEPTH, y, first:end], guide[NX, y, first:end]
    ny, nz = guide[NY, y, first:end], guide[NZ, y, first:end]
    along, slope_x = plane[0, y, first:end], plane[1, y, first:end]
    slope_y, scale = plane[2, y, first:end], plane[3, y, first:end]
    rough = guide[ROUGHNESS if guide.shape[0] > ROUGHNESS else HIT, y, first:end]
    sensitivity = np.float32(depth_sensitivity)
    for i in range(np.uint64(end - first)):
        near = near_of_plane(along[i], slope_x[i], slope_y[i], scale[i], sensitivity)
        room[i + TO_X], room[i + TO_Y], room[i + TO_Z] = nx[i], ny[i], nz[i]
        room[i + ALONG], room[i + ACROSS], room[i + DOWN] = near.along, near.x, near.y
        room[i + AWAY], room[i + GLOSS] = near.along * depth[i], rough[i]
        room[i + TOTAL] = ZERO


@contracted
@inlined
def room_weight(i, room, j, there, dx, dy, kind, unlike):
    """`edges.edge_weight` of pixel i and its tap, j in rows, times the exponential of -``unlike`` / `ROOT`."""
    depth, away = there.depth[j], room[i + AWAY]
    if len(kind.perspective) > 0:
        distance = depth * (room[i + ALONG] + room[i + DOWN] * dy + room[i + ACROSS] * dx) - away
    else:
        distance = depth * room[i + ALONG] + (room[i + DOWN] * dy - away + room[i + ACROSS] * dx)
    unlike += abs(distance)
    if len(kind.rough) > 0:
        unlike += abs(room[i + GLOSS] - there.roughness[j]) * GLOSS_FALLOFF
    cosine = room[i + TO_X] * there.nx[j] + room[i + TO_Y] * there.ny[j] + room[i + TO_Z] * there.nz[j]
    weight = weight_of(cosine, unlike, kind)
    if len(kind.further) > 0:
        weight *= power_of(cosine, kind)
    return there.hit[j] * max(weight, FAINTEST)
