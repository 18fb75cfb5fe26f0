"""The compiled form of `tracer.direct.reference` and `tracer.lights.form_factor`: one source at one pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbufrt.compute.approximations import atan2
from gbufrt.compute.kernel import inlined, scalar
from gbufrt.noise.noise import PLASTIC
from tracer.direct.shadow_kernel import shoot
from tracer.lights.shadows import SHORT
from tracer.sampling.scatter_kernel import added, along, combined, cross, disc, dot, fraction, scaled
from tracer.traversal.kernel import triple

CORNER, EDGE_U, EDGE_V, FACING, OFFSET = 0, 3, 6, 9, 12
"""Columns of `Sources.rectangles`; the facing is as long as the area, the offset its product with the corner."""
CENTER, RADIUS, MEAN = 0, 3, 4
"""Rows of `Sources.lamps`; the mean of the radiance."""
SMALL = 1e-2  # square of the tangent of an angle below which a series is exact in float32
FAR = 36.0  # square of a distance in diagonals of a rectangle beyond which a series errs by 2e-5 of area / distance^2


class Sources(NamedTuple):
    """All that shines on a picture. Lamps have numbers from 0; the sun, if any, is number L.

    Args:
        rectangles: ``(R, 13)`` float64, those of one lamp after those of another.
        first: ``(L + 1,)`` int64, where those of each lamp begin.
        faces: ``(K, 6, L)`` float64, the rectangles of each lamp, and of a lamp of many their sums over those that face
            one way: facing, offset, the least offset that they could have in the lamp's sphere, and area; else zero.
        lamps: ``(5, L)`` float64: loops over all lamps then take several in one instruction.
        sun: ``(4, 3)`` float64: two axes across the direction to the sun, that direction, and the sine of the sun's
            angular radius.
        colors: ``(L + 1, 3)`` float32: radiance of the lamps, irradiance of the sun.
    """

    rectangles: np.ndarray
    first: np.ndarray
    faces: np.ndarray
    lamps: np.ndarray
    sun: np.ndarray
    colors: np.ndarray


@scalar
def disc_cosine(cosine, sine):
    """See `tracer.lights.form_factor.disc_cosine`."""
    h = min(max(cosine / max(sine, 1e-6), -1.0), 1.0)
    if h >= 1.0:
        return cosine
    rest = max(1 - h * h, 0.0)
    return (h * (0.5 + (math.asin(h) + h * math.sqrt(rest)) / math.pi) + 2 / (3 * math.pi) * rest**1.5) * sine


@scalar
def _edge(a, b, normal):
    """The angle between two corners times how much their plane leans toward the normal."""
    turn, across = cross(a, b), dot(a, b)
    square, lean = dot(turn, turn), dot(turn, normal)
    if across > 0 and square < SMALL * across * across:  # a series spares a root and an arc
        inverse = 1 / across
        x = square * inverse * inverse
        return lean * inverse * (1 - x * (1 / 3 - x * (1 / 5 - x / 7)))
    size = math.sqrt(square)
    return atan2(size, across) * lean / max(size, 1e-20)


@inlined
def _far(square, lean, one, other):
    """The mean over a rectangle of the cosine to a normal over the cube of the distance, to the second order.

    ``square`` and ``lean`` are the products of the vector to its middle with itself and with the normal, ``one`` and
    ``other`` those of each edge with itself, with the normal and with that vector.
    """
    inverse, bend = 1 / square, 0.0
    for edge in (one, other):
        side, tilt, slope = edge
        slope *= inverse
        bend += lean * (6 * slope * slope - side * inverse) - 2 * tilt * slope
    return inverse * inverse * (lean + bend / 6)


@scalar
def rectangle_irradiance(rectangles, k, point, normal):
    """See `tracer.lights.form_factor.rectangle_irradiance`."""
    if dot(triple(rectangles, k, FACING), point) <= rectangles[k, OFFSET]:
        return 0.0
    a = along(triple(rectangles, k, CORNER), point, -1.0)
    edge, other = triple(rectangles, k, EDGE_U), triple(rectangles, k, EDGE_V)
    middle = along(along(a, edge, 0.5), other, 0.5)
    square, lean = dot(middle, middle), dot(normal, middle)
    u, v, lean_u, lean_v = dot(edge, edge), dot(other, other), dot(normal, edge), dot(normal, other)
    if square > FAR * (u + v) and lean > (abs(lean_u) + abs(lean_v)) / 2:
        height = dot(triple(rectangles, k, FACING), point) - rectangles[k, OFFSET]
        return height * _far(square, lean, (u, lean_u, dot(middle, edge)), (v, lean_v, dot(middle, other)))
    above, total, cut = dot(normal, a), 0.0, False
    leaves = enters = (0.0, 0.0, 0.0)
    for side in range(4):
        if side == 1:
            edge = other
        elif side > 1:
            edge = scaled(triple(rectangles, k, EDGE_U if side == 2 else EDGE_V), -1.0)
        b = added(a, edge)
        next_above = dot(normal, b)
        if above >= 0 or next_above >= 0:
            begin, end = a, b
            if above < 0 or next_above < 0:
                crossing, cut = along(a, edge, above / (above - next_above)), True
                if above < 0:
                    begin = enters = crossing
                else:
                    end = leaves = crossing
            total += _edge(begin, end, normal)
        a, above = b, next_above
    if cut:
        total += _edge(leaves, enters, normal)
    return max(-0.5 * total, 0.0)


@scalar
def _turned(turn, number):
    """A point of the R2 sequence, rotated by a pixel's offset."""
    return fraction(turn[0] + number / PLASTIC), fraction(turn[1] + number / PLASTIC**2)


@inlined
def _send_to_sun(shadows, space, sources, place, begin, end, row, gain):
    """Samples of the sun's disc from one pixel."""
    point, normal, turn = place
    axes, sine, sun = sources.sun, sources.sun[3, 0], sources.lamps.shape[1]
    across, other, toward = triple(axes, 0, 0), triple(axes, 1, 0), triple(axes, 2, 0)
    for number in range(begin, end):
        x, y = disc(*_turned(turn, number))
        x, y = x * sine, y * sine
        direction = combined(across, other, toward, x, y, math.sqrt(1 - x * x - y * y))
        weight = dot(normal, direction)
        if weight > 0:
            shoot(shadows, space, sources, point, direction, np.inf, weight if row >= 0 else gain, row, sun)


@inlined
def _send_to_lamp(shadows, space, sources, number, place, begin, end, each, energy, row, gain):
    """Samples of one lamp from one pixel."""
    point, normal, turn = place
    rectangles, low, high = sources.rectangles, sources.first[number], sources.first[number + 1]
    for step in range(begin, end):
        u, v = _turned(turn, step)
        rest, k = u * energy, low
        while k < high - 1 and rest >= each[k - low]:
            rest -= each[k - low]
            k += 1
        mine = max(each[k - low], 1e-20)
        way = along(triple(rectangles, k, CORNER), triple(rectangles, k, EDGE_U), min(max(rest / mine, 0.0), 1.0))
        way = along(along(way, triple(rectangles, k, EDGE_V), v), point, -1.0)
        square = max(dot(way, way), 1e-12)
        distance = math.sqrt(square)
        direction = scaled(way, 1 / distance)
        here, there = dot(normal, direction), -dot(triple(rectangles, k, FACING), direction)
        weight = max(here, 0.0) * max(there, 0.0) / (square * mine)
        if weight > 0:
            span = max(distance - SHORT, 0.0)
            shoot(shadows, space, sources, point, direction, span, weight if row >= 0 else gain, row, number)


@scalar
def unblocked(sources, number, point, normal, each):
    """Irradiance from a source where nothing is in its way; ``each`` has room for one number per rectangle."""
    if number == sources.lamps.shape[1]:
        return max(disc_cosine(dot(normal, triple(sources.sun, 2, 0)), sources.sun[3, 0]), 0.0)
    total, low = 0.0, sources.first[number]
    for k in range(low, sources.first[number + 1]):
        each[k - low] = rectangle_irradiance(sources.rectangles, k, point, normal)
        total += each[k - low]
    return total


@scalar
def send(shadows, space, sources, number, place, begin, end, each, energy, row, gain):
    """Queue rays ``begin`` to ``end`` to a source from the point, normal and rotation of a ``place``.

    ``each`` and ``energy`` are what `unblocked` found there. Rays count in a ``row`` of the sums by their weights; for
    a row below 0 all have the weight ``gain``, see `tracer.direct.shadow_kernel.Shadows`.
    """
    if energy > 0:
        if number == sources.lamps.shape[1]:
            _send_to_sun(shadows, space, sources, place, begin, end, row, gain)
        else:
            _send_to_lamp(shadows, space, sources, number, place, begin, end, each, energy, row, gain)
