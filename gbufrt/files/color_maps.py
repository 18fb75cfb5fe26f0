"""Colours for numbers: light as a screen shows it, amounts, directions in the picture, ids, signs."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt.noise.noise import GOLDEN

# Viridis (Smith and van der Walt 2015, CC0) as a polynomial of degree six, lowest first (Zucker's fit, CC0).
VIRIDIS = (
    (0.2777273, 0.0054073, 0.3340998),
    (0.1050930, 1.4046135, 1.3845902),
    (-0.3308618, 0.2148476, 0.0950952),
    (-4.6342305, -5.7991010, -19.3324410),
    (6.2282699, 14.1799334, 56.6905526),
    (4.7763850, -13.7451454, -65.3530326),
    (-5.4354559, 4.6458526, 26.3124352),
)


def viridis(value: Tensor) -> Tensor:
    """The colour map: ``(B, 1, H, W)`` in [0, 1] to display-referred ``(B, 3, H, W)``."""
    value = value.clamp(0, 1)
    result = value.new_zeros(value.shape[0], 3, *value.shape[2:])
    for row in reversed(VIRIDIS):
        result = result * value + value.new_tensor(row)[None, :, None, None]
    return result.clamp(0, 1)


def to_srgb(linear: Tensor) -> Tensor:
    """Linear light ``(B, 3, H, W)``, clamped to [0, 1], to display-referred sRGB (IEC 61966-2-1)."""
    from kornia.color import linear_rgb_to_rgb  # late: kornia takes most of a second to import

    return linear_rgb_to_rgb(linear.clamp(0, 1))


def flow(motion: Tensor) -> Tensor:
    """Hue from the direction, brightness from the root of the length up to 1, so that slow movement shows."""
    hue = torch.atan2(motion[:, 1:2], motion[:, :1]) / (2 * math.pi)
    return _hue(hue) * motion.norm(dim=1, keepdim=True).clamp(0, 1).sqrt()


def ids(numbers: Tensor) -> Tensor:
    """Neighbouring numbers far apart in hue; 0 is dark grey."""
    value = 0.65 + 0.35 * (numbers * GOLDEN * 7 % 1)
    return torch.where(numbers == 0, 0.15, _hue(numbers * GOLDEN % 1) * value)


def signed(value: Tensor) -> Tensor:
    """Blue below zero, red above, black at zero."""
    share = (value / (1 + value.abs())).clamp(-1, 1)
    return torch.cat([share.clamp_min(0), share.abs() * 0.25, (-share).clamp_min(0)], dim=1)


def _hue(turn: Tensor) -> Tensor:
    """Smooth colours round a circle; ``turn`` counts full turns."""
    shift = turn.new_tensor([0.0, 1 / 3, 2 / 3]).to(torch.float32)[None, :, None, None]
    return 0.5 + 0.5 * torch.cos(2 * math.pi * (turn.to(torch.float32) - shift))
