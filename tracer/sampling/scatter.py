"""Reflection by surfaces: a Lambertian diffuse and a GGX specular part, on rows ``(N, 3)`` in world space."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt.directions import tangent_frame
from gbufrt.specular import ggx_distribution, masking_ratio, sample_visible_normal, schlick, smith_lambda


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Inner product ``(N,)`` of rows ``(N, 3)``."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def mirrored(directions: Tensor, normals: Tensor) -> Tensor:
    """Rays ``(..., 3)`` as surfaces with these normals, on either side, reflect them."""
    return directions - 2 * (directions * normals).sum(-1, keepdim=True) * normals


def cosine_direction(normals: Tensor, u: Tensor) -> Tensor:
    """Directions ``(N, 3)`` above ``normals``, with density cosine / pi, from numbers ``(2, N)`` in [0, 1)."""
    across, other = tangent_frame(normals)
    angle, square = 2 * math.pi * u[1], u[0]
    radius = square.sqrt()
    parts = ((across, radius * angle.cos()), (other, radius * angle.sin()), (normals, (1 - square).sqrt()))
    return sum((axis * part[:, None] for axis, part in parts), torch.zeros_like(normals))


def sample_specular(normals: Tensor, toward: Tensor, alpha: Tensor, u: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Reflect the view direction at microfacets, drawn in proportion to their visible area.

    Args:
        normals: ``(N, 3)`` unit length.
        toward: ``(N, 3)`` unit length, to the eye.
        alpha: ``(N,)`` perceptual roughness squared; 0 for a mirror.
        u: ``(2, N)`` in [0, 1).

    Returns:
        Directions ``(N, 3)``; their weight ``(N,)`` before Fresnel, 0 below the surface; and the cosine ``(N,)``
        between the eye and the microfacet.

    Source: Heitz 2018 (eq. 19 the weight).
    """
    across, other = tangent_frame(normals)
    view = dot(toward, across), dot(toward, other), dot(toward, normals).clamp_min(0)
    x, y, z = sample_visible_normal(view, alpha, u.unbind())
    facet = across * x[:, None] + other * y[:, None] + normals * z[:, None]
    cosine = dot(toward, facet).clamp(0.0, 1.0)
    direction = torch.nn.functional.normalize(2 * cosine[:, None] * facet - toward, dim=1)
    weight = masking_ratio(view[2], dot(direction, normals), alpha)
    return direction, weight, cosine


def fresnel(f0: Tensor, cosine: Tensor) -> Tensor:
    """``(N, 3)`` share that is reflected, from reflectance ``(N, 3)`` at normal incidence and cosine ``(N,)``."""
    return schlick(cosine[:, None], f0)


def specular_response(normals: Tensor, toward: Tensor, alpha: Tensor, f0: Tensor, directions: Tensor) -> Tensor:
    """``(N, 3)`` GGX reflectance x cosine, for light from ``directions`` ``(N, 3)``; alpha above 0.

    Source: Walter et al. 2007, eq. 20 and 33; Heitz 2014, eq. 99 for the masking of both sides.
    """
    half = torch.nn.functional.normalize(toward + directions, dim=1)
    view, lit, up = dot(normals, toward), dot(normals, directions), dot(normals, half)
    masked = 1 + smith_lambda(view, alpha) + smith_lambda(lit, alpha)
    value = torch.where(lit > 0, ggx_distribution(up, alpha) / (4 * view.clamp_min(1e-4) * masked), 0.0)
    return fresnel(f0, dot(half, toward)) * value[:, None]
