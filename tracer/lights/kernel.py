"""Kernels of the light samples, the lamp table and the sky of `tracer.lights`: one point at a time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.compute.search import lower_bound
from tracer.lights.lamp_table import CANDIDATES, SLOTS, SPREAD
from tracer.lights.samples import NEAR
from tracer.lights.shadows import SHORT
from tracer.lights.sky import GRADIENT, HAZE
from tracer.lights.sky_table import CELLS
from tracer.lights.spherical_rectangle import FLATTEST
from tracer.sampling.scatter_kernel import along, combined, cross, disc, dot, fraction, scaled, tangent_frame
from tracer.traversal.kernel import triple

MIDDLE, FACING, REACH, POWER, CORNER, EDGE_U, EDGE_V, AREA, RADIANCE = 0, 3, 6, 7, 8, 11, 14, 17, 18
"""Columns of `Lit.lamps`."""
ZENITH, HORIZON, GROUND, TOWARD, IRRADIANCE, DISC, GLOW = 0, 1, 2, 3, 4, 5, 6
"""Rows of `Lit.sky`."""
NOTHING = (0.0, 0.0, 0.0)


class Lit(NamedTuple):
    """The lights of a scene.

    Args:
        picture: ``(h, w, 3)`` float32 lat-long radiance of the sky; no rows where the colours below say it.
        sky: ``(6 + G, 3)`` float64: radiance of zenith, horizon and ground; direction to the sun and its irradiance;
            the sine of its angular radius and 1, or 0 where there is none; share and g of each lobe of its glow.
        lamps: ``(R, 21)`` float32; no rows where there is no lamp.
        upto: ``(R,)`` float32 cumulative power of the lamps.
        slots: ``(C, SLOTS)`` int32; see `tracer.lights.lamp_table.LampTable`.
        counts: ``(C, SLOTS)`` int16.
        cells: ``(7,)`` float64: low corner, side and shape of the grid of cells.
        sky_upto: ``(D,)`` float32; see `tracer.lights.sky_table.SkyTable`. No rows where the sky is not sampled.
        sky_density: ``(D,)`` float32.
    """

    picture: np.ndarray
    sky: np.ndarray
    lamps: np.ndarray
    upto: np.ndarray
    slots: np.ndarray
    counts: np.ndarray
    cells: np.ndarray
    sky_upto: np.ndarray
    sky_density: np.ndarray


@scalar
def shines(lit):
    """Whether there is a sun."""
    return lit.sky[DISC, 1] > 0


@scalar
def _mixed(a, b, s):
    return a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * s, a[2] + (b[2] - a[2]) * s


@scalar
def sky(lit, direction):
    """Radiance of the sky without the sun's disc."""
    if lit.picture.shape[0] > 0:
        return _pictured(lit.picture, direction)
    up = direction[1]
    height = min(max(up, 0.0), 1.0)
    least = 0.01**GRADIENT
    lift = ((height + 0.01) ** GRADIENT - least) / (1.01**GRADIENT - least)
    below = min(max(-up / HAZE, 0.0), 1.0)
    below = below * below * (3 - 2 * below)
    light = _mixed(triple(lit.sky, HORIZON, 0), triple(lit.sky, ZENITH, 0), lift)
    light = _mixed(light, triple(lit.sky, GROUND, 0), below)
    if not shines(lit):
        return light
    cosine, lobes = dot(triple(lit.sky, TOWARD, 0), direction), 0.0
    for k in range(GLOW, len(lit.sky)):
        share, g = lit.sky[k, 0], lit.sky[k, 1]
        lobes += share * (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5
    return along(light, triple(lit.sky, IRRADIANCE, 0), lobes * (1 - below))


@scalar
def _pictured(picture, direction):
    """What a lat-long picture shows; see `gbufrt.environment.lookup_environment`."""
    height, width = picture.shape[0], picture.shape[1]
    x, y, z = direction
    across = math.sqrt(x * x + z * z)
    azimuth = math.atan2(x, -z) if across > 1e-6 else 0.0
    column = (azimuth / (2 * math.pi) + 0.5) * width - 0.5
    row = min(max(math.atan2(across, y) / math.pi * height - 0.5, 0.0), height - 1.0)
    left, top = int(math.floor(column)), int(row)  # noqa: RUF046 - CUDA floors to a float
    s, t = column - left, row - top
    right, below = (left + 1) % width, min(top + 1, height - 1)
    left = left % width
    above = _mixed(triple(picture[top], left, 0), triple(picture[top], right, 0), s)
    return _mixed(above, _mixed(triple(picture[below], left, 0), triple(picture[below], right, 0), s), t)


@scalar
def sky_sample(lit, a, b):
    """A direction to the sky, and its density."""
    place = a * lit.sky_upto[-1]
    cell = min(lower_bound(lit.sky_upto, place), len(lit.sky_upto) - 1)
    before = np.float64(lit.sky_upto[cell - 1]) if cell > 0 else 0.0
    within = min(max((place - before) / max(lit.sky_upto[cell] - before, 1e-12), 0.0), 1.0)
    row, column = cell // CELLS[1], cell % CELLS[1]
    top, bottom = math.cos(row * (math.pi / CELLS[0])), math.cos((row + 1) * (math.pi / CELLS[0]))
    y = top + (bottom - top) * within
    across = math.sqrt(max(1 - y * y, 0.0))
    azimuth = (column + b) * (2 * math.pi / CELLS[1]) - math.pi
    return (across * math.sin(azimuth), y, -across * math.cos(azimuth)), np.float64(lit.sky_density[cell])


@scalar
def sky_density(lit, direction):
    """Density with which `sky_sample` draws a direction."""
    row = int(math.acos(min(max(direction[1], -1.0), 1.0)) * (CELLS[0] / math.pi))
    column = int((math.atan2(direction[0], -direction[2]) / (2 * math.pi) + 0.5) * CELLS[1])
    cell = min(row, CELLS[0] - 1) * CELLS[1] + min(max(column, 0), CELLS[1] - 1)
    return np.float64(lit.sky_density[cell])


@scalar
def sun(lit, direction):
    """Radiance of the sun's disc, 0 beside it."""
    sine = lit.sky[DISC, 0]
    toward = triple(lit.sky, TOWARD, 0)
    off = cross(direction, toward)
    if sine == 0.0 or dot(direction, toward) <= 0 or dot(off, off) >= sine * sine:
        return NOTHING
    return scaled(triple(lit.sky, IRRADIANCE, 0), 1 / (math.pi * sine * sine))


@scalar
def sun_sample(lit, a, b):
    """A direction to the sun, and its radiance divided by the direction's density."""
    sine, toward = lit.sky[DISC, 0], triple(lit.sky, TOWARD, 0)
    across, other = tangent_frame(toward)
    x, y = disc(a, b)
    x, y = x * sine, y * sine
    z = math.sqrt(1 - x * x - y * y)
    return combined(across, other, toward, x, y, z), scaled(triple(lit.sky, IRRADIANCE, 0), 1 / z)


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
def _candidate(lit, cell, point, normal, a, k):
    """A lamp, its rough contribution, and that over the lamp's probability."""
    lamp, chance = _suggested(lit, cell, fraction(a + k / CANDIDATES))
    given = _given(lit, lamp, point, normal)
    return lamp, given, given / chance


@scalar
def _chosen(lit, point, normal, a, b):
    """A lamp, or -1, and the factor that its light is multiplied by."""
    cell = _cell(lit, point)
    total, upto = 0.0, 0.0
    for k in range(CANDIDATES):
        total += _candidate(lit, cell, point, normal, a, k)[2]
    for k in range(CANDIDATES):  # once more, which is cheaper than to keep them in memory
        lamp, given, weight = _candidate(lit, cell, point, normal, a, k)
        upto += weight
        if b * total < upto:
            return lamp, total / (CANDIDATES * given)
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
