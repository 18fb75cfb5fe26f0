"""Kernels of `tracer.scene.fog` and `tracer.fog.segments`: a medium, and one ray through it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbufrt.compute.kernel import scalar
from tracer.sampling.scatter_kernel import combined, tangent_frame
from tracer.scene.fog import SERIES, STEEPEST
from tracer.traversal.kernel import triple


class Medium(NamedTuple):
    """`tracer.scene.fog.Fog`."""

    extinction: float
    falloff: float
    base: float
    anisotropy: float


class Ray(NamedTuple):
    """One of `tracer.fog.segments.Segments`; ``height`` is where it begins, and ``taken`` what fog takes of it."""

    origin: tuple[float, float, float]
    direction: tuple[float, float, float]
    begin: float
    end: float
    height: float
    taken: float


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
