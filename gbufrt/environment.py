"""Lat-long pictures of the sky: the direction of each pixel, and lookup by direction.

Row 0 touches the zenith (+y), the last row the nadir. The middle of the picture is -z, and +x lies a quarter of the
width right of it, so that the picture is not mirrored; its left and right borders join at +z.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt.sampling import sample

TINY = 1e-12  # keeps the gradient finite at the poles, where the azimuth is undefined


def environment_directions(
    size: tuple[int, int], *, dtype: torch.dtype = torch.float32, device: torch.device | str | None = None
) -> Tensor:
    """World-space unit directions of the pixel centres of a lat-long picture.

    Args:
        size: ``(h, w)``.
        dtype: float type of the result.
        device: where to put it.

    Returns:
        ``(1, 3, h, w)``.
    """
    height, width = size
    polar = (torch.arange(height, dtype=dtype, device=device) + 0.5) * (math.pi / height)
    azimuth = (torch.arange(width, dtype=dtype, device=device) + 0.5) * (2 * math.pi / width) - math.pi
    polar, azimuth = torch.meshgrid(polar, azimuth, indexing="ij")
    return torch.stack([polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos()])[None]


def environment_solid_angles(
    size: tuple[int, int], *, dtype: torch.dtype = torch.float32, device: torch.device | str | None = None
) -> Tensor:
    """``(1, 1, h, 1)`` steradians that each pixel of a lat-long picture of ``size`` ``(h, w)`` covers."""
    height, width = size
    edges = (torch.arange(height + 1, dtype=torch.float64, device=device) * (math.pi / height)).cos()
    return ((edges[:-1] - edges[1:]) * (2 * math.pi / width)).to(dtype)[None, None, :, None]


def environment_mean(environment: Tensor) -> Tensor:
    """``(B, C, 1, 1)`` mean over all directions of lat-long pictures ``(B, C, h, w)``; polar rows cover little."""
    height, width = environment.shape[-2:]
    angles = environment_solid_angles((height, width), dtype=environment.dtype, device=environment.device)
    return (environment * angles).sum((2, 3), keepdim=True) / (4 * math.pi)


def lookup_environment(environment: Tensor, directions: Tensor) -> Tensor:
    """What a lat-long picture shows in the given directions.

    Args:
        environment: ``(B, C, h, w)`` or ``(1, C, h, w)``, see the module for which way it faces.
        directions: ``(B, 3, H, W)`` world space, of any length; the zero vector reads the horizon.

    Returns:
        ``(B, C, H, W)``, bilinear across the seam; differentiable in both.

    Raises:
        ValueError: ``directions`` does not have three components.
    """
    if directions.ndim != 4 or directions.shape[1] != 3:
        raise ValueError(f"directions must be (B,3,H,W) in world space, got {tuple(directions.shape)}")
    height, width = environment.shape[-2:]
    x, y, z = directions.unbind(dim=1)
    across = (x * x + z * z).clamp_min(TINY).sqrt()
    pole = across * across <= TINY * 1.5
    azimuth = torch.atan2(torch.where(pole, 0.0, x), torch.where(pole, 1.0, -z))
    column = (azimuth / (2 * math.pi) + 0.5) * width
    row = torch.atan2(across, y) / math.pi * height
    wrapped = torch.cat([environment[..., -1:], environment, environment[..., :1]], dim=-1)
    return sample(wrapped, torch.stack([column + 1.0, row], dim=1))
