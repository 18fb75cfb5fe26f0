"""Kernels of the sky and the sun: one direction at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.compute.search import upper_bound
from tracer.lights.lit import DISC, GLOW, GROUND, HORIZON, IRRADIANCE, NOTHING, TOWARD, ZENITH
from tracer.lights.sky import GRADIENT, HAZE
from tracer.lights.sky_table import BELOW_ONE, CELLS
from tracer.sampling.scatter_kernel import along, combined, cross, disc, dot, scaled, tangent_frame
from tracer.traversal.kernel import triple


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
        square = 1 + g * g - 2 * g * cosine
        lobes += share * (1 - g * g) / (square * math.sqrt(square))
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
    place = a * (lit.sky_upto[-1] * BELOW_ONE)
    cell = min(upper_bound(lit.sky_upto, place), len(lit.sky_upto) - 1)
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
