"""The definition of `post.march.rays.depth_hierarchy` in torch; `post.march.hierarchy_kernel` is its compiled form."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera
from post.march.constants import GRAZING, NEAREST, NOTHING, STEEPEST, TINY

TOP_LEVEL = 7  # cells of 128 pixels


def levels_of(height: int, width: int) -> list[tuple[int, int, int]]:
    """Of each level of a pyramid, from 1 up: the place of its first cell, and how many rows and columns it has."""
    levels, start = [], 0
    while len(levels) < TOP_LEVEL and (not levels or height > 1 or width > 1):
        height, width = (height + 1) // 2, (width + 1) // 2
        levels.append((start, height, width))
        start += height * width
    return levels


def hierarchy_reference(
    depth: Tensor, normal: Tensor, hit: Tensor, thickness: Tensor | float, camera: Camera
) -> tuple[Tensor, Tensor]:
    """``planes`` and ``pyramid`` of `post.march.rays.Hierarchy`; arguments as there."""
    ray = camera.unproject(torch.ones_like(depth))
    facing = camera.rotate_to_view(normal)
    focal = camera.lens[:, :2, None, None].to(depth.dtype)
    if camera.orthographic:
        slope = facing[:, :2] / (focal * facing[:, 2:].clamp_max(-STEEPEST))
        q, pixel = -depth, 1 / focal[:, 1:]
        back = q - thickness
    else:
        length = (ray * ray).sum(1, keepdim=True).sqrt()
        q = 1 / depth.clamp_min(NEAREST)
        pixel = q / focal[:, 1:]
        slope = facing[:, :2] * (q / (focal * torch.minimum((facing * ray).sum(1, keepdim=True), -GRAZING * length)))
        slope = slope * (q / slope.abs().sum(1, keepdim=True).clamp_min(TINY)).clamp_max(1.0)  # none reaches behind us
        back = 1 / (depth + (thickness / length if isinstance(thickness, Tensor) else thickness)).clamp_min(NEAREST)
    del ray, facing  # six planes less, of what reflections need at once
    reach = slope.abs().sum(1, keepdim=True)
    back = torch.minimum(back, q - reach - pixel)  # no solid is thinner than the gap that `crack` tolerates
    front = torch.where(hit, q, -NOTHING)
    back = torch.where(hit, back, NOTHING)
    planes = torch.cat([front, torch.where(hit, slope, 0.0), back], dim=1).float()
    nearest = torch.where(hit, q + 0.5 * reach, -NOTHING).float()
    return planes.permute(0, 2, 3, 1).contiguous(), _pyramid(nearest, back.float())


def _pyramid(front: Tensor, back: Tensor) -> Tensor:
    cells = []
    for _ in levels_of(*front.shape[-2:]):
        front = F.max_pool2d(front, 2, ceil_mode=True)
        back = -F.max_pool2d(-back, 2, ceil_mode=True)
        cells.append(torch.cat([front, back], dim=1).flatten(2))
    return torch.cat(cells, dim=2).transpose(1, 2).contiguous()
