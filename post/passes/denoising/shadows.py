"""Borders of shadows from single samples: history blurs them, and lags behind those that move."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.luminance import luminance
from post.filters.around import least, pooled
from post.filters.edges import padded, windows
from post.history.constants import YOUNG

NOISE, BLOCKED = 0.3, 0.6  # missing share of the mean: below NOISE it may be noise, above BLOCKED it is occlusion
FEW, MANY = 0.15, 0.4  # share of dark samples around from which on they are a shadow's, at first in part
BESIDE = 5  # pixels: side of the square over which the variance of samples is taken


def into_shadow(mean: Tensor, sample: Tensor, same: Tensor, sure: Tensor, often: Tensor | float = 0.0) -> Tensor:
    """Darken the mean where this frame's samples are far below it, but not below the neighbours' darkest mean.

    History blurs penumbrae and lags behind shadows that move, and disoccluded pixels borrow light from their
    neighbours. A bright sample proves little, since noise has a long bright tail. But a path to a lit surface hardly
    ever brings less than its direct light where each path has all of that; so dark samples side by side show that the
    light is occluded. Where light is sampled in part, dark samples lie among bright ones, and prove nothing; nor do
    they in a penumbra that stays where it is, where as many have been dark before.

    Args:
        mean: ``(B, 3, H, W)`` accumulated light without albedo.
        sample: as ``mean``, this frame's.
        same: see `alike`.
        sure: ``(B, 1, H, W)`` in [0, 1]: how far to follow the samples.
        often: ``(B, 1, H, W)`` in [0, 1]: see `often_dark`.

    Returns:
        ``(B, 3, H, W)``.
    """
    light, own = luminance(mean), luminance(sample)
    missing = 1 - own / light.clamp_min(1e-6)
    dark = (missing > BLOCKED).to(light.dtype)
    darkest, around, count = light, -dark, -torch.ones_like(dark)  # without the pixel itself
    views = windows(padded(torch.cat([light, dark], dim=1), 1), 1)
    for view, tap in zip(views, same.split(1, dim=1), strict=True):
        darkest = torch.where(tap, torch.minimum(darkest, view[:, :1]), darkest)
        around, count = around + view[:, 1:] * tap, count + tap
    together = ((around / count.clamp_min(1.0) - often - FEW) / (MANY - FEW)).clamp(0.0, 1.0)
    blocked = sure * together * ((missing - NOISE) / (BLOCKED - NOISE)).clamp(0.0, 1.0)
    darker = light + blocked * (torch.maximum(own, darkest) - light).clamp_max(0.0)
    return mean * (darker / light.clamp_min(1e-6)).clamp(0.0, 1.0)


def often_dark(mean: Tensor, variance: Tensor, length: Tensor, hit: Tensor, same: Tensor) -> Tensor:
    """Share of a history's samples that have been dark, ``(B, 1, H, W)`` in [0, 1).

    If a share p of them brings all the light and the others nothing, their relative variance is (1 - p) / p. In young
    histories, and where surfaces are small, it may be that of an edge; there the share is 0. The mean over a square is
    that of square roots: few pixels of much variance are the border of a sharp shadow.

    Args:
        mean: ``(B, 3, H, W)`` accumulated light without albedo.
        variance: ``(B, 1, H, W)`` of its luminance.
        length: ``(B, 1, H, W)`` frames in the mean.
        hit: ``(B, 1, H, W)`` bool.
        same: see `alike`.
    """
    noise = variance * length
    share = (noise / (noise + luminance(mean).square()).clamp_min(1e-8)).clamp_min(1e-8)  # whose root has a slope
    wide = least(same.all(1, keepdim=True).to(share), BESIDE)
    often = pooled(share.sqrt(), hit.to(share), BESIDE).square()
    return torch.where((length >= YOUNG) & (wide > 0), often, 0.0)
