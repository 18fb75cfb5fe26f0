"""Light paths through an atmosphere, one direction and one colour at a time."""

from __future__ import annotations

import math

from gbufrt.compute.kernel import scalar
from tracer.sampling.scatter_kernel import combined, dot, tangent_frame
from tracer.truth.air_kernel import ALBEDO, ASYMMETRY, RADIUS, SUN, end_of, from_sun, height_of, medium, moved, phase

MARCH = 96  # steps along a ray; their length follows the density of the air
LOW = 0.1  # sine of the height of a sun under which paths climb on purpose, and few end early: light is high up
STEP = 0.8812714616335696  # 1 / x, where x**6 == x + 1


@scalar
def _random(state):
    """The next state, and a number in [0, 1). Source: O'Neill 2014 (PCG-RXS-M-XS)."""
    state = (state * 747796405 + 2891336453) & 0xFFFFFFFF
    word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737 & 0xFFFFFFFF
    return state, ((word >> 22) ^ word) * (1 / 4294967296.0)


@scalar
def _along(air, table, colour, at, way, end, jitter):
    """Optical depth of a ray, and the sun's light that it scatters once."""
    toward = (air[SUN], air[SUN + 1], air[SUN + 2])
    cosine = dot(way, toward)
    depth, light, clear, before = 0.0, 0.0, 1.0, 0.0
    for k in range(MARCH):
        after = end * ((k + 1) / MARCH) ** 2
        here = moved(at, way, before + jitter * (after - before))
        height = max(height_of(air, here[0], here[1], here[2]), 0.0)
        molecules, aerosols, lost = medium(air, colour, height)
        passed = math.exp(-lost * (after - before))
        scattered = (molecules + aerosols) * phase(air, molecules, aerosols, cosine)
        light += clear * (1 - passed) / lost * scattered * from_sun(air, table, colour, here, height)
        depth += lost * (after - before)
        clear *= passed
        before = after
    return depth, light


@scalar
def _until(air, colour, at, way, end, jitter, wanted, distance):
    """Where a ray reaches an optical depth or a distance, the depth there, and the extinction."""
    depth, before, lost = 0.0, 0.0, 0.0
    for k in range(MARCH):
        after = end * ((k + 1) / MARCH) ** 2
        x, y, z = moved(at, way, before + jitter * (after - before))
        lost = medium(air, colour, max(height_of(air, x, y, z), 0.0))[2]
        step = lost * (min(after, distance) - before)
        if depth + step >= wanted:
            return before + (wanted - depth) / lost, wanted, lost
        if after >= distance:
            return distance, depth + step, lost
        depth, before = depth + step, after
    return end, depth, lost


@scalar
def _drawn(air, colour, at, way, end, jitter, clear, u, share):
    """A distance to where a ray is scattered, and its weight.

    A ``share`` is drawn by optical depth. By that alone hardly any path would climb above the shadow of the ground,
    where all light of a sun that is down comes from: the rest is drawn by distance.
    """
    if u < share:
        wanted = -math.log(1 - u / share * (1 - clear))
        t, depth, lost = _until(air, colour, at, way, end, jitter, wanted, end)
    else:
        distance = end * ((u - share) / (1 - share)) ** 2
        t, depth, lost = _until(air, colour, at, way, end, jitter, math.inf, distance)
    scattered = math.exp(-depth) * lost
    by_distance = 0.5 / math.sqrt(max(t * end, 1e-12))
    return t, scattered / (share * scattered / (1 - clear) + (1 - share) * by_distance)


@scalar
def _ground(air, at):
    """Zenith of a place on the ground, and a place just above it, which the ground does not hide."""
    up = (at[0], at[1] + air[RADIUS], at[2])
    length = math.sqrt(dot(up, up))
    up = (up[0] / length, up[1] / length, up[2] / length)
    return up, moved(at, up, 1e-6)


@scalar
def _scattered(air, colour, at, way, a, b, c):
    """A new direction of light at a place, and its weight: what is not absorbed, phase over density."""
    molecules, aerosols, lost = medium(air, colour, max(height_of(air, at[0], at[1], at[2]), 0.0))
    g, both = air[ASYMMETRY], molecules + aerosols
    if c * both < aerosols and g > 1e-3:
        ratio = (1 - g * g) / (1 - g + 2 * g * a)
        cosine = (1 + g * g - ratio * ratio) / (2 * g)
    else:
        cosine = 2 * a - 1
    drawn = (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
    density = (molecules / (4 * math.pi) + aerosols * drawn) / both
    weight = both / lost * phase(air, molecules, aerosols, cosine) / density
    across, other = tangent_frame(way)
    sine, azimuth = math.sqrt(max(1 - cosine * cosine, 0.0)), 2 * math.pi * b
    return combined(across, other, way, sine * math.cos(azimuth), sine * math.sin(azimuth), cosine), weight


@scalar
def _path(air, table, colour, height, way, first, bounces, jitter, numbers, state):
    """What one path brings from a sun of unit irradiance, from its ``first`` bounce on.

    Each of its rays takes all light that it scatters once more toward the eye, and not that of one place alone:
    at dawn most places are in the shadow of the ground.
    """
    at, weight, light = (0.0, height, 0.0), 1.0, 0.0
    toward = (air[SUN], air[SUN + 1], air[SUN + 2])
    share, survival = (0.5, 16.0) if toward[1] < LOW else (1.0, 2.0)
    for bounce in range(bounces):
        end, grounded = end_of(air, at, way)
        depth, once = _along(air, table, colour, at, way, end, jitter)
        clear = math.exp(-depth)
        if bounce >= first:
            light += weight * once
        up, lifted = (0.0, 1.0, 0.0), at
        if grounded:
            up, lifted = _ground(air, moved(at, way, end))
            if bounce >= first:
                lit = max(dot(up, toward), 0.0) * from_sun(air, table, colour, lifted, 0.0)
                light += weight * clear * air[ALBEDO] / math.pi * lit
        if bounce > 0:  # paths that bring little end early
            state, u = _random(state)
            if u >= weight * survival:
                return light, state
            weight = max(weight, 1 / survival)
            state, r = _random(state)
            state, a = _random(state)
            state, b = _random(state)
            state, c = _random(state)
        else:
            r, a, b, c = numbers
        if grounded and r < clear:
            weight *= air[ALBEDO]
            across, other = tangent_frame(up)
            sine, azimuth = math.sqrt(a), 2 * math.pi * b
            way = combined(across, other, up, sine * math.cos(azimuth), sine * math.sin(azimuth), math.sqrt(1 - a))
            at = lifted
        else:
            if grounded:
                r = (r - clear) / (1 - clear)
                weight /= 1 - clear
            t, drawn = _drawn(air, colour, at, way, end, jitter, clear, r, share)
            at = moved(at, way, t)
            way, kept = _scattered(air, colour, at, way, a, b, c)
            weight *= drawn * kept
        state, jitter = _random(state)
    return light, state


@scalar
def gather(i, out, ways, air, table, height, first, bounces, paths, seed):
    """Mean of many paths along direction ``i // 3``, colour ``i % 3``; their first bounces are spread evenly.

    Source: Cranley and Patterson 1976 for the random shift; Roberts 2018 (R5) for the steps.
    """
    way = (float(ways[i // 3, 0]), float(ways[i // 3, 1]), float(ways[i // 3, 2]))
    state, total = (i * 9781 + seed * 6271 + 12345) & 0xFFFFFFFF, 0.0
    state, j = _random(state)
    state, r = _random(state)
    state, a = _random(state)
    state, b = _random(state)
    state, c = _random(state)
    for _ in range(paths):
        j, r = (j + STEP) % 1.0, (r + STEP**2) % 1.0
        a, b, c = (a + STEP**3) % 1.0, (b + STEP**4) % 1.0, (c + STEP**5) % 1.0
        light, state = _path(air, table, i % 3, height, way, first, bounces, j, (r, a, b, c), state)
        total += light
    out[i] = total / paths
