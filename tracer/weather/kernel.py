"""Kernel of `tracer.weather.reference`: one ray at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from tracer.weather.noise import SIDE
from tracer.weather.reference import CLOSE, CLOSE_RELATIVE, STEPS
from tracer.weather.water import ALONG, OCTAVES, STEEPEST, WHOLE

SCALE, WEIGHT, FADES, ENDS = (tuple(octave[k] for octave in OCTAVES) for k in range(4))
COUNT, RATIO = len(OCTAVES), ALONG[1]


@scalar
def left_of(octave, away):
    """The share of an octave that is left so far from the camera."""
    if away >= ENDS[octave]:
        return 0.0
    if away <= FADES[octave]:
        return 1.0
    t = (away - FADES[octave]) / (ENDS[octave] - FADES[octave])
    return 1 - t * t * (3 - 2 * t)


@scalar
def value_at(numbers, x, z):
    """`tracer.weather.noise.Lattice.value`."""
    i, j = math.floor(x), math.floor(z)
    u, v = x - i, z - j
    u, v = u * u * u * (u * (u * 6 - 15) + 10), v * v * v * (v * (v * 6 - 15) + 10)
    row, next_row = (int(i) & SIDE - 1) * SIDE, (int(i) + 1 & SIDE - 1) * SIDE
    column, next_column = int(j) & SIDE - 1, int(j) + 1 & SIDE - 1
    near = numbers[row + column] * (1 - v) + numbers[row + next_column] * v
    far = numbers[next_row + column] * (1 - v) + numbers[next_row + next_column] * v
    return near * (1 - u) + far * u


@scalar
def meet(i, origins, directions, begin, end, numbers, eye_x, eye_z, amplitude, frequency, shift, found):
    x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
    dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
    t, last = begin[i], end[i]
    mean = np.round(y + dy * t) - amplitude
    steep = abs(dx) + abs(dz) * RATIO
    for _ in range(STEPS):
        px, pz = x + dx * t, z + dz * t
        away = math.sqrt((px - eye_x) * (px - eye_x) + (pz - eye_z) * (pz - eye_z))
        height, most = 0.0, 0.0
        for octave in range(COUNT):
            share = WEIGHT[octave] * left_of(octave, away)
            if share > 0:
                often = frequency * SCALE[octave]
                height += share * (value_at(numbers, px * often + shift, pz * often * RATIO + shift) - 0.5)
                most += share * SCALE[octave]
        gap = y + dy * t - mean - WHOLE * amplitude * height
        closing = STEEPEST * WHOLE * amplitude * frequency * most * steep - dy
        t = min(t + max(gap / closing, 0.0), last)
        if not (gap > CLOSE + CLOSE_RELATIVE * t and t < last):
            break
    found[i] = t
