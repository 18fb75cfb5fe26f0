"""Average filtered light with that of neighbours, as the noise that each keeps requires: one small kernel."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.luminance import luminance
from post.filters.around import kindred, pooled
from post.filters.edges import Surface
from post.filters.op import spatial_moments, wavelet

AROUND = 7  # pixels: square over which noise is compared with light
LEAST = 0.1  # relative variance of the best of neighbours: they count alike below
NOISE = 0.5  # share of measured variance that is taken to be noise: the rest is contrast of the light itself
FAR = 8  # pixels to each side: what pixels next to alone on their surface are compared with
ALONE = 1.0  # as NOISE, of such pixels: they hold little contrast of their own
SAME_LIGHT = 0.02  # of the light: surfaces are taken to differ by this at least
PHI_COLOR, PHI_NORMAL = 0.3, 16.0  # see `post.atrous`


def certain_mean(
    light: Tensor,
    variance: Tensor,
    kept: Tensor,
    geometry: Surface,
    lonely: Tensor | None = None,
    metallic: Tensor | None = None,
) -> Tensor:
    """Average filtered light over 5x5 pixels, weighted by the inverse of the variance that the filter likely left.

    Filters average over surfaces, so a narrow one keeps more noise than a wide one beside it, and so does the border
    of any. Where a filter left the same variance all around, this is a plain small blur that keeps edges. Where noise
    is more than the difference between the surfaces side by side, light is first drawn toward the mean of them all, and
    where next to no pixel shows the same surface toward that of like ones farther around.

    Variance measured from few samples is itself uncertain: where all of them missed the light it is zero. So pixels
    have at least the relative variance of those around.

    Args:
        light: ``(B, 3, H, W)``, filtered, without albedo.
        variance: ``(B, 1, H, W)`` of its luminance before the filter.
        kept: ``(B, 1, H, W)`` in [0, 1]: share of the variance that the filter leaves of independent noise.
        geometry: of the same size.
        lonely: ``(B, 1, H, W)`` in [0, 1]: how far pixels lean on like surfaces `FAR` around, in place of all surfaces
            side by side; none where absent.
        metallic: ``(B, 1, H, W)`` bool: pixels that lean half as far, as metals show other things side by side.

    Returns:
        ``(B, 3, H, W)``; pixels that hit nothing are as before.

    Source: Rousselle et al. 2012 and 2013 choose filters by the error they leave; weights are those of the
    Gauss-Markov theorem, for neighbours taken to be independent; Efron and Morris 1973 (shrinkage toward a mean).
    """
    lit, own = geometry.hit.to(light.dtype), luminance(light)
    noise, around = pooled(torch.cat([variance, own], dim=1), lit, AROUND).split(1, dim=1)
    square = around.square().clamp_min(1e-8)
    left = kept * torch.maximum(variance, noise / square * torch.maximum(own, around).square())
    light = torch.where(geometry.hit, _shrunk(light, NOISE * left, square, geometry, lonely, metallic), light)
    certain, (compared, _) = 1 / (left / square + LEAST), spatial_moments(light, geometry)
    values = torch.cat([light * certain, certain, compared, left], dim=1)
    sums = wavelet(values, geometry, step=1, phi_color=PHI_COLOR, phi_depth=1.0, phi_normal=PHI_NORMAL)
    return torch.where(geometry.hit, sums[:, :3] / sums[:, 3:4].clamp_min(1e-12), light)


def _shrunk(
    light: Tensor, noise: Tensor, square: Tensor, geometry: Surface, lonely: Tensor | None, metallic: Tensor | None
) -> Tensor:
    """Draw light toward its mean over pixels of other surfaces too, by the share of noise in how they differ.

    A surface of a pixel or two has no neighbours to average over, and what its few samples say may be far off. That of
    the surfaces around is then the better guess: of the 3x3 pixels, or for ``lonely`` pixels of like surfaces farther
    around, as bodies that thin come by the dozen.
    """
    own, weight = luminance(light), geometry.hit.to(light.dtype) / (noise / square + LEAST)
    values = torch.cat([light, own * own, noise], dim=1)
    near = _toward(light, noise, pooled(values, weight))
    near = near if metallic is None else torch.where(metallic, (light + near) / 2, near)
    if lonely is None:
        return near
    far = _toward(light, noise * (ALONE / NOISE), kindred(values, weight, lonely > 0, geometry, FAR))
    return near + lonely * (far - near)


def _toward(light: Tensor, noise: Tensor, means: Tensor) -> Tensor:
    """Light drawn toward a mean; ``means`` ``(B, 5, H, W)`` are of the light, its luminance's square, and its noise."""
    mean, squares, typical = means.split([3, 1, 1], dim=1)
    level = luminance(mean)
    differ = (squares - level * level - typical).clamp_min(0.0) + (SAME_LIGHT * level).square()
    return light + noise / (noise + differ).clamp_min(1e-12) * (mean - light)
