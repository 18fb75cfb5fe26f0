"""Cut samples that stand far above all that surrounds them, and give the light that this takes back where it is dim."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.luminance import luminance
from post.filters.around import most_beside
from post.filters.edges import Surface
from post.filters.op import spatial_moments
from post.history.antilag import grain_of, trusted
from post.history.changes import spread
from post.history.constants import YOUNG

RADIUS = 3  # pixels: surroundings of a sample are 7x7 pixels
LONE = 4.0  # times the limit, from which on samples are cut where there is little noise as well
MOST = 10.0  # times the light that is kept: more than this is lost, since what few samples bring is uncertain
WIDE = 5  # wavelets over which light is given back: they reach 62 pixels to each side
ENOUGH = 200.0  # samples of a surface that tell as much of what is to be given back to it as all that is around, as
# wavelets count them: on surfaces narrower than they are each counts several times
BLOCK, BLOCKS = 4, 13  # pixels along a block, and blocks along the square of what is around: 52 pixels


def cut_outliers(
    signal: Tensor, geometry: Surface, state: Tensor | None, noise: Tensor | None, lead: int, firefly: float
) -> Tensor:
    """Scale down samples far above the surface around, unless the pixel's own history explains them.

    Unlike `antilag.without_fireflies`, which looks at 3x3 pixels of any surface, this works from the first frame on.
    Outliers among those around do not raise the limit: none counts for more than the brightest of the eight beside it.
    Where there is little noise all around only what stands out far is cut, and where there is none nothing: there what
    stands out is light.

    Args:
        signal: ``(B, C, H, W)`` of this frame.
        geometry: of this frame.
        state: ``(B, C + lead + 2 + K, H, W)`` of the frame before at this frame's pixels, which begins as that of
            `post.history.op.taken_in` and ends with the age; None at first.
        noise: ``(B, 1, H, W)`` of the state, see `antilag.typical_variance`.
        lead: channels that make the luminance, and are scaled.
        firefly: standard deviations above history, or above the surroundings, at which a sample is cut; 0 keeps all.

    Returns:
        ``(B, C, H, W)``.
    """
    light = luminance(signal, lead)
    if firefly <= 0:
        return signal
    second = torch.minimum(light, most_beside(light))
    mean, variance = spatial_moments(second, geometry, radius=RADIUS, lead=1)
    limit = mean + firefly * variance.add(1e-12).sqrt()
    lone = LONE * limit
    if state is not None and noise is not None:
        own = luminance(state[:, : signal.shape[1]], lead) + firefly * noise.add(1e-12).sqrt()
        limit = torch.where(state[:, -1:] >= YOUNG, torch.maximum(limit, own), limit)
    grain = grain_of(signal[:, :lead], (light - mean).square(), geometry.hit)
    limit = limit + trusted(grain, torch.ones_like(light)) * (lone - limit).clamp_min(0.0)
    scale = torch.where((light > limit) & (limit > 0), limit / light.clamp_min(1e-12), 1.0)
    scale = scale + (1 - scale) / (1 + grain**3)
    return torch.cat([signal[:, :lead] * scale, signal[:, lead:]], dim=1)


def taken(signal: Tensor, kept: Tensor, lead: int) -> Tensor:
    """Luminance ``(B, 1, H, W)`` that a cut took, at most `MOST` times what it ``kept``."""
    light = luminance(kept, lead)
    return torch.minimum(luminance(signal, lead) - light, MOST * light).clamp_min(0.0)


def still_missing(cut: Tensor, was: Tensor, now: Tensor) -> Tensor:
    """What a mean still lacks of light that was ``cut``, after it has followed a change of light.

    Noise that is taken for a change brings a mean light that cuts have taken already: it is not to be given back again,
    here or around, so that the rest may be negative. Where light went, what was cut of it went as well.

    Args:
        cut: ``(B, 1, H, W)`` mean luminance that cuts took.
        was: as ``cut``, luminance of the mean before it followed.
        now: as ``cut``, after.

    Returns:
        As ``cut``.
    """
    return torch.where(now > was, cut - (now - was), cut * (now / was.clamp_min(1e-12)).clamp_max(1.0))


def given_back(
    smooth: Tensor,
    mean: Tensor,
    cut: Tensor,
    geometry: Surface,
    *,
    wide: int = WIDE,
    reach: Tensor | None = None,
    length: Tensor | None = None,
) -> Tensor:
    """Brighten each surface by the share of its light that cuts took over a wide area of it: its mean stays.

    On a small surface few samples tell that share, and one that was cut at a highlight would brighten all of it: the
    share of all surfaces around counts as well then.

    Args:
        smooth: ``(B, 3, H, W)`` filtered light.
        mean: as ``smooth``, before the filter.
        cut: ``(B, 1, H, W)`` luminance, that cuts took, accumulated as ``mean`` was.
        geometry: of this frame.
        wide: wavelets over which light is given back.
        reach: ``(B, 1, H, W)``, see `spread`.
        length: ``(B, 1, H, W)`` frames in the mean, which make its samples many or few; by default any number is
            enough.

    Returns:
        ``(B, 3, H, W)``, at most twice as bright.

    Source: Efron and Morris 1973 (shrinkage toward a mean).
    """
    planes, alone = torch.cat([luminance(mean), cut], dim=1), torch.ones_like(cut)
    averaged, left = spread(planes, alone, geometry, wide, reach)  # of one over ``left`` samples
    light, away = averaged.split(1, 1)
    share = (away / light.clamp_min(1e-6)).clamp(0.0, 1.0)
    if length is not None:
        near = _around(torch.where(geometry.hit, planes, 0.0))
        typical = (near[:, 1:] / near[:, :1].clamp_min(1e-6)).clamp(0.0, 1.0)
        share = typical + (share - typical) / (1 + ENOUGH * left / length.clamp_min(1.0))
    return smooth * (1 + share)


def _around(planes: Tensor) -> Tensor:
    """Means over squares, of any surface; one for all pixels of a block."""
    blocks = F.avg_pool2d(planes, BLOCK, ceil_mode=True)
    means = F.avg_pool2d(blocks, BLOCKS, stride=1, padding=BLOCKS // 2, count_include_pad=False)
    wide = means.repeat_interleave(BLOCK, dim=2).repeat_interleave(BLOCK, dim=3)
    return wide[..., : planes.shape[2], : planes.shape[3]]
