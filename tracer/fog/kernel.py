"""Kernels of `tracer.fog.reference`: the steps of one ray."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.compute.search import upper_bound
from tracer.fog.along import CELLS
from tracer.fog.along_kernel import of_all, of_candidates, reach_of, thickness, turned_upto
from tracer.fog.medium_kernel import density, depth, phase, phase_direction, ray_of
from tracer.fog.rays_kernel import shoot
from tracer.lights.lamp_kernel import rectangle_point
from tracer.lights.lit import CORNER, EDGE_U, EDGE_V, IRRADIANCE, RADIANCE, TOWARD
from tracer.lights.shadows import SHORT
from tracer.lights.sky_kernel import sky, sky_density, sky_sample, sun_sample
from tracer.sampling.scatter_kernel import along, dot, scaled
from tracer.sampling.sequence import BELOW_ONE
from tracer.scene.fog import SERIES
from tracer.traversal.kernel import triple
from tracer.traversal.rays import FARTHEST


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
def from_sun(i, shadows, rays, fog, space, lit, weights, turned, noise):
    ray = ray_of(rays, i)
    share = phase(fog, dot(ray.direction, triple(lit.sky, TOWARD, 0)))
    color = scaled(triple(lit.sky, IRRADIANCE, 0), share)
    for s in range(turned.shape[1]):
        way, _ = sun_sample(lit, _number(noise, turned, 1, i, s), _number(noise, turned, 2, i, s))
        shoot(shadows, space, _place(fog, ray, _number(noise, turned, 0, i, s)), way, FARTHEST, color, i)


@scalar
def from_sky(i, shadows, rays, fog, space, lit, weights, turned, noise):
    ray = ray_of(rays, i)
    for s in range(turned.shape[1]):
        point = _place(fog, ray, _number(noise, turned, 0, i, s))
        a, b = _number(noise, turned, 1, i, s), _number(noise, turned, 2, i, s)
        for k in range(2):
            way = phase_direction(fog, ray.direction, a, b) if k == 0 else sky_sample(lit, a, b)[0]
            share = phase(fog, dot(way, ray.direction))
            color = scaled(sky(lit, way), share / (share + sky_density(lit, way)))
            shoot(shadows, space, point, way, FARTHEST, color, i)


@scalar
def from_lamps(i, shadows, rays, fog, space, lit, weights, turned, noise):
    ray, (upto, group, turns) = ray_of(rays, i), weights
    thick = thickness(fog, ray)
    for s in range(turned.shape[1]):
        u = _number(noise, turned, 0, i, s)
        if upto.shape[1] > 0:
            lamp, often = of_all(upto[group[i]], u)
        else:
            lamp, often = of_candidates(lit, turns, ray, thick, u)
        if lamp >= 0:
            b = _number(noise, turned, 1, i, s)
            c, d = _number(noise, turned, 2, i, s), _number(noise, turned, 3, i, s)
            _from_lamp(i, shadows, ray, fog, space, lit, turns, lamp, often, b, c, d)


@scalar
def _from_lamp(i, shadows, ray, fog, space, lit, turns, lamp, often, b, c, d):
    """A place on the ray by `turns`, a point of the lamp, and the light that comes from there."""
    reach = reach_of(lit, lamp, ray)
    if not reach.high > reach.low:
        return
    first, last = turned_upto(turns, reach.low, reach), turned_upto(turns, reach.high, reach)
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
    shoot(shadows, space, point, way, max(far - SHORT, 0.0), color, i)
