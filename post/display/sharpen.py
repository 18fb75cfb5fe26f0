"""Sharpening that stays within the contrast that is there."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.sampling import shifted

MOST = 0.1875  # weight of a neighbour, as a share of the pixel's own, that is never exceeded
CROSS = ((-1, 0), (1, 0), (0, -1), (0, 1))


def sharpened(toned: Tensor, strength: float) -> Tensor:
    """Take away some of the four neighbours, as much as keeps every channel between 0 and 1 next to edges.

    Args:
        toned: ``(B, C, H, W)`` in [0, 1].
        strength: 0 for none, 1 for the most.

    Source: the idea of robust contrast-adaptive sharpening, AMD FidelityFX FSR 1, 2021.
    """
    taps = [shifted(toned, dx, dy) for dx, dy in CROSS]
    low, high, total = taps[0], taps[0], torch.zeros_like(toned)
    for tap in taps:
        low, high, total = torch.minimum(low, tap), torch.maximum(high, tap), total + tap
    to_black = low / (4 * high).clamp_min(1e-6)
    to_white = (1 - high).clamp_min(0.0) / (4 * (1 - low)).clamp_min(1e-6)
    lobe = torch.minimum(to_black, to_white).amin(1, keepdim=True).clamp(0.0, MOST) * strength
    return ((toned - lobe * total) / (1 - 4 * lobe)).clamp(0.0, 1.0)
