"""Kernels of `tracer.fog.along`: lamps along one ray."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.compute.search import lower_bound, upper_bound
from tracer.fog.along import CANDIDATES, CELLS, FLAT
from tracer.fog.medium_kernel import depth, ray_of
from tracer.fog.reference import TURN
from tracer.lights.lit import FACING, MIDDLE, POWER, REACH
from tracer.sampling.scatter_kernel import along, dot, fraction
from tracer.traversal.kernel import triple


class Reach(NamedTuple):
    """Where a ray comes nearest to a lamp, how near, and between where it lies before its front."""

    middle: float
    off: float
    low: float
    high: float


@scalar
def reach_of(lit, lamp, ray):
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
def turned_upto(turns, t, reach):
    """`tracer.fog.along.turns_of` up to the angle at which a lamp lies from ``t``."""
    place = min(max((math.atan((t - reach.middle) / reach.off) / math.pi + 0.5) * CELLS, 0.0), CELLS * 1.0)
    cell = min(int(place), CELLS - 1)
    return turns[cell] + (turns[cell + 1] - turns[cell]) * (place - cell)


@scalar
def thickness(fog, ray):
    """Optical depth a unit of the ray's way."""
    length = max(ray.end - ray.begin, 0.0)
    return depth(fog, ray.height, ray.direction[1], length) / max(length, 1e-9)


@scalar
def _weight(lit, turns, lamp, ray, thick):
    """About how much fog along a ray scatters of a lamp, over its power."""
    reach = reach_of(lit, lamp, ray)
    if not reach.high > reach.low:
        return 0.0
    near = min(max(reach.middle, reach.low), reach.high)
    far = math.sqrt((reach.middle - near) ** 2 + reach.off * reach.off)
    given = max(turned_upto(turns, reach.high, reach) - turned_upto(turns, reach.low, reach), 0.0) / reach.off
    return given * math.exp(-thick * (near - ray.begin + far))


@scalar
def weigh(rays, i, fog, lit, turns, rare, upto):
    """Sum up the weights of all lamps for one ray; a share ``rare`` of them goes by power alone."""
    ray, total = ray_of(rays, i), 0.0
    thick = thickness(fog, ray)
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
def of_candidates(lit, turns, ray, thick, u):
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
def of_all(upto, u):
    """As `of_candidates`, by the summed weights of all lamps."""
    total = upto[-1]
    lamp = min(upper_bound(upto, u * total), len(upto) - 1)
    own = upto[lamp] - (upto[lamp - 1] if lamp > 0 else 0.0)
    return (lamp, own / total) if own > 0 else (-1, 0.0)
