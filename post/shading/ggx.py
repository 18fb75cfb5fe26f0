"""The GGX microfacet model in the shading frame (z along the normal), as planes ``(B, 1, H, W)`` or anything alike."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.specular import DIELECTRIC_F0, mirrored_share, smith_lambda


def specular_f0(albedo: Tensor, metallic: Tensor) -> Tensor:
    """Reflectance at normal incidence: 0.04 for dielectrics, the albedo for metals.

    Args:
        albedo: ``(B, 3, H, W)`` linear, in [0, 1].
        metallic: ``(B, 1, H, W)`` in [0, 1].

    Returns:
        ``(B, 3, H, W)``.
    """
    return DIELECTRIC_F0 + (albedo - DIELECTRIC_F0) * metallic


def fresnel_schlick(cosine: Tensor, f0: Tensor) -> Tensor:
    """Share of light that a surface reflects.

    Args:
        cosine: between the light and the microfacet's normal, ``(B, 1, H, W)``.
        f0: reflectance at normal incidence, ``(B, 3, H, W)``.

    Returns:
        ``(B, 3, H, W)``, from ``f0`` at normal incidence to 1 at grazing incidence.

    Source: Schlick 1994, eq. 15.
    """
    return f0 + (1 - f0) * grazing(cosine)


def grazing(cosine: Tensor) -> Tensor:
    """Schlick's (1 - cosine)^5, by which reflectance goes from ``f0`` to 1."""
    left = 1 - cosine.clamp(0, 1)
    squared = left * left
    return squared * squared * left


def mirrored_by(gbuffer: GBuffer) -> Tensor:
    """The share of light that surfaces mirror toward the eye if they are dielectrics, 0 where nothing was hit.

    Args:
        gbuffer: surfaces; without ``roughness`` they are taken to be smooth.

    Returns:
        ``(B, 1, H, W)`` in [0, 1]; differentiable.

    Source: see `gbufrt.specular.mirrored_table`.
    """
    g = gbuffer
    toward = g.camera.to_eye(g.camera.unproject(g.depth.detach()))  # the same at any depth
    eye = g.camera.rotate_to_world(toward)
    cosine = (eye * g.normal).sum(1, keepdim=True).clamp(0.0, 1.0)
    roughness = torch.zeros_like(cosine) if g.roughness is None else g.roughness
    return torch.where(g.hit, mirrored_share(cosine, roughness), 0.0)


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
    seen = 1 + smith_lambda(cos_view, alpha)
    return torch.where(cos_light > 0, seen / (seen + smith_lambda(cos_light, alpha)), 0.0)


def reflection_pdf(cos_view: Tensor, cos_half: Tensor, alpha: Tensor) -> Tensor:
    """Density, per steradian, of directions that mirror the eye at a sample of the visible normals.

    Args:
        cos_view: between the normal and the eye.
        cos_half: between the normal and the half vector.
        alpha: perceptual roughness squared, above 0.

    Returns:
        As the arguments.

    Source: Heitz 2018, eq. 17.
    """
    cos_view = cos_view.clamp_min(1e-4)
    return ggx_distribution(cos_half, alpha) / (4 * cos_view * (1 + smith_lambda(cos_view, alpha)))


def sample_visible_normal(view: Tensor, alpha: Tensor, u: Tensor) -> Tensor:
    """A GGX microfacet normal, as often as the eye sees it.

    Args:
        view: ``(B, 3, ...)`` unit, from the surface to the eye, shading frame.
        alpha: ``(B, 1, ...)`` perceptual roughness squared; 0 gives the normal.
        u: ``(B, 2, ...)`` uniform in [0, 1).

    Returns:
        ``(B, 3, ...)`` unit, shading frame.

    Source: Heitz 2018 (the distribution); Dupuy and Benyoub 2023 (sampling it from a spherical cap).
    """
    stretched = torch.cat([alpha * view[:, :2], view[:, 2:]], dim=1)
    stretched = stretched / (stretched * stretched).sum(1, keepdim=True).clamp_min(1e-20).sqrt()
    azimuth = 2 * math.pi * u[:, 1:2]
    z = (1 - u[:, 0:1]) * (1 + stretched[:, 2:]) - stretched[:, 2:]
    radius = (1 - z * z).clamp_min(1e-30).sqrt()  # not of 0, where its slope is infinite
    half = torch.cat([radius * azimuth.cos(), radius * azimuth.sin(), z], dim=1) + stretched
    half = torch.cat([alpha * half[:, :2], half[:, 2:].clamp_min(1e-7)], dim=1)
    return half / (half * half).sum(1, keepdim=True).sqrt()


def tangent_frame(normal: Tensor) -> tuple[Tensor, Tensor]:
    """Two unit vectors that make a right-handed frame with ``normal``.

    Args:
        normal: ``(B, 3, ...)`` unit.

    Returns:
        Tangent and bitangent, ``(B, 3, ...)`` each.

    Source: Duff et al. 2017.
    """
    x, y, z = normal.unbind(1)
    sign = torch.where(z >= 0, 1.0, -1.0).to(normal)
    a = -1 / (sign + z)
    b = x * y * a
    tangent = torch.stack([1 + sign * x * x * a, sign * b, -sign * x], dim=1)
    return tangent, torch.stack([b, sign + y * y * a, -y], dim=1)
