"""Kernels of lamps: one point at a time, its cell's candidates, and a point on the lamp that is chosen."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.compute.search import lower_bound
from tracer.lights.lamp_table import CANDIDATES, SLOTS, SPREAD
from tracer.lights.lit import AREA, CORNER, EDGE_U, EDGE_V, FACING, MIDDLE, NOTHING, POWER, RADIANCE, REACH
from tracer.lights.samples import NEAR
from tracer.lights.shadows import SHORT
from tracer.lights.spherical_rectangle import FLATTEST
from tracer.sampling.scatter_kernel import along, combined, cross, dot, fraction, scaled
from tracer.traversal.kernel import triple


@scalar
def _cell(lit, point):
    """Number of the cell that a point is in."""
    low, side = lit.cells[:3], lit.cells[3]
    number = 0
    for k in range(3):
        place = int((point[k] - low[k]) / side)
        number = number * int(lit.cells[4 + k]) + min(max(place, 0), int(lit.cells[4 + k]) - 1)
    return number


@scalar
def _suggested(lit, cell, u):
    """A lamp drawn from the slots of a cell, and its probability."""
    slots = lit.slots[cell]
    if u < SPREAD:
        lamp = min(lower_bound(lit.upto, u / SPREAD), len(lit.lamps) - 1)
        place = lower_bound(slots, lamp)
        count = int(lit.counts[cell, place]) if place < SLOTS and slots[place] == lamp else 0
    else:
        place = min(int((u - SPREAD) / (1 - SPREAD) * SLOTS), SLOTS - 1)
        lamp, count = int(slots[place]), int(lit.counts[cell, place])
    return lamp, SPREAD * lit.lamps[lamp, POWER] + (1 - SPREAD) / SLOTS * count


@scalar
def _given(lit, lamp, point, normal):
    """Rough unoccluded contribution of a lamp; see `tracer.lights.lamp_table`."""
    way = along(triple(lit.lamps, lamp, MIDDLE), point, -1.0)
    above = -dot(way, triple(lit.lamps, lamp, FACING))
    if not above > 0:
        return 0.0
    rise, reach = dot(way, normal), np.float64(lit.lamps[lamp, REACH])
    rise = max(rise, (rise + reach) / 4, 0.0)
    return lit.lamps[lamp, POWER] * above * rise / (dot(way, way) + reach * reach / 4) ** 2


@scalar
def _weight(lit, cell, point, normal, a, k):
    """Rough contribution of a candidate over its probability."""
    lamp, chance = _suggested(lit, cell, fraction(a + k / CANDIDATES))
    return _given(lit, lamp, point, normal) / chance


@scalar
def _chosen(lit, point, normal, a, b):
    """A lamp, or -1, and the factor that its light is multiplied by."""
    cell, total, upto = _cell(lit, point), 0.0, 0.0
    weights = (  # of the candidates, so that none is weighed twice
        _weight(lit, cell, point, normal, a, 0),
        _weight(lit, cell, point, normal, a, 1),
        _weight(lit, cell, point, normal, a, 2),
        _weight(lit, cell, point, normal, a, 3),
        _weight(lit, cell, point, normal, a, 4),
        _weight(lit, cell, point, normal, a, 5),
        _weight(lit, cell, point, normal, a, 6),
        _weight(lit, cell, point, normal, a, 7),
    )
    for k in range(CANDIDATES):
        total += weights[k]
    for k in range(CANDIDATES):
        upto += weights[k]
        if b * total < upto:
            lamp = _suggested(lit, cell, fraction(a + k / CANDIDATES))[0]
            return lamp, total / (CANDIDATES * _given(lit, lamp, point, normal))
    return -1, 0.0


@scalar
def lamp_sample(lit, point, normal, a, b, c, d):
    """A direction to a lamp, the distance to just before it, its radiance divided by the direction's density, and
    its number, or -1."""
    lamp, factor = _chosen(lit, point, normal, a, b)
    if lamp < 0:
        return (0.0, 1.0, 0.0), 0.0, NOTHING, -1
    first = along(triple(lit.lamps, lamp, CORNER), point, -1.0)
    edge_u, edge_v = triple(lit.lamps, lamp, EDGE_U), triple(lit.lamps, lamp, EDGE_V)
    facing, area = triple(lit.lamps, lamp, FACING), np.float64(lit.lamps[lamp, AREA])
    way = along(along(first, edge_u, c), edge_v, d)
    above, square = -dot(facing, way), max(dot(way, way), 1e-12)
    angle = area * above / (square * math.sqrt(square))
    middle = along(triple(lit.lamps, lamp, MIDDLE), point, -1.0)
    if above > 0 and area > NEAR * dot(middle, middle):
        way, angle = rectangle_point(first, edge_u, edge_v, c, d)
    distance = math.sqrt(max(dot(way, way), 1e-12))
    light = scaled(triple(lit.lamps, lamp, RADIANCE), max(angle, 0.0) * factor)
    return scaled(way, 1 / distance), max(distance - SHORT, 0.0), light, lamp


@scalar
def rectangle_point(first, edge_u, edge_v, s, t):
    """The vector to a point on a rectangle, and the solid angle; see `tracer.lights.spherical_rectangle`."""
    width, height = math.sqrt(dot(edge_u, edge_u)), math.sqrt(dot(edge_v, edge_v))
    right, up = scaled(edge_u, 1 / width), scaled(edge_v, 1 / height)
    away = cross(right, up)
    z = dot(first, away)
    edge_on = abs(z) < FLATTEST
    away = scaled(away, -1.0 if z > 0 else 1.0)
    z = -max(abs(z), FLATTEST)
    x0, y0 = dot(first, right), dot(first, up)
    x1, y1 = x0 + width, y0 + height
    b0, b1, b2, b3 = _elevation(-y0, z), _elevation(x1, z), _elevation(y1, z), _elevation(-x0, z)
    rest = 2 * math.pi - _corner(b2, b3) - _corner(b3, b0)
    angle = _corner(b0, b1) + _corner(b1, b2) - rest
    turn = s * angle + rest
    f = (math.cos(turn) * b0 - b2) / math.sin(turn)
    c = (1.0 if f > 0 else -1.0) / max(math.sqrt(f * f + b0 * b0), 1e-12)
    c = min(max(c, -1 + 1e-12), 1 - 1e-12)
    x = min(max(-c * z / math.sqrt(1 - c * c), x0), x1)
    square = x * x + z * z
    h0, h1 = y0 / math.sqrt(square + y0 * y0), y1 / math.sqrt(square + y1 * y1)
    h = min(max(h0 + t * (h1 - h0), -1 + 1e-12), 1 - 1e-12)
    y = min(max(h * math.sqrt(square / (1 - h * h)), y0), y1)
    return combined(right, up, away, x, y, z), 0.0 if edge_on else angle


@scalar
def _elevation(side, z):
    return side / math.sqrt(side * side + z * z)


@scalar
def _corner(b, c):
    return math.acos(min(max(-b * c, -1.0), 1.0))
