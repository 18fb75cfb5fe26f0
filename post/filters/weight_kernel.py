"""Edge weights of the filters' taps, compiled: a row of pixels at a time, and three taps where all lie in the picture.

What a pixel brings to its taps is prepared once a row. The cosine between normals is raised to its power by squaring
it, as often as the length of a tuple says, which the compiler knows. The other factors are exponentials: their
exponents are added up, and the root of their product, a polynomial, is squared together with the cosine. Three taps
share what they read of their pixel. Names and steps are those of `post.filters.edges.edge_weight`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.approximations import exp2, falling_exp2, log2
from gbufrt.compute.kernel import contracted, inlined, scalar
from post.filters.constants import ROUGHNESS
from post.filters.kernel import ROUGHNESS_FALLOFF, Guide, guide_row

ZERO, ONE, TWO = np.float32(0), np.float32(1), np.float32(2)
SHARED = 5  # squarings of an exponential's root
ROOT = np.float32(0.5**SHARED)  # of exponents: what is added up in place of them
# exp(-32 y) as the 32nd power of a polynomial: within 5e-8, and 1e-6 of itself down to a weight of 0.007, since sums of
# small weights count where all are small; by weighted least squares towards the least maximum
R1, R2, R3, R4 = np.float32(0.9999996), np.float32(0.4999737), np.float32(0.16613403), np.float32(0.0379261)
FARTHEST = np.float32(1.2)  # exponents end here, at a weight of 6e-17
LEAST_LOG = np.float32(
    -62
)  # of a cosine's power, to base 2: no product of these is so small that it takes processors longer
GROUP = 3  # taps at a time
PARTS = 1 + 2 * GROUP  # of a row: where all taps of a group lie in the picture, and for each what is left and right

Edge = namedtuple("Edge", "perspective squares rest least roughness")
"""How geometry counts: squarings of the cosine (their number is the length), its power beyond these, the least cosine,
and roughness."""
Taps = namedtuple("Taps", "y first end dx dy step count number")
"""One tap or several: their row, which pixels of the centre's row they serve, the first's place, pixels between them,
and the first's number in its group."""
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
def part_of(part, y, span, place, step, count, size):
    """The taps of a group that a part of a row has: see `PARTS`; empty where there is nothing.

    Args:
        part: below `PARTS`.
        y: the centre's row.
        span: first pixel of the row that counts, and the one after the last.
        place: (dx, dy) of the first tap, pixels.
        step: pixels from tap to tap.
        count: of taps in the group.
        size: (height, width).
    """
    (first, end), (dx, dy), (height, width) = span, place, size
    low, high = max(first, -dx), min(end, width - dx - (count - 1) * step)
    if count < GROUP or low >= high:
        low, high = end, end
    row, number = y + dy, (part - 1) // 2
    here = dx + number * step
    if part == 0:
        number, here, begin, stop = 0, dx, low, high
    elif part % 2 == 1:
        begin, stop = max(first, -here), min(low, end, width - here)
    else:
        begin, stop = max(high, -here), min(end, width - here)
    if number >= count or not 0 <= row < height or begin >= stop:
        return Taps(y, first, first, 0, 0, 0, 1, 0)
    return Taps(row, begin, stop, here, dy, step, count if part == 0 else 1, number)


@scalar
def near_of(near, taps):
    """The pixels of a prepared row that taps serve."""
    return Near(near[0, taps.first : taps.end], near[1, taps.first : taps.end], near[2, taps.first : taps.end])


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


@contracted
@scalar
def weigh_further(weights, guide, y, taps, edge):
    """Multiply weights by what few filters need: `power_between` and `gloss_between`."""
    here, every = guide_row(guide, y, taps.first, taps.end), there_row(guide, taps)
    for k in range(taps.count):
        row, shift = weights[k, : taps.end - taps.first], np.uint64(k * taps.step)
        if edge.rest != ZERO:
            for i in range(np.uint64(row.shape[0])):
                row[i] *= power_between(guide_at(here, i), guide_at(every, i + shift), edge)
        if edge.roughness != ZERO:
            for i in range(np.uint64(row.shape[0])):
                row[i] *= gloss_between(guide_at(here, i), guide_at(every, i + shift), edge)


@scalar
def surface_weights(weights, guide, near, y, taps, edge):
    """The weights of taps by surface alone, for a row of pixels."""
    here, there, near = guide_row(guide, y, taps.first, taps.end), there_row(guide, taps), near_of(near, taps)
    size, step, gap = np.uint64(taps.end - taps.first), np.uint64(taps.step), np.float32(taps.step)
    one, two, three = weights[0, :size], weights[1, :size], weights[2, :size]
    dx, dy = np.float32(taps.dx), np.float32(taps.dy)
    if taps.count == 1:
        for i in range(size):
            one[i] = edge_weight(i, here, near, i, there, dx, dy, edge, ZERO)
    else:
        for i in range(size):
            one[i] = edge_weight(i, here, near, i, there, dx, dy, edge, ZERO)
            two[i] = edge_weight(i, here, near, i + step, there, dx + gap, dy, edge, ZERO)
            three[i] = edge_weight(i, here, near, i + step + step, there, dx + gap + gap, dy, edge, ZERO)
    weigh_further(weights, guide, y, taps, edge)


@contracted
@scalar
def add_values(sums, weights, values, taps, channels):
    """Add weighted values to the sums of a row, and weights to the sum after them."""
    first, end, step = taps.first, taps.end, np.uint64(taps.step)
    size, reach = end - first, end + taps.dx + (taps.count - 1) * taps.step
    one, two, three = weights[0, :size], weights[1, :size], weights[2, :size]
    weight = sums[channels, first:end]
    if taps.count == 1:
        for c in range(channels):
            total, there = sums[c, first:end], values[c, taps.y, first + taps.dx : reach]
            for i in range(size):
                total[i] += one[i] * there[i]
        for i in range(size):
            weight[i] += one[i]
        return
    for c in range(channels):
        total, there = sums[c, first:end], values[c, taps.y, first + taps.dx : reach]
        for i in range(np.uint64(size)):
            total[i] += one[i] * there[i] + two[i] * there[i + step] + three[i] * there[i + step + step]
    for i in range(size):
        weight[i] += one[i] + two[i] + three[i]


@contracted
@scalar
def add_spread(spread, weights, variance, taps):
    """Add the taps' variance, weighted as that of a mean."""
    total = spread[taps.first : taps.end]
    for k in range(taps.count):
        shift = taps.dx + k * taps.step
        row, there = weights[k, : total.shape[0]], variance[taps.y, taps.first + shift : taps.end + shift]
        for i in range(row.shape[0]):
            total[i] += row[i] * row[i] * there[i]
