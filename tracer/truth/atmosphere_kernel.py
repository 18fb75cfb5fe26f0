"""Light paths through an atmosphere, one direction and one colour at a time."""

from __future__ import annotations

import math

from gbufrt.compute.kernel import scalar
from tracer.sampling.scatter_kernel import combined, dot, tangent_frame

MARCH = 96  # steps along a ray; their length follows the density of the air
RADIUS, TOP, RAYLEIGH, RAYLEIGH_HEIGHT, MIE, MIE_ABSORPTION, MIE_HEIGHT, ASYMMETRY = 0, 1, 2, 5, 6, 7, 8, 9
OZONE, OZONE_HEIGHT, OZONE_WIDTH, ALBEDO, SUN = 10, 13, 14, 15, 16
"""Columns of the numbers of an atmosphere; the direction to the sun comes last."""


@scalar
def _random(state):
    """The next state, and a number in [0, 1). Source: O'Neill 2014 (PCG-RXS-M-XS)."""
    state = (state * 747796405 + 2891336453) & 0xFFFFFFFF
    word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737 & 0xFFFFFFFF
    return state, ((word >> 22) ^ word) * (1 / 4294967296.0)


@scalar
def _height(air, x, y, z):
    """Above the ground; the place is given from the ground below the eye, so that no digits are lost."""
    over = x * x + z * z + y * (2 * air[RADIUS] + y)
    return over / (math.sqrt(air[RADIUS] * air[RADIUS] + over) + air[RADIUS])


@scalar
def _medium(air, colour, height):
    """Scattering by molecules, by aerosols, and extinction."""
    molecules = air[RAYLEIGH + colour] * math.exp(-height / air[RAYLEIGH_HEIGHT])
    haze = math.exp(-height / air[MIE_HEIGHT])
    layer = max(1 - abs(height - air[OZONE_HEIGHT]) / air[OZONE_WIDTH], 0.0) * air[OZONE + colour]
    return molecules, air[MIE] * haze, molecules + (air[MIE] + air[MIE_ABSORPTION]) * haze + layer


@scalar
def _end(air, at, way):
    """Distance to where a ray leaves the air or meets the ground, and whether it does that."""
    up = at[0] * way[0] + (at[1] + air[RADIUS]) * way[1] + at[2] * way[2]
    height = max(_height(air, at[0], at[1], at[2]), 0.0)
    below = height * (2 * air[RADIUS] + height)
    square = up * up - below
    if up < 0 and square >= 0:
        return below / (math.sqrt(square) - up), True
    above = max(air[TOP] - height, 0.0) * (2 * air[RADIUS] + air[TOP] + height)
    root = math.sqrt(up * up + above)
    return (above / (root + up) if up > 0 else root - up), False


@scalar
def _moved(at, way, t):
    return at[0] + way[0] * t, at[1] + way[1] * t, at[2] + way[2] * t


@scalar
def _depth(air, colour, at, way, end, wanted):
    """Optical depth of a ray, and where it reaches the depth that is wanted, or its end."""
    depth, before = 0.0, 0.0
    for k in range(MARCH):
        after = end * ((k + 1) / MARCH) ** 2
        x, y, z = _moved(at, way, 0.5 * (before + after))
        lost = _medium(air, colour, max(_height(air, x, y, z), 0.0))[2]
        step = lost * (after - before)
        if depth + step >= wanted:
            return wanted, before + (wanted - depth) / lost
        depth, before = depth + step, after
    return depth, end


@scalar
def _phase(air, molecules, aerosols, cosine):
    g = air[ASYMMETRY]
    clear = 3 / (16 * math.pi) * (1 + cosine * cosine)
    shape = (1 + cosine * cosine) / (1 + g * g - 2 * g * cosine) ** 1.5
    haze = 3 / (8 * math.pi) * (1 - g * g) / (2 + g * g) * shape
    return (molecules * clear + aerosols * haze) / (molecules + aerosols)


@scalar
def _from_sun(air, colour, at):
    """Share of the sun's light that arrives at a place."""
    toward = (air[SUN], air[SUN + 1], air[SUN + 2])
    end, grounded = _end(air, at, toward)
    if grounded:
        return 0.0
    return math.exp(-_depth(air, colour, at, toward, end, math.inf)[0])


@scalar
def _path(air, colour, height, way, first, bounces, state):
    """What one path brings from a sun of unit irradiance, from its ``first`` bounce on."""
    at, weight, light = (0.0, height, 0.0), 1.0, 0.0
    toward = (air[SUN], air[SUN + 1], air[SUN + 2])
    for bounce in range(bounces):
        end, grounded = _end(air, at, way)
        whole = math.inf if grounded else _depth(air, colour, at, way, end, math.inf)[0]
        state, u = _random(state)
        reach = -math.log(1 - u * (1 - math.exp(-whole)))  # what does not meet the ground is scattered
        weight *= 1 - math.exp(-whole)
        depth, t = _depth(air, colour, at, way, end, reach)
        at = _moved(at, way, t)
        state, a = _random(state)
        state, b = _random(state)
        azimuth = 2 * math.pi * b
        if grounded and depth < reach:
            up = (at[0], at[1] + air[RADIUS], at[2])
            length = math.sqrt(dot(up, up))
            up = (up[0] / length, up[1] / length, up[2] / length)
            weight *= air[ALBEDO]
            lifted = _moved(at, up, 1e-6)
            if bounce >= first:
                light += weight / math.pi * max(dot(up, toward), 0.0) * _from_sun(air, colour, lifted)
            across, other = tangent_frame(up)
            sine = math.sqrt(a)
            way = combined(across, other, up, sine * math.cos(azimuth), sine * math.sin(azimuth), math.sqrt(1 - a))
            at = lifted
        else:
            molecules, aerosols, lost = _medium(air, colour, max(_height(air, at[0], at[1], at[2]), 0.0))
            weight *= (molecules + aerosols) / lost
            if bounce >= first:
                light += weight * _phase(air, molecules, aerosols, dot(way, toward)) * _from_sun(air, colour, at)
            g = air[ASYMMETRY]
            state, c = _random(state)
            hazy = c * (molecules + aerosols) < aerosols
            if hazy and g > 1e-3:
                ratio = (1 - g * g) / (1 - g + 2 * g * a)
                cosine = (1 + g * g - ratio * ratio) / (2 * g)
            else:
                cosine = 2 * a - 1
            drawn = (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
            density = (molecules / (4 * math.pi) + aerosols * drawn) / (molecules + aerosols)
            weight *= _phase(air, molecules, aerosols, cosine) / density
            across, other = tangent_frame(way)
            sine = math.sqrt(max(1 - cosine * cosine, 0.0))
            way = combined(across, other, way, sine * math.cos(azimuth), sine * math.sin(azimuth), cosine)
    return light, state


@scalar
def gather(i, out, ways, air, height, first, bounces, paths, seed):
    """Mean of many paths along direction ``i // 3``, colour ``i % 3``."""
    way = (float(ways[i // 3, 0]), float(ways[i // 3, 1]), float(ways[i // 3, 2]))
    state, total = (i * 9781 + seed * 6271 + 12345) & 0xFFFFFFFF, 0.0
    for _ in range(paths):
        light, state = _path(air, i % 3, height, way, first, bounces, state)
        total += light
    out[i] = total / paths
