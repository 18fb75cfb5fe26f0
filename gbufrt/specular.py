"""How much light a dielectric mirrors toward the eye: what is under the surface shows the less."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import torch
from torch import Tensor

DIELECTRIC_F0 = 0.04  # reflectance at normal incidence, for a refractive index of 1.5
CELLS = (16, 64)  # of the table: from a mirror to the roughest, and from grazing to head on
STRATA = 32  # along each of the two numbers that a direction takes


def schlick(cosine: Tensor, f0: Tensor | float) -> Tensor:
    """Reflectance at a cosine from that at normal incidence.

    Source: Schlick 1994, eq. 15.
    """
    return f0 + (1 - f0) * (1 - cosine.clamp(0, 1)) ** 5


def smith_lambda(cosine: Tensor, alpha: Tensor | float) -> Tensor:
    """Smith's Lambda of GGX: hidden over visible microfacet area. Masking G1 = 1 / (1 + Lambda).

    Args:
        cosine: between the normal and the direction.
        alpha: perceptual roughness squared.

    Returns:
        As the arguments.

    Source: Heitz 2014, eq. 72.
    """
    c2 = (cosine * cosine).clamp(1e-8, 1.0)
    return 0.5 * ((1 + alpha * alpha * (1 - c2) / c2).sqrt() - 1)


@cache
def mirrored_table() -> Tensor:
    """``(CELLS[0] + 1, CELLS[1] + 1)`` float32: the share of an even light that GGX microfacets of a dielectric mirror,
    by roughness and cosine, both evenly spaced from 0 to 1.

    Source: Walter et al. 2007 (GGX); Schlick 1994; Heitz 2014, eq. 99 for the masking; Dupuy and Benyoub 2023 for the
    normals that the eye sees.
    """
    double: dict[str, Any] = {"dtype": torch.float64, "device": "cpu"}
    roughness, cosine = (torch.linspace(0, 1, n + 1, **double) for n in CELLS)
    z = cosine.clamp_min(1e-4)[None, :, None]
    a, b = ((torch.arange(STRATA, **double) + 0.5) / STRATA).expand(2, -1)
    a, azimuth = a.repeat(STRATA), 2 * math.pi * b.repeat_interleave(STRATA)
    rows = []
    for alpha in (roughness * roughness).tolist():
        x, size = alpha * (1 - z * z).sqrt(), ((1 - z * z) * alpha * alpha + z * z).sqrt()
        height = (1 - a) * (1 + z / size) - z / size
        radius = (1 - height * height).clamp_min(0).sqrt()
        hx, hy, hz = alpha * (radius * azimuth.cos() + x / size), alpha * radius * azimuth.sin(), height + z / size
        half = (hx * hx + hy * hy + hz * hz).sqrt()
        across = ((1 - z * z).sqrt() * hx + z * hz) / half  # cosine between the eye and the microfacet
        out = 2 * across * hz / half - z
        seen = 1 + smith_lambda(z, alpha)
        share = schlick(across, DIELECTRIC_F0) * seen / (seen + smith_lambda(out, alpha))
        rows.append(torch.where(out > 0, share, 0.0).mean(dim=-1)[0])
    return torch.stack(rows).float()


def mirrored_share(cosine: Tensor, roughness: Tensor) -> Tensor:
    """The share of an even light that a dielectric surface mirrors toward the eye.

    Args:
        cosine: between normal and eye, in [0, 1], any shape.
        roughness: perceptual, in [0, 1], the same shape.

    Returns:
        As the arguments; differentiable in both.
    """
    table = mirrored_table().to(cosine)
    r, c = roughness.clamp(0, 1) * CELLS[0], cosine.clamp(0, 1) * CELLS[1]
    row, column = (x.detach().long().clamp(0, n - 1) for x, n in zip((r, c), CELLS, strict=True))
    s, t = r - row, c - column
    first, second = (torch.lerp(table[row + i, column], table[row + i, column + 1], t) for i in (0, 1))
    return torch.lerp(first, second, s)
