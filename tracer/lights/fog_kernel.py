"""Kernels of `tracer.lights.fog_reference` and of `tracer.lights.along`: one ray at a time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.compute.search import lower_bound, upper_bound
from tracer.lights.along import CANDIDATES, CELLS, FLAT
from tracer.lights.fog_rays_kernel import shoot
from tracer.lights.fog_reference import TURN
from tracer.lights.kernel import (
    CORNER,
    EDGE_U,
    EDGE_V,
    FACING,
    IRRADIANCE,
    MIDDLE,
    POWER,
    RADIANCE,
    REACH,
    TOWARD,
    rectangle_point,
    sky,
    sky_density,
    sky_sample,
    sun_sample,
)  # fmt: skip
from tracer.lights.shadows import SHORT
from tracer.sampling.scatter_kernel import along, combined, dot, fraction, scaled, tangent_frame
from tracer.sampling.sequence import BELOW_ONE
from tracer.scene.fog import SERIES, STEEPEST
from tracer.traversal.kernel import triple
from tracer.traversal.rays import FARTHEST


class Medium(NamedTuple):
    """`tracer.scene.fog.Fog`."""

    extinction: float
    falloff: float
    base: float
    anisotropy: float


class Ray(NamedTuple):
    """One of `tracer.lights.segments.Segments`; ``height`` is where it begins, and ``taken`` what fog takes of it."""

    origin: tuple[float, float, float]
    direction: tuple[float, float, float]
    begin: float
    end: float
    height: float
    taken: float


class Reach(NamedTuple):
    """Where a ray comes nearest to a lamp, how near, and between where it lies before its front."""

    middle: float
    off: float
    low: float
    high: float


@scalar
def ray_of(rays, i):
    origins, directions, begin, end, taken = rays
    origin, direction, t = triple(origins, i, 0), triple(directions, i, 0), np.float64(begin[i])
    return Ray(origin, direction, t, np.float64(end[i]), origin[1] + direction[1] * t, np.float64(taken[i]))


@scalar
def density(fog, height):
    return fog.extinction * math.exp(min(max(-fog.falloff * (height - fog.base), -STEEPEST), STEEPEST))


@scalar
def depth(fog, height, rise, distance):
    """Optical depth over a distance from a height on."""
    x = max(fog.falloff * rise * distance, -STEEPEST)
    thinned = 1 - x / 2 if abs(x) < SERIES else -math.expm1(-x) / x
    return density(fog, height) * distance * thinned


@scalar
def phase(fog, cosine):
    g = fog.anisotropy
    return (1 - g * g) / (4 * math.pi * max(1 + g * g - 2 * g * cosine, 1e-9) ** 1.5)


@scalar
def phase_direction(fog, onward, a, b):
    g = fog.anisotropy
    x = (1 - g * g) / (1 - g + 2 * g * a)
    cosine = (1 + g * g - x * x) / (2 * g) if abs(g) > 1e-3 else 1 - 2 * a
    cosine = min(max(cosine, -1.0), 1.0)
    sine, angle = math.sqrt(1 - cosine * cosine), 2 * math.pi * b
    across, other = tangent_frame(onward)
    return combined(across, other, onward, sine * math.cos(angle), sine * math.sin(angle), cosine)


@scalar
def _place(fog, ray, u):
    """A point in proportion to what fog takes there."""
    even = -math.log1p(-u * ray.taken) / max(density(fog, ray.height), 1e-30)
    x = min(fog.falloff * ray.direction[1] * even, 1 - 1e-6)
    bend = 1 + x / 2 if abs(x) < SERIES else -math.log1p(-x) / x
    return along(ray.origin, ray.direction, ray.begin + min(even * bend, ray.end - ray.begin))


@scalar
def _number(noise, turned, d, i, s):
    """Number ``d`` of step ``s`` on ray ``i``."""
    x = np.float64(noise[d, i] + turned[d, s])
    return min(x - 1 if x >= 1 else x, BELOW_ONE)


@scalar
def from_sun(i, waiting, rays, fog, space, lit, weights, turned, noise):
    ray = ray_of(rays, i)
    share = phase(fog, dot(ray.direction, triple(lit.sky, TOWARD, 0)))
    color = scaled(triple(lit.sky, IRRADIANCE, 0), share)
    for s in range(turned.shape[1]):
        way, _ = sun_sample(lit, _number(noise, turned, 1, i, s), _number(noise, turned, 2, i, s))
        shoot(waiting, space, _place(fog, ray, _number(noise, turned, 0, i, s)), way, FARTHEST, color, i)


@scalar
def from_sky(i, waiting, rays, fog, space, lit, weights, turned, noise):
    ray = ray_of(rays, i)
    for s in range(turned.shape[1]):
        point = _place(fog, ray, _number(noise, turned, 0, i, s))
        a, b = _number(noise, turned, 1, i, s), _number(noise, turned, 2, i, s)
        for k in range(2):
            way = phase_direction(fog, ray.direction, a, b) if k == 0 else sky_sample(lit, a, b)[0]
            share = phase(fog, dot(way, ray.direction))
            color = scaled(sky(lit, way), share / (share + sky_density(lit, way)))
            shoot(waiting, space, point, way, FARTHEST, color, i)


@scalar
def _reach(lit, lamp, ray):
    facing = triple(lit.lamps, lamp, FACING)
    away = along(triple(lit.lamps, lamp, MIDDLE), ray.origin, -1.0)
    middle, above, rise = dot(away, ray.direction), -dot(away, facing), dot(ray.direction, facing)
    off = math.sqrt(max(dot(away, away) - middle * middle, 0.0))
    low, high = ray.begin, ray.end
    if rise >= FLAT:
        low = max(-above / rise, low)
    elif rise <= -FLAT:
        high = min(-above / rise, high)
    elif above <= 0:
        high = low
    return Reach(middle, max(off, np.float64(lit.lamps[lamp, REACH]) / 2), low, max(high, low))


@scalar
def _turned(turns, t, reach):
    """`tracer.lights.along.turns_of` up to the angle at which a lamp lies from ``t``."""
    place = min(max((math.atan((t - reach.middle) / reach.off) / math.pi + 0.5) * CELLS, 0.0), CELLS * 1.0)
    cell = min(int(place), CELLS - 1)
    return turns[cell] + (turns[cell + 1] - turns[cell]) * (place - cell)


@scalar
def _thick(fog, ray):
    """Optical depth a unit of the ray's way."""
    length = max(ray.end - ray.begin, 0.0)
    return depth(fog, ray.height, ray.direction[1], length) / max(length, 1e-9)


@scalar
def _weight(lit, turns, lamp, ray, thick):
    """About how much fog along a ray scatters of a lamp, over its power."""
    reach = _reach(lit, lamp, ray)
    if not reach.high > reach.low:
        return 0.0
    near = min(max(reach.middle, reach.low), reach.high)
    far = math.sqrt((reach.middle - near) ** 2 + reach.off * reach.off)
    given = max(_turned(turns, reach.high, reach) - _turned(turns, reach.low, reach), 0.0) / reach.off
    return given * math.exp(-thick * (near - ray.begin + far))


@scalar
def weigh(rays, i, fog, lit, turns, rare, upto):
    """Sum up the weights of all lamps for one ray; a share ``rare`` of them goes by power alone."""
    ray, total = ray_of(rays, i), 0.0
    thick = _thick(fog, ray)
    for lamp in range(len(upto)):
        upto[lamp] = lit.lamps[lamp, POWER] * _weight(lit, turns, lamp, ray, thick)
        total += upto[lamp]
    rare, total = max(total, 1e-20) * rare, 0.0
    for lamp in range(len(upto)):
        total += upto[lamp] + rare * lit.lamps[lamp, POWER]
        upto[lamp] = total


@scalar
def _candidate(lit, u, k):
    return min(lower_bound(lit.upto, fraction(u + k / CANDIDATES) * lit.upto[-1]), len(lit.lamps) - 1)


@scalar
def _of_candidates(lit, turns, ray, thick, u):
    """A lamp drawn from a few, or -1, and how often it is drawn."""
    total, upto, other = 0.0, 0.0, fraction(np.float64(np.float32(u) * np.float32(TURN)))
    for k in range(CANDIDATES):
        total += _weight(lit, turns, _candidate(lit, other, k), ray, thick)
    for k in range(CANDIDATES):  # once more, which is cheaper than to keep them in memory
        lamp = _candidate(lit, other, k)
        own = _weight(lit, turns, lamp, ray, thick)
        upto += own
        if u * total < upto:
            return lamp, CANDIDATES * lit.lamps[lamp, POWER] * own / total
    return -1, 0.0


@scalar
def _of_all(upto, u):
    """As `_of_candidates`, by the summed weights of all lamps."""
    total = upto[-1]
    lamp = min(upper_bound(upto, u * total), len(upto) - 1)
    own = upto[lamp] - (upto[lamp - 1] if lamp > 0 else 0.0)
    return (lamp, own / total) if own > 0 else (-1, 0.0)


@scalar
def from_lamps(i, waiting, rays, fog, space, lit, weights, turned, noise):
    ray, (upto, group, turns) = ray_of(rays, i), weights
    thick = _thick(fog, ray)
    for s in range(turned.shape[1]):
        u = _number(noise, turned, 0, i, s)
        if upto.shape[1] > 0:
            lamp, often = _of_all(upto[group[i]], u)
        else:
            lamp, often = _of_candidates(lit, turns, ray, thick, u)
        if lamp >= 0:
            b = _number(noise, turned, 1, i, s)
            c, d = _number(noise, turned, 2, i, s), _number(noise, turned, 3, i, s)
            _from_lamp(i, waiting, ray, fog, space, lit, turns, lamp, often, b, c, d)


@scalar
def _from_lamp(i, waiting, ray, fog, space, lit, turns, lamp, often, b, c, d):
    """A place on the ray by `turns`, a point of the lamp, and the light that comes from there."""
    reach = _reach(lit, lamp, ray)
    if not reach.high > reach.low:
        return
    first, last = _turned(turns, reach.low, reach), _turned(turns, reach.high, reach)
    place = first + (last - first) * b
    cell = min(max(upper_bound(turns, place) - 1, 0), CELLS - 1)
    width = np.float64(turns[cell + 1] - turns[cell])
    angle = (min(max(cell + (place - turns[cell]) / width, 0.0), CELLS * 1.0) / CELLS - 0.5) * math.pi
    t = min(max(reach.middle + reach.off * math.tan(angle), reach.low), reach.high)
    spread = reach.off / (reach.off * reach.off + (t - reach.middle) ** 2)
    chance = width * (CELLS / math.pi) / max(last - first, 1e-30) * spread * often
    point = along(ray.origin, ray.direction, t)
    corner = along(triple(lit.lamps, lamp, CORNER), point, -1.0)
    away, angle = rectangle_point(corner, triple(lit.lamps, lamp, EDGE_U), triple(lit.lamps, lamp, EDGE_V), c, d)
    far = max(math.sqrt(dot(away, away)), 1e-6)
    way = scaled(away, 1 / far)
    thick = depth(fog, ray.height, ray.direction[1], t - ray.begin) + depth(fog, point[1], way[1], far)
    share = phase(fog, dot(way, ray.direction)) * density(fog, point[1]) * math.exp(-thick) / ray.taken
    color = scaled(triple(lit.lamps, lamp, RADIANCE), share * angle / max(chance, 1e-30))
    shoot(waiting, space, point, way, max(far - SHORT, 0.0), color, i)
