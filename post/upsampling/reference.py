"""The definition of joint bilateral upsampling, in torch."""

from __future__ import annotations

import torch
from torch import Tensor

from post.filters.constants import HIT
from post.filters.edges import Surface, edge_weight
from post.upsampling.constants import DEPTH_SENSITIVITY, ELSEWHERE, ENOUGH, FAR_SHARE, NORMAL_POWER

NEAREST = tuple((dx, dy) for dy in (0, 1) for dx in (0, 1))
AROUND = tuple((dx, dy) for dy in (-1, 0, 1, 2) for dx in (-1, 0, 1, 2))


def upsample_reference(low: Tensor, geometry: Surface, stride: int, offset: tuple[int, int], clear: Tensor) -> Tensor:
    """See `post.upsampling.op.upsample`."""
    guide, (height, width) = geometry.guide, geometry.guide.shape[-2:]
    rows, columns = low.shape[-2:]
    y = torch.arange(height, device=low.device)[:, None].expand(height, width) - offset[0]
    x = torch.arange(width, device=low.device)[None, :].expand(height, width) - offset[1]
    top, left = y // stride, x // stride

    def tap(dx: int, dy: int, reach: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """A sample's share, its edge weight and whether it was hit, ``(B, H, W)``, and its values."""
        row, column = (top + dy).clamp(0, rows - 1), (left + dx).clamp(0, columns - 1)
        across, down = (column * stride - x).to(low.dtype), (row * stride - y).to(low.dtype)
        share = (1 - (left + dx - x / stride).abs() / reach) * (1 - (top + dy - y / stride).abs() / reach)
        there = guide[..., row * stride + offset[0], column * stride + offset[1]]
        same = edge_weight(
            guide, there, geometry.plane, across, down, perspective=geometry.perspective,
            depth_sensitivity=DEPTH_SENSITIVITY / stride, normal_power=NORMAL_POWER,
        )  # fmt: skip
        return share.to(low.dtype), same, there[:, HIT], low[..., row, column]

    total, result = torch.zeros_like(guide[:, :1]), torch.zeros_like(low[:, :, :1, :1])
    for dx, dy in NEAREST:
        share, same, _, value = tap(dx, dy, 1)
        weight = (share * same)[:, None]
        total, result = total + weight, result + weight * value
    lack = (1 - total / ENOUGH).clamp_min(0.0)
    for dx, dy in AROUND:
        share, same, surface, value = tap(dx, dy, 2)
        weight = lack * ((share + FAR_SHARE) * (same + ELSEWHERE * surface + ELSEWHERE * ELSEWHERE))[:, None]
        total, result = total + weight, result + weight * value
    return torch.where(geometry.hit, result / total.clamp_min(1e-30), clear[:, None, None])
