"""Kernels of `tracer.weather.reference`: one ray or one point at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.specular import DIELECTRIC_F0
from tracer.sampling.scatter_kernel import added, along, cross, dot, scaled
from tracer.traversal.kernel import triple
from tracer.weather.noise import SIDE
from tracer.weather.reference import BRIGHTEST, CLOSE, CLOSE_RELATIVE, MOST_CELLS, SPREAD, STEPS
from tracer.weather.water import ALONG, OCTAVES, STEEPEST, USUAL, WHOLE

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
def meet(i, origins, directions, begin, end, numbers, eye, amplitude, frequency, shift, found):
    eye_x, eye_z = np.float64(eye[0]), np.float64(eye[2])
    x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
    dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
    t, last = begin[i], end[i]
    mean = np.rint(y + dy * t) - amplitude
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


@scalar
def curvatures_at(numbers, x, z):
    """`tracer.weather.noise.Lattice.curvatures`, as five numbers."""
    i, j = math.floor(x), math.floor(z)
    u, v = x - i, z - j
    row, next_row = (int(i) & SIDE - 1) * SIDE, (int(i) + 1 & SIDE - 1) * SIDE
    column, next_column = int(j) & SIDE - 1, int(j) + 1 & SIDE - 1
    a, b = numbers[row + column], numbers[row + next_column]
    c, d = numbers[next_row + column], numbers[next_row + next_column]
    faded_u, faded_v = u * u * u * (u * (u * 6 - 15) + 10), v * v * v * (v * (v * 6 - 15) + 10)
    slope_u, slope_v = 30 * u * u * (u * (u - 2) + 1), 30 * v * v * (v * (v - 2) + 1)
    over, on = (c - a) * (1 - faded_v) + (d - b) * faded_v, (b - a) * (1 - faded_u) + (d - c) * faded_u
    bend_u, bend_v = 60 * u * (u - 1) * (2 * u - 1), 60 * v * (v - 1) * (2 * v - 1)
    return over * slope_u, on * slope_v, over * bend_u, (d - c - b + a) * slope_u * slope_v, on * bend_v


@scalar
def bent(numbers, px, pz, shares, amplitude, frequency, shift):
    """`tracer.weather.water.Water.curvatures`, as five numbers."""
    gx, gz, xx, xz, zz = 0.0, 0.0, 0.0, 0.0, 0.0
    for octave in range(COUNT):
        if shares[octave] > 0:
            often = frequency * SCALE[octave]
            found = curvatures_at(numbers, px * often + shift, pz * often * RATIO + shift)
            size = shares[octave] * WHOLE * amplitude * often
            gx, gz = gx + size * found[0], gz + size * RATIO * found[1]
            size *= often
            xx, xz, zz = xx + size * found[2], xz + size * RATIO * found[3], zz + size * RATIO * RATIO * found[4]
    return gx, gz, xx, xz, zz


@scalar
def edge(side, water, facet, long, cosine, ray, falls, distance, normal, sun):
    """How far the light of a cell of water reaches along one of its sides."""
    turned = (-(water[2] * side[0] + water[3] * side[2]), 0.0, -(water[3] * side[0] + water[4] * side[2]))
    tilt = scaled(along(turned, facet, -dot(facet, turned)), 1 / long)
    turn = added(scaled(facet, 2 * dot(tilt, sun)), scaled(tilt, 2 * cosine))
    moved = along(side, turn, distance)
    return along(moved, ray, -dot(normal, moved) / falls)


@scalar
def sent(place, water, one, other, point, normal, sun, least):
    """The share of its light that a cell of water sends to a point, by area there."""
    level = (-water[0], 1.0, -water[1])
    long = math.sqrt(dot(level, level))
    facet = scaled(level, 1 / long)
    cosine = dot(facet, sun)
    ray = along(scaled(facet, 2 * cosine), sun, -1.0)
    falls = dot(normal, ray)
    if falls > -1e-3 or cosine <= 0:
        return 0.0
    distance = dot(normal, along(point, place, -1.0)) / falls
    if distance <= 0:
        return 0.0
    first = edge(one, water, facet, long, cosine, ray, falls, distance, normal, sun)
    second = edge(other, water, facet, long, cosine, ray, falls, distance, normal, sun)
    off = along(along(place, ray, distance), point, -1.0)
    area = dot(normal, cross(first, second))
    if abs(area) < 1e-12:
        return 0.0
    tent = max(1 - abs(dot(normal, cross(off, second)) / area), 0.0)
    tent *= max(1 - abs(dot(normal, cross(first, off)) / area), 0.0)
    mirrored = DIELECTRIC_F0 + (1 - DIELECTRIC_F0) * (1 - min(cosine, 1.0)) ** 5
    return tent * mirrored / max(abs(area), least)


@scalar
def focused(i, points, normals, levels, numbers, toward, eye, amplitude, frequency, shift, finest, found):
    found[i] = 0.0
    if math.isinf(levels[i]):
        return
    sun_x, sun_y, sun_z = np.float64(toward[0]), np.float64(toward[1]), np.float64(toward[2])
    eye_x, eye_z = np.float64(eye[0]), np.float64(eye[2])
    point, normal, sun = triple(points, i, 0), triple(normals, i, 0), (sun_x, sun_y, sun_z)
    far, flat = (point[1] - levels[i]) / sun_y, math.sqrt(sun_x * sun_x + sun_z * sun_z)
    middle = (point[0] + sun_x * far, levels[i], point[2] + sun_z * far)
    away = math.sqrt((middle[0] - eye_x) * (middle[0] - eye_x) + (middle[2] - eye_z) * (middle[2] - eye_z))
    shares = (WEIGHT[0] * left_of(0, away), WEIGHT[1] * left_of(1, away), WEIGHT[2] * left_of(2, away))
    usual = 0.0
    for octave in range(COUNT):
        usual += (SCALE[octave] * shares[octave]) * (SCALE[octave] * shares[octave])
    reach = SPREAD * math.sqrt(usual) * USUAL * WHOLE * amplitude * frequency * RATIO * far
    a, b = max(reach / sun_y, finest) / MOST_CELLS, max(reach, finest) / MOST_CELLS
    to_x, to_z = (sun_x / flat, sun_z / flat) if flat > 1e-6 else (1.0, 0.0)
    one, other = (to_x * a, 0.0, to_z * a), (-to_z * b, 0.0, to_x * b)
    total, least = 0.0, a * b * sun_y / BRIGHTEST
    for row in range(-MOST_CELLS, MOST_CELLS + 1):
        for column in range(-MOST_CELLS, MOST_CELLS + 1):
            place = along(along(middle, one, float(row)), other, float(column))
            water = bent(numbers, place[0], place[2], shares, amplitude, frequency, shift)
            total += sent(place, water, one, other, point, normal, sun, least)
    found[i] = total * a * b * sun_y
