"""Luminance of linear radiance."""

from __future__ import annotations

import torch
from torch import Tensor

REC709 = (0.2126, 0.7152, 0.0722)  # shares of red, green and blue: ITU-R BT.709


def luminance(signal: Tensor, lead: int | None = None) -> Tensor:
    """``(B, 1, ...)`` of ``(B, C, ...)``: of the first ``lead`` channels where they are RGB, else the first one."""
    if (lead or signal.shape[1]) < 3:
        return signal[:, :1]
    red, green, blue = REC709
    return torch.add(red * signal[:, 0:1], signal[:, 1:2], alpha=green).add(signal[:, 2:3], alpha=blue)
