"""The air that light paths go through: where it ends, what it is made of, what of the sun's light it lets by."""

from __future__ import annotations

import math

from gbufrt.compute.kernel import scalar

RADIUS, TOP, RAYLEIGH, RAYLEIGH_HEIGHT, MIE, MIE_ABSORPTION, MIE_HEIGHT, ASYMMETRY = 0, 1, 2, 5, 6, 7, 8, 9
OZONE, OZONE_HEIGHT, OZONE_WIDTH, ALBEDO, SUN = 10, 13, 14, 15, 16
"""Columns of the numbers of an atmosphere; the direction to the sun comes last."""
FINE = 256  # steps to space, for the table of columns; their length follows the density of the air


@scalar
def height_of(air, x, y, z):
    """Above the ground; the place is given from the ground below the eye, so that no digits are lost."""
    over = x * x + z * z + y * (2 * air[RADIUS] + y)
    return over / (math.sqrt(air[RADIUS] * air[RADIUS] + over) + air[RADIUS])


@scalar
def medium(air, colour, height):
    """Scattering by molecules, by aerosols, and extinction."""
    molecules = air[RAYLEIGH + colour] * math.exp(-height / air[RAYLEIGH_HEIGHT])
    haze = math.exp(-height / air[MIE_HEIGHT])
    layer = max(1 - abs(height - air[OZONE_HEIGHT]) / air[OZONE_WIDTH], 0.0) * air[OZONE + colour]
    return molecules, air[MIE] * haze, molecules + (air[MIE] + air[MIE_ABSORPTION]) * haze + layer


@scalar
def end_of(air, at, way):
    """Distance to where a ray leaves the air or meets the ground, and whether it does that."""
    up = at[0] * way[0] + (at[1] + air[RADIUS]) * way[1] + at[2] * way[2]
    height = max(height_of(air, at[0], at[1], at[2]), 0.0)
    below = height * (2 * air[RADIUS] + height)
    square = up * up - below
    if up < 0 and square >= 0:
        return below / (math.sqrt(square) - up), True
    above = max(air[TOP] - height, 0.0) * (2 * air[RADIUS] + air[TOP] + height)
    root = math.sqrt(up * up + above)
    return (above / (root + up) if up > 0 else root - up), False


@scalar
def moved(at, way, t):
    return at[0] + way[0] * t, at[1] + way[1] * t, at[2] + way[2] * t


@scalar
def phase(air, molecules, aerosols, cosine):
    g = air[ASYMMETRY]
    clear = 3 / (16 * math.pi) * (1 + cosine * cosine)
    shape = (1 + cosine * cosine) / (1 + g * g - 2 * g * cosine) ** 1.5
    haze = 3 / (8 * math.pi) * (1 - g * g) / (2 + g * g) * shape
    return (molecules * clear + aerosols * haze) / (molecules + aerosols)


@scalar
def fill(i, out, air):
    """Columns of molecules, aerosols and ozone from a height, in a direction, to space: pixel ``i`` of ``out``.

    Source: Bruneton and Neyret 2008 for what rows and columns stand for.
    """
    rows, columns = out.shape[:2]
    whole = math.sqrt(air[TOP] * (2 * air[RADIUS] + air[TOP]))
    rho = whole * (i // columns) / (rows - 1)
    height = rho * rho / (math.sqrt(rho * rho + air[RADIUS] * air[RADIUS]) + air[RADIUS])
    least = air[TOP] - height
    end = least + (rho + whole - least) * (i % columns) / (columns - 1)
    up = 1.0
    if end > 0:
        up = (whole * whole - rho * rho - end * end) / (2 * (air[RADIUS] + height) * end)
    up = min(max(up, -1.0), 1.0)
    molecules, aerosols, ozone = 0.0, 0.0, 0.0
    for k in range(FINE):
        before, after = end * (k / FINE) ** 2, end * ((k + 1) / FINE) ** 2
        t = 0.5 * (before + after)
        here = max(height_of(air, t * math.sqrt(1 - up * up), height + t * up, 0.0), 0.0)
        molecules += (after - before) * math.exp(-here / air[RAYLEIGH_HEIGHT])
        aerosols += (after - before) * math.exp(-here / air[MIE_HEIGHT])
        ozone += (after - before) * max(1 - abs(here - air[OZONE_HEIGHT]) / air[OZONE_WIDTH], 0.0)
    out[i // columns, i % columns, 0] = molecules
    out[i // columns, i % columns, 1] = aerosols
    out[i // columns, i % columns, 2] = ozone


@scalar
def from_sun(air, table, colour, at, height):
    """Share of the sun's light that arrives at a place."""
    up = at[0] * air[SUN] + (at[1] + air[RADIUS]) * air[SUN + 1] + at[2] * air[SUN + 2]
    below = height * (2 * air[RADIUS] + height)
    if up < 0 and up * up >= below:
        return 0.0
    above = max(air[TOP] - height, 0.0) * (2 * air[RADIUS] + air[TOP] + height)
    root = math.sqrt(up * up + above)
    end = above / max(root + up, 1e-9) if up > 0 else root - up
    rho, whole, least = math.sqrt(below), math.sqrt(above + below), air[TOP] - height
    rows, columns = table.shape[:2]
    row = min(rho / whole, 1.0) * (rows - 1)
    column = min(max((end - least) / (rho + whole - least), 0.0), 1.0) * (columns - 1)
    y, x = min(int(row), rows - 2), min(int(column), columns - 2)
    v, u = row - y, column - x
    a, b, c, d = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
    depth = air[RAYLEIGH + colour] * (
        a * table[y, x, 0] + b * table[y, x + 1, 0] + c * table[y + 1, x, 0] + d * table[y + 1, x + 1, 0]
    )
    depth += (air[MIE] + air[MIE_ABSORPTION]) * (
        a * table[y, x, 1] + b * table[y, x + 1, 1] + c * table[y + 1, x, 1] + d * table[y + 1, x + 1, 1]
    )
    depth += air[OZONE + colour] * (
        a * table[y, x, 2] + b * table[y, x + 1, 2] + c * table[y + 1, x, 2] + d * table[y + 1, x + 1, 2]
    )
    return math.exp(-depth)
