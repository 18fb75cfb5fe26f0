"""Average filtered light with that of neighbours that keep less noise: inverse-variance weights, one small kernel."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.luminance import luminance
from post.filters.edges import Surface
from post.filters.op import spatial_moments, wavelet
from post.history.antilag import pooled

AROUND = 7  # pixels: square over which noise is compared with light
DIMMEST = 0.25  # of the light around: darker pixels owe that to samples that happened to bring nothing
SPACING = 4  # pixels between the taps that tell how much of its surface a filter finds around a pixel
LEAST = 0.1  # relative variance of the best of neighbours: they count alike below
PHI_COLOR, PHI_NORMAL = 0.3, 16.0  # see `post.atrous`


def certain_mean(light: Tensor, variance: Tensor, geometry: Surface) -> Tensor:
    """Average filtered light over 5x5 pixels, weighted by the inverse of the variance that the filter likely left.

    Filters average over surfaces, so a narrow one keeps more noise than a wide one beside it, and so does the border
    of any. Where a filter left the same variance all around, this is a plain small blur that keeps edges.

    Variance measured from few samples is itself uncertain: where all of them missed the light it is zero. So pixels
    have at least the relative variance of those around. What the filter left of it follows from the surface alone.

    Args:
        light: ``(B, 3, H, W)``, filtered, without albedo.
        variance: ``(B, 1, H, W)`` of its luminance before the filter.
        geometry: of the same size.

    Returns:
        ``(B, 3, H, W)``; pixels that hit nothing are as before.

    Source: Rousselle et al. 2012 and 2013 choose filters by the error they leave; weights are those of the
    Gauss-Markov theorem, for neighbours taken to be independent.
    """
    lit, own, none = geometry.hit.to(light.dtype), luminance(light), torch.zeros_like(variance)
    noise, around = pooled(torch.cat([variance, own], dim=1), lit, AROUND).split(1, dim=1)
    relative = noise / around.square().clamp_min(1e-10)
    left = torch.maximum(variance, relative * torch.maximum(own, DIMMEST * around).square())
    alone = torch.cat([none, none, torch.ones_like(none)], dim=1)
    left = left * _filtered(alone, geometry, none, SPACING)[:, 2:]
    certain = 1 / (left / around.square().clamp_min(1e-8) + LEAST)
    compared, _ = spatial_moments(light, geometry)
    sums = _filtered(torch.cat([light * certain, certain, compared, left], dim=1), geometry, none, 1)
    return torch.where(geometry.hit, sums[:, :3] / sums[:, 3:4].clamp_min(1e-12), light)


def _filtered(values: Tensor, geometry: Surface, reach: Tensor, step: int) -> Tensor:
    return wavelet(values, geometry, reach, step=step, phi_color=PHI_COLOR, phi_depth=1.0, phi_normal=PHI_NORMAL)
