"""Surfaces and edge weights of single taps, compiled: a row of pixels as a body.

Names and steps are those of `post.filters.edges`, the definition. Taps are fixed, so a row of them is a shifted row of
the picture: every loop over a row becomes vector instructions. The factors of a weight are added up as exponents of 2
and raised once. Rows hold the pixels ``first`` to ``end`` of the picture. `post.filters.weight_kernel` weighs taps of
the denoisers.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.approximations import LOG2_E, exp2, log2
from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import inlined, scalar
from post.filters import constants
from post.filters.constants import DEPTH, HIT, NX, NY, NZ, ROUGHNESS

ZERO, ONE = np.float32(0), np.float32(1)
GAP = 64  # pixels that were not hit, from which on a row is filtered in pieces
TINY, NEVER = np.float32(1e-30), np.float32(-1e4)
SHORTEST = np.float32(constants.SHORTEST)
HALF, NEAREST = np.float32(0.5), np.float32(1e-9)
ROUGHNESS_FALLOFF = LOG2_E / np.float32(constants.ROUGHNESS_SCALE)

Guide = namedtuple("Guide", "depth nx ny nz hit roughness")
"""A row of `edges.Surface.guide`; the row of hits stands in for a roughness that is not there."""
Plane = namedtuple("Plane", "along x y scale")
"""A row of `edges.Surface.plane`."""
Edge = namedtuple("Edge", "perspective sensitivity power away roughness")
"""How geometry counts: sensitivities in powers of 2; ``away``: exponent of normals more than a right angle apart."""
Tap = namedtuple("Tap", "y first end dx dy")
"""Where a tap's row lies, and which pixels of the centre's row it serves: ``dx``, ``dy`` are pixels."""

Taps = namedtuple("Taps", "y first end dx dy step count number")
"""One tap or several: their row, which pixels of the centre's row they serve, the first's place, pixels between them,
and the first's number in its group."""


@inlined
def _copy(row, given):
    for x in range(pixels(row.shape[0])):
        row[x] = given[x]


@scalar
def surface_row(guide, plane, depth, normal, hit, roughness, lens, pose, parallel, y, first, end):
    """Pixels ``first`` to ``end`` of a row of `edges.surface_reference`; ``lens`` is `Camera.lens`."""
    z, there, known = depth[y, first:end], hit[y, first:end], guide[HIT, y, first:end]
    nx, ny, nz = normal[0, y, first:end], normal[1, y, first:end], normal[2, y, first:end]
    _copy(guide[DEPTH, y, first:end], z)
    _copy(guide[NX, y, first:end], nx)
    _copy(guide[NY, y, first:end], ny)
    _copy(guide[NZ, y, first:end], nz)
    for k in range(roughness.shape[0]):
        _copy(guide[ROUGHNESS + k, y, first:end], roughness[k, y, first:end])
    xx, xy, xz = pose[0, 0], pose[0, 1], pose[0, 2]
    yx, yy, yz = pose[1, 0], pose[1, 1], pose[1, 2]
    zx, zy, zz = pose[2, 0], pose[2, 1], pose[2, 2]
    focal_x, focal_y, center_x, jitter_x = lens[0], lens[1], lens[2], lens[4]
    along, slope_x = plane[0, y, first:end], plane[1, y, first:end]
    slope_y, scale = plane[2, y, first:end], plane[3, y, first:end]
    ray_y = (np.float32(y) + HALF + lens[5] - lens[3]) / focal_y
    for x in range(pixels(z.shape[0])):
        ray_x = (np.float32(first + x) + HALF + jitter_x - center_x) / focal_x
        a, b = xx * nx[x] + xy * ny[x] + xz * nz[x], yx * nx[x] + yy * ny[x] + yz * nz[x]
        c = zx * nx[x] + zy * ny[x] + zz * nz[x]
        along[x] = c if parallel else a * ray_x + b * ray_y + c
        slope_x[x], slope_y[x] = a / focal_x, b / focal_y
        scale[x] = focal_y if parallel else focal_y / max(z[x], NEAREST)
        known[x] = ONE if there[x] else ZERO


@scalar
def edge_of(guide, perspective, depth_sensitivity, normal_power):
    """The constants of an edge weight."""
    power = np.float32(normal_power)
    roughness = ROUGHNESS_FALLOFF if guide.shape[0] > ROUGHNESS else ZERO
    return Edge(perspective, LOG2_E * np.float32(depth_sensitivity), power, NEVER if power > ZERO else ZERO, roughness)


@scalar
def tap_at(y, first, end, dx, dy, size):
    """The tap (dx, dy) pixels away from the pixels ``first`` to ``end`` of row y; empty outside the picture."""
    height, width = size
    low, high = max(first, -dx), min(end, width - dx)
    if 0 <= y + dy < height and high > low:
        return Tap(y + dy, low, high, dx, dy)
    return Tap(y, first, first, 0, 0)


@scalar
def parts_of(count):
    """Parts of a row for a group of so many taps: where all of them lie in the picture, and for each what is left and
    right of that."""
    return 1 + 2 * count


@scalar
def part_of(part, y, span, place, step, count, size):
    """The taps of a group that a part of a row has: see `parts_of`; empty where there is nothing.

    Args:
        part: below `parts_of`.
        y: the centre's row.
        span: first pixel of the row that counts, and the one after the last.
        place: (dx, dy) of the first tap, pixels.
        step: pixels from tap to tap.
        count: of taps in the group.
        size: (height, width).
    """
    (first, end), (dx, dy), (height, width) = span, place, size
    low, high = max(first, -dx), min(end, width - dx - (count - 1) * step)
    if count == 1 or low >= high:
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
def guide_row(guide, y, first, end):
    """Pixels ``first`` to ``end`` of a row of the guide."""
    rough = ROUGHNESS if guide.shape[0] > ROUGHNESS else HIT
    return Guide(
        guide[DEPTH, y, first:end], guide[NX, y, first:end], guide[NY, y, first:end], guide[NZ, y, first:end],
        guide[HIT, y, first:end], guide[rough, y, first:end],
    )  # fmt: skip


@scalar
def plane_row(plane, y, first, end):
    """Pixels ``first`` to ``end`` of a row of the planes."""
    return Plane(plane[0, y, first:end], plane[1, y, first:end], plane[2, y, first:end], plane[3, y, first:end])


@inlined
def edge_exponent(i, here, plane, j, there, dx, dy, edge):
    """`edges.edge_weight` of pixel i and its tap j as an exponent of 2, without whether the tap hit anything."""
    slope = plane.x[i] * dx + plane.y[i] * dy
    factor = there.depth[j] if edge.perspective else ONE
    distance = plane.along[i] * (there.depth[j] - here.depth[i]) + slope * factor
    cosine = here.nx[i] * there.nx[j] + here.ny[i] * there.ny[j] + here.nz[i] * there.nz[j]
    alike = edge.power * log2(min(max(cosine, TINY), ONE)) if cosine > ZERO else edge.away
    rougher = abs(here.roughness[i] - there.roughness[j]) * edge.roughness
    return alike - edge.sensitivity * abs(distance) * plane.scale[i] - rougher


@scalar
def hit_run(hit, y, begin, longest):
    """The first pixel of a row from ``begin`` on that was hit, and the end of its run, after which `GAP` pixels were
    not hit, or all that are left, or which is the ``longest``. Both are the same where nothing more was hit."""
    first, width = begin, hit.shape[1]
    while first < width and hit[y, first] == ZERO:
        first += 1
    end = x = first
    width = min(width, first + longest)
    row, known = hit[y, first:width], 0
    for i in range(row.shape[0]):
        known += 1 if row[i] != ZERO else 0
    if known == row.shape[0]:
        return first, width
    while x < width and x - end < GAP:
        if hit[y, x] != ZERO:
            end = x + 1
        x += 1
    return first, end


@scalar
def edge_weights(weights, guide, plane, y, tap, edge):
    """The edge weights of one tap for a row of pixels."""
    here, there = guide_row(guide, y, tap.first, tap.end), guide_row(guide, tap.y, tap.first + tap.dx, tap.end + tap.dx)
    planes, dx, dy = plane_row(plane, y, tap.first, tap.end), np.float32(tap.dx), np.float32(tap.dy)
    for i in range(pixels(weights.shape[0])):
        weights[i] = there.hit[i] * exp2(edge_exponent(i, here, planes, i, there, dx, dy, edge))


@scalar
def unit_row(out, vector, fallback, y, first, end):
    """Pixels ``first`` to ``end`` of a row of `post.filters.units.unit_vectors`."""
    a, b, c = vector[0, y, first:end], vector[1, y, first:end], vector[2, y, first:end]
    other_a, other_b, other_c = fallback[0, y, first:end], fallback[1, y, first:end], fallback[2, y, first:end]
    new_a, new_b, new_c = out[0, y, first:end], out[1, y, first:end], out[2, y, first:end]
    for x in range(pixels(a.shape[0])):
        size = math.sqrt(max(a[x] * a[x] + b[x] * b[x] + c[x] * c[x], TINY))
        points, size = size > SHORTEST, max(size, SHORTEST)
        new_a[x] = a[x] / size if points else other_a[x]
        new_b[x] = b[x] / size if points else other_b[x]
        new_c[x] = c[x] / size if points else other_c[x]
