"""One ray through the air of an atmosphere; `gbufrt.atmosphere.reference` defines what it finds."""

from __future__ import annotations

import math

from gbufrt.atmosphere.scales import AHEAD, BRIGHTEST, DARKEST, DUSK, LONGEST, NEAR, SUN_RADIUS
from gbufrt.compute.kernel import scalar

RADIUS, THICKNESS, RAYLEIGH, RAYLEIGH_HEIGHT, MIE, MIE_ABSORPTION, MIE_HEIGHT, ASYMMETRY = 0, 1, 2, 5, 6, 7, 8, 9
OZONE, OZONE_HEIGHT, OZONE_WIDTH = 10, 13, 14
"""Columns of the numbers of an atmosphere."""


@scalar
def spread(cosine):
    """A cosine to the zenith on a scale that is finer near the horizon, where light changes fast."""
    if cosine < 0:
        return math.sqrt(NEAR) - math.sqrt(NEAR - cosine)
    return math.sqrt(NEAR + cosine) - math.sqrt(NEAR)


@scalar
def _within(place, count):
    """First of the two entries of a table that a place in 0..1 lies between, and the share of the second."""
    place = min(max(place, 0.0), 1.0) * (count - 1)
    first = min(int(place), count - 2)
    return first, place - first


@scalar
def _to_space(air, table, height, below, cosine):
    """Transmittance of a ray that does not meet the ground, and of each colour."""
    above = max(air[THICKNESS] - height, 0.0) * (2 * air[RADIUS] + air[THICKNESS] + height)
    along = (air[RADIUS] + height) * cosine
    root = math.sqrt(along * along + above)
    away = above / max(root + along, 1e-9) if along > 0 else root - along
    rho, whole, least = math.sqrt(below), math.sqrt(above + below), air[THICKNESS] - height
    row, v = _within(rho / whole, table.shape[0])
    column, u = _within((away - least) / (rho + whole - least), table.shape[1])
    a, b, c, d = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
    return (
        a * table[row, column, 0]
        + b * table[row, column + 1, 0]
        + c * table[row + 1, column, 0]
        + d * table[row + 1, column + 1, 0],
        a * table[row, column, 1]
        + b * table[row, column + 1, 1]
        + c * table[row + 1, column, 1]
        + d * table[row + 1, column + 1, 1],
        a * table[row, column, 2]
        + b * table[row, column + 1, 2]
        + c * table[row + 1, column, 2]
        + d * table[row + 1, column + 1, 2],
    )


@scalar
def _to_sun(air, table, height, cosine):
    """Share of the sun's light that arrives, 0 where the ground hides its disc."""
    below = height * (2 * air[RADIUS] + height)
    horizon = -math.sqrt(below) / (air[RADIUS] + height)
    shown = min(max((cosine - horizon) / (2 * SUN_RADIUS) + 0.5, 0.0), 1.0)
    if shown == 0.0:
        return 0.0, 0.0, 0.0
    r, g, b = _to_space(air, table, height, below, max(cosine, horizon))
    shown = shown * shown * (3 - 2 * shown)
    return r * shown, g * shown, b * shown


@scalar
def _again(table, shape, row, sun, up, between):
    """Logarithms of what molecules and aerosols send along a ray of the light that is scattered already."""
    dusk = sun / DUSK
    height = math.log(dusk + math.sqrt(dusk * dusk + 1))  # asinh is a slow call
    column, p = _within((height - DARKEST) / (BRIGHTEST - DARKEST), shape[0])
    row, q = _within(row, shape[1])
    rise, r = _within(0.5 + 0.5 * spread(up) / LONGEST, shape[2])
    flat = math.sqrt(max((1 - up * up) * (1 - sun * sun), 1e-12))
    turn = 0.5 - 0.5 * min(max((between - up * sun) / flat, -1.0), 1.0)
    side, s = _within(turn * (1 + AHEAD) / (turn + AHEAD), shape[3])
    a, b, c, d, e, f = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    first = ((column * shape[1] + row) * shape[2] + rise) * shape[3] + side
    for corner in range(8):
        x, y, z = corner >> 2, corner >> 1 & 1, corner & 1
        far = (p if x else 1 - p) * (q if y else 1 - q) * (r if z else 1 - r)
        near, far = far * (1 - s), far * s
        texel = first + ((x * shape[1] + y) * shape[2] + z) * shape[3]
        a += near * table[texel, 0] + far * table[texel + 1, 0]
        b += near * table[texel, 1] + far * table[texel + 1, 1]
        c += near * table[texel, 2] + far * table[texel + 1, 2]
        d += near * table[texel, 3] + far * table[texel + 1, 3]
        e += near * table[texel, 4] + far * table[texel + 1, 4]
        f += near * table[texel, 5] + far * table[texel + 1, 5]
    return a, b, c, d, e, f


@scalar
def _phases(g, cosine):
    """Of molecules, and of aerosols."""
    both = 1 + cosine * cosine
    shape = both / (1 + g * g - 2 * g * cosine) ** 1.5
    return 3 / (16 * math.pi) * both, 3 / (8 * math.pi) * (1 - g * g) / (2 + g * g) * shape


@scalar
def _passed(lost, scattered, clear, step):
    """What a step adds to a ray's light in one colour, and the ray's transmittance behind it."""
    passed = math.exp(-lost * step)
    return clear * (1 - passed) / max(lost, 1e-12) * scattered, clear * passed


@scalar
def _place(air, height, up, sun, between, at):
    """On a ray, so far from where it begins: height, and cosines of sun and ray to the zenith there."""
    radius = air[RADIUS] + height
    over = height * (2 * air[RADIUS] + height) + at * (2 * radius * up + at)
    here = over / (math.sqrt(max(air[RADIUS] * air[RADIUS] + over, 0.0)) + air[RADIUS])
    here = min(max(here, 0.0), air[THICKNESS])
    return here, (radius * sun + at * between) / (air[RADIUS] + here), (radius * up + at) / (air[RADIUS] + here)


@scalar
def through_air(i, rays, air, transmittance, again, shape, steps, out):
    """Light and transmittance of ray ``i`` up to each of its steps, as far as ``out`` has room, and all of it last."""
    height, up, sun, between, stop = rays[i, 0], rays[i, 1], rays[i, 2], rays[i, 3], rays[i, 4]
    clear, hazy = _phases(air[ASYMMETRY], between)
    r, g, b, x, y, z, near = 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0
    for k in range(steps):
        far = stop * ((k + 1) / steps) ** 2
        here, sun_here, up_here = _place(air, height, up, sun, between, 0.5 * (near + far))
        red, green, blue = _to_sun(air, transmittance, here, sun_here)
        a, c, e, m, n, o = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if shape[0] > 0:
            row = math.sqrt(here / air[THICKNESS])
            a, c, e, m, n, o = _again(again, shape, row, sun_here, up_here, between)
            a, c, e, m, n, o = math.exp(a), math.exp(c), math.exp(e), math.exp(m), math.exp(n), math.exp(o)
        thin, thick = math.exp(-here / air[RAYLEIGH_HEIGHT]), math.exp(-here / air[MIE_HEIGHT])
        aerosols, haze = air[MIE] * thick, (air[MIE] + air[MIE_ABSORPTION]) * thick
        layer = max(1 - abs(here - air[OZONE_HEIGHT]) / air[OZONE_WIDTH], 0.0)
        molecules = air[RAYLEIGH] * thin
        sent = molecules * (red * clear + a) + aerosols * (red * hazy + m)
        gain, x = _passed(molecules + haze + layer * air[OZONE], sent, x, far - near)
        r += gain
        molecules = air[RAYLEIGH + 1] * thin
        sent = molecules * (green * clear + c) + aerosols * (green * hazy + n)
        gain, y = _passed(molecules + haze + layer * air[OZONE + 1], sent, y, far - near)
        g += gain
        molecules = air[RAYLEIGH + 2] * thin
        sent = molecules * (blue * clear + e) + aerosols * (blue * hazy + o)
        gain, z = _passed(molecules + haze + layer * air[OZONE + 2], sent, z, far - near)
        b += gain
        near, place = far, min(k, out.shape[1] - 1)
        out[i, place, 0], out[i, place, 1], out[i, place, 2] = r, g, b
        out[i, place, 3], out[i, place, 4], out[i, place, 5] = x, y, z
