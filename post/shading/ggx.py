"""The GGX microfacet model in the shading frame (z along the normal), as planes ``(B, 1, H, W)`` or any other shape."""

from __future__ import annotations

from torch import Tensor

from gbufrt.specular import DIELECTRIC_F0, ggx_distribution, smith_lambda


def specular_f0(albedo: Tensor, metallic: Tensor) -> Tensor:
    """Reflectance at normal incidence: 0.04 for dielectrics, the albedo for metals.

    Args:
        albedo: ``(B, 3, H, W)`` linear, in [0, 1].
        metallic: ``(B, 1, H, W)`` in [0, 1].

    Returns:
        ``(B, 3, H, W)``.
    """
    return DIELECTRIC_F0 + (albedo - DIELECTRIC_F0) * metallic


def grazing(cosine: Tensor) -> Tensor:
    """Schlick's (1 - cosine)^5, by which reflectance goes from ``f0`` to 1."""
    left = 1 - cosine.clamp(0, 1)
    squared = left * left
    return squared * squared * left


def reflection_pdf(cos_view: Tensor, cos_half: Tensor, alpha: Tensor) -> Tensor:
    """Density, per steradian, of directions that reflect the eye at a sample of the visible normals.

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
