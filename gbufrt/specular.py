"""The GGX microfacet model: Fresnel, masking, visible normals, and the directional albedo of a dielectric.

Arguments may have any shapes that broadcast. The compiled form is `tracer.sampling.scatter_kernel`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import torch
from torch import Tensor

from gbufrt.compute.resident import resident

DIELECTRIC_F0 = 0.04  # reflectance at normal incidence, for a refractive index of 1.5
MIRROR_ROUGHNESS = 0.03  # below it all samples of a lobe are one ray
LAMP_ROUGHNESS = 0.3  # below it specular rays sample lamps, above it shadow rays do
BROAD_ROUGHNESS = 0.4  # from here on a reflection may be blurred as much as any signal
VIRTUAL_ROUGHNESS = 0.5  # above it a reflection moves with its surface, below with what it reflects
CELLS = (16, 64)  # of the table: roughness from 0 to 1, and cosine from grazing to normal incidence
STRATA = 32  # along each of the two random numbers of a direction


def schlick(cosine: Tensor, f0: Tensor | float) -> Tensor:
    """Fresnel reflectance at a cosine, from ``f0`` at normal incidence.

    Source: Schlick 1994, eq. 15.
    """
    return f0 + (1 - f0) * (1 - cosine.clamp(0, 1)) ** 5


def smith_lambda(cosine: Tensor, alpha: Tensor | float) -> Tensor:
    """Smith's Lambda of GGX: the ratio of hidden to visible microfacet area. Masking G1 = 1 / (1 + Lambda).

    Args:
        cosine: between the normal and the direction.
        alpha: perceptual roughness squared.

    Returns:
        As the arguments.

    Source: Heitz 2014, eq. 72.
    """
    c2 = (cosine * cosine).clamp(1e-8, 1.0)
    return 0.5 * ((1 + alpha * alpha * (1 - c2) / c2).sqrt() - 1)


def ggx_distribution(cos_half: Tensor, alpha: Tensor) -> Tensor:
    """Density of microfacet normals at ``cos_half`` from the normal, per steradian of projected area.

    Args:
        cos_half: cosine between the normal and the half vector.
        alpha: perceptual roughness squared, above 0.

    Returns:
        As the arguments.

    Source: Walter et al. 2007, eq. 33.
    """
    a2 = alpha * alpha
    return a2 / (math.pi * (cos_half * cos_half * (a2 - 1) + 1) ** 2)


def masking_ratio(cos_view: Tensor, cos_light: Tensor, alpha: Tensor) -> Tensor:
    """G2 / G1 with height-correlated masking: the weight, before Fresnel, of a sample of the visible normals.

    Args:
        cos_view: between the normal and the eye.
        cos_light: between the normal and the light; at or below 0 nothing is reflected.
        alpha: perceptual roughness squared.

    Returns:
        As the arguments, in [0, 1].

    Source: Heitz 2018, eq. 19; Heitz 2014, eq. 99.
    """
    visible = 1 + smith_lambda(cos_view, alpha)
    return torch.where(cos_light > 0, visible / (visible + smith_lambda(cos_light, alpha)), 0.0)


def sample_visible_normal(view: Sequence[Tensor], alpha: Tensor | float, u: Sequence[Tensor]) -> tuple[Tensor, ...]:
    """A GGX microfacet normal, drawn in proportion to its visible area.

    Args:
        view: x, y, z of the unit direction to the eye, in the shading frame (z along the normal).
        alpha: perceptual roughness squared; 0 gives the normal.
        u: two numbers in [0, 1).

    Returns:
        x, y, z, unit length, in the shading frame.

    Source: Heitz 2018 (the distribution); Dupuy and Benyoub 2023 (sampling it from a spherical cap).
    """
    sx, sy, sz = alpha * view[0], alpha * view[1], view[2]
    length = (sx * sx + sy * sy + sz * sz).clamp_min(1e-20).sqrt()
    sx, sy, sz = sx / length, sy / length, sz / length
    azimuth, height = 2 * math.pi * u[1], (1 - u[0]) * (1 + sz) - sz
    radius = (1 - height * height).clamp_min(1e-30).sqrt()  # not of 0, where its slope is infinite
    x, y = alpha * (radius * azimuth.cos() + sx), alpha * (radius * azimuth.sin() + sy)
    z = (height + sz).clamp_min(1e-7)
    length = (x * x + y * y + z * z).sqrt()
    return x / length, y / length, z / length


@cache
def directional_albedo_table() -> Tensor:
    """`directional_albedo` at uniform steps of roughness and cosine: ``(CELLS[0] + 1, CELLS[1] + 1)`` float32.

    Source: Walter et al. 2007 (GGX); Schlick 1994; Heitz 2014, eq. 99 for the masking.
    """
    double: dict[str, Any] = {"dtype": torch.float64, "device": "cpu"}
    roughness, cosine = (torch.linspace(0, 1, n + 1, **double) for n in CELLS)
    cosine = cosine.clamp_min(1e-4)[:, None]
    view = ((1 - cosine * cosine).sqrt(), torch.zeros_like(cosine), cosine)
    a, b = ((torch.arange(STRATA, **double) + 0.5) / STRATA).expand(2, -1)
    u = a.repeat(STRATA), b.repeat_interleave(STRATA)
    rows = []
    for alpha in roughness * roughness:
        half = sample_visible_normal(view, alpha, u)
        facing = view[0] * half[0] + view[2] * half[2]
        share = schlick(facing, DIELECTRIC_F0) * masking_ratio(cosine, 2 * facing * half[2] - cosine, alpha)
        rows.append(share.mean(dim=-1))
    return torch.stack(rows).float()


def directional_albedo(cosine: Tensor, roughness: Tensor) -> Tensor:
    """The share of uniform light that the specular lobe of a dielectric reflects toward the eye.

    Args:
        cosine: between normal and eye, in [0, 1], any shape.
        roughness: perceptual, in [0, 1], the same shape.

    Returns:
        As the arguments; differentiable in both.
    """
    table = resident(directional_albedo_table, cosine)
    r, c = roughness.clamp(0, 1) * CELLS[0], cosine.clamp(0, 1) * CELLS[1]
    row, column = (x.detach().long().clamp(0, n - 1) for x, n in zip((r, c), CELLS, strict=True))
    s, t = r - row, c - column
    first, second = (torch.lerp(table[row + i, column], table[row + i, column + 1], t) for i in (0, 1))
    return torch.lerp(first, second, s)
