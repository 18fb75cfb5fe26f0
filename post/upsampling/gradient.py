"""How much of the light of the frame before has changed, told by samples that are taken again; see `post.asvgf`."""

from __future__ import annotations

from dataclasses import replace

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import GBuffer, History
from gbufrt.luminance import luminance
from post.filters.constants import HIT
from post.filters.edges import Surface
from post.filters.op import wavelet
from post.filters.surfaces import surface
from post.upsampling.op import upsample

STRATUM = 3  # pixels: side of the squares of which one pixel is replayed
ITERATIONS = 4  # of wavelets over the replayed pixels: they reach 90 pixels to each side
PHI_NORMAL = 32.0  # exponent of the cosine between normals of replayed pixels
LEAST = 1e-3  # frames: length of a history none of which is valid, for pixels of length 0 match no surface


def temporal_gradient(before: Tensor, replayed: Tensor, chosen: Tensor, gbuffer: GBuffer) -> Tensor:
    """Share of the light of the frame before that has changed since.

    The change in luminance of each replayed sample, and the larger of its two luminances, are filtered by wavelets
    over the replayed pixels alone; their ratio is brought to every pixel along surfaces. What has not changed gives
    exactly 0, as its samples are the same. Since everything stays on the pixels of the frame before, histories need it
    before they are reprojected, and no pixel has to be projected forward.

    Args:
        before: ``(B, 3, H, W)`` samples of the frame before.
        replayed: ``(B, 3, H, W)`` the same samples in the scene as it is now.
        chosen: see `post.asvgf`.
        gbuffer: of the frame before.

    Returns:
        ``(B, 1, H, W)`` in [0, 1], at the pixels of the frame before.

    Source: Schied, Peters and Dachsbacher 2018, 4.2 and 4.3.
    """
    geometry = surface(gbuffer.depth, gbuffer.normal, gbuffer.hit, gbuffer.camera)
    most, which = F.max_pool2d(chosen.to(before), STRATUM, ceil_mode=True, return_indices=True)
    there = most > 0
    was, now, guide = (_of_strata(x, which) for x in (luminance(before), luminance(replayed), geometry.guide))
    known = there & (guide[:, HIT : HIT + 1] > 0)
    guide = torch.cat([guide[:, :HIT], known.to(was), guide[:, HIT + 1 :]], dim=1)
    plane = _of_strata(geometry.scaled(STRATUM, STRATUM), which)
    coarse, none = Surface(guide, plane, geometry.perspective), torch.zeros_like(was)
    values = torch.where(known, torch.cat([now - was, torch.maximum(now, was), none, none], dim=1), 0.0)
    for iteration in range(ITERATIONS):
        values = wavelet(values, coarse, step=2**iteration, phi_color=1.0, phi_depth=1 / STRATUM, phi_normal=PHI_NORMAL)
    share = (values[:, :1].abs() / values[:, 1:2].clamp_min(1e-9)).clamp_max(1.0)
    row, column = (min(STRATUM // 2, side - 1) for side in gbuffer.depth.shape[2:])
    rows, columns = (len(range(o, n, STRATUM)) for o, n in zip((row, column), gbuffer.depth.shape[2:], strict=True))
    moved = geometry.guide.clone()  # a square's sample stands in its middle, as what it is a sample of
    moved[..., row::STRATUM, column::STRATUM] = guide[..., :rows, :columns]
    share = share[..., :rows, :columns].contiguous()
    found = upsample(share, replace(geometry, guide=moved), stride=STRATUM, offset=(row, column))
    return torch.where(gbuffer.hit, found, 0.0)


def forgetting(history: History, change: Tensor) -> History:
    """The history with its length cut so that the next frame counts lerp(1 / N, 1, change) in the mean of N frames.

    Args:
        history: of the frame before.
        change: ``(B, 1, H, W)`` in [0, 1], see `temporal_gradient`.
    """
    weight = torch.lerp(1 / (history.length + 1), torch.ones_like(change), change)
    shorter = torch.minimum(history.length, (1 / weight - 1).clamp_min(LEAST))
    return replace(history, length=torch.where(change > 0, shorter, history.length))


def _of_strata(picture: Tensor, which: Tensor) -> Tensor:
    """``(B, C, h, w)`` one pixel of each 3x3 square, by its number in the picture, ``(B, 1, h, w)``."""
    channels = picture.shape[1]
    pixels = picture.flatten(2).gather(2, which.flatten(2).expand(-1, channels, -1))
    return pixels.unflatten(2, which.shape[2:])
