"""Kernels of `tracer.sampling.scatter`: one direction at a time, as triples in world space."""

from __future__ import annotations

import math

from gbufrt.compute.approximations import cos_sin
from gbufrt.compute.kernel import inlined, scalar
from gbufrt.specular import CELLS, DIELECTRIC_F0, directional_albedo_table

ALBEDO = directional_albedo_table().numpy()


@scalar
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def scaled(a, s):
    return a[0] * s, a[1] * s, a[2] * s


@scalar
def times(a, b):
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@scalar
def added(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def along(a, b, s):
    """``a + b * s``."""
    return a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s


@scalar
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def tangent_frame(n):
    sign = 1.0 if n[2] >= 0 else -1.0
    a = -1 / (sign + n[2])
    b = n[0] * n[1] * a
    return (1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]), (b, sign + n[1] * n[1] * a, -n[1])


@inlined
def combined(first, second, third, x, y, z):
    """``first * x + second * y + third * z``."""
    return along(along(scaled(first, x), second, y), third, z)


@scalar
def fraction(x):
    """``x % 1``, without a call."""
    return x - math.floor(x)


@scalar
def disc(a, b):
    """See `tracer.sampling.sequence.disc`."""
    a, b = 2 * a - 1, 2 * b - 1
    if a == 0.0 and b == 0.0:
        return 0.0, 0.0
    if abs(a) > abs(b):
        cosine, sine = cos_sin(b / a / 8)
        return a * cosine, a * sine
    sine, cosine = cos_sin(a / b / 8)
    return b * cosine, b * sine


@inlined
def cosine_direction(normal, a, b):
    across, other = tangent_frame(normal)
    radius, (cosine, sine) = math.sqrt(a), cos_sin(b)
    return combined(across, other, normal, radius * cosine, radius * sine, math.sqrt(1 - a))


@scalar
def smith_lambda(cosine, alpha):
    square = min(max(cosine * cosine, 1e-8), 1.0)
    return 0.5 * (math.sqrt(1 + alpha * alpha * (1 - square) / square) - 1)


@scalar
def fresnel(f0, cosine):
    rest = (1 - min(max(cosine, 0.0), 1.0)) ** 5
    return f0[0] + (1 - f0[0]) * rest, f0[1] + (1 - f0[1]) * rest, f0[2] + (1 - f0[2]) * rest


@scalar
def directional_albedo(cosine, roughness):
    """See `gbufrt.specular.directional_albedo`."""
    r, c = min(max(roughness, 0.0), 1.0) * CELLS[0], min(max(cosine, 0.0), 1.0) * CELLS[1]
    row, column = min(int(r), CELLS[0] - 1), min(int(c), CELLS[1] - 1)
    s, t = r - row, c - column
    first = ALBEDO[row, column] * (1 - t) + ALBEDO[row, column + 1] * t
    second = ALBEDO[row + 1, column] * (1 - t) + ALBEDO[row + 1, column + 1] * t
    return first * (1 - s) + second * s


@scalar
def enters_smooth(cosine):
    """Share of light that a smooth dielectric does not reflect."""
    return (1 - DIELECTRIC_F0) * (1 - (1 - min(max(cosine, 0.0), 1.0)) ** 5)


@scalar
def sample_specular(normal, toward, alpha, a, b):
    """See `tracer.sampling.scatter.sample_specular`."""
    across, other = tangent_frame(normal)
    z = max(dot(toward, normal), 0.0)
    sx, sy = alpha * dot(toward, across), alpha * dot(toward, other)
    size = math.sqrt(max(sx * sx + sy * sy + z * z, 1e-20))
    sx, sy, sz = sx / size, sy / size, z / size
    cosine, sine = cos_sin(b)
    height = (1 - a) * (1 + sz) - sz
    radius = math.sqrt(max(1 - height * height, 0.0))
    hx, hy = alpha * (radius * cosine + sx), alpha * (radius * sine + sy)
    hz = max(height + sz, 1e-7)
    facet = scaled(combined(across, other, normal, hx, hy, hz), 1 / math.sqrt(hx * hx + hy * hy + hz * hz))
    cosine = min(max(dot(toward, facet), 0.0), 1.0)
    direction = along(scaled(toward, -1.0), facet, 2 * cosine)
    direction = scaled(direction, 1 / math.sqrt(dot(direction, direction)))
    lit, view = dot(direction, normal), smith_lambda(z, alpha)
    weight = (1 + view) / (1 + view + smith_lambda(lit, alpha)) if lit > 0 else 0.0
    return direction, weight, cosine


@scalar
def specular_response(normal, toward, alpha, f0, direction):
    lit = dot(normal, direction)
    if not lit > 0:
        return 0.0, 0.0, 0.0
    half = added(toward, direction)
    half = scaled(half, 1 / math.sqrt(max(dot(half, half), 1e-24)))
    view, up = dot(normal, toward), dot(normal, half)
    square = alpha * alpha
    spread = square / (math.pi * (up * up * (square - 1) + 1) ** 2)
    masked = 1 + smith_lambda(view, alpha) + smith_lambda(lit, alpha)
    return scaled(fresnel(f0, dot(half, toward)), spread / (4 * max(view, 1e-4) * masked))
