"""Joint bilateral upsampling: signals from every second pixel, interpolated to all pixels along surfaces."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.sampling import gather

NORMAL_POWER = 8
PLANE_SIGMA = 2.0  # pixel footprints off the plane
LEAST = 1e-4  # weight that even another surface keeps, so that isolated pixels take a value from near by


def upsample(
    low: Tensor,
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    *,
    hit: Tensor,
    stride: int = 2,
    offset: tuple[int, int] = (0, 0),
) -> Tensor:
    """Upsample ``low`` to every pixel by bilinear weights of those of its four neighbours that lie on its surface.

    Args:
        low: ``(B, C, h, w)``: the signal at rows and columns ``offset``, ``offset + stride``...
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space.
        camera: of the picture.
        hit: ``(B, 1, H, W)`` bool; surfaces and sky do not mix.
        stride: pixels between the signal's samples.
        offset: first row and column of the signal.

    Returns:
        ``(B, C, H, W)``.

    Source: Kopf et al. 2007, "Joint Bilateral Upsampling"; weights by plane distance and normal as in SVGF.
    """
    points = camera.unproject(depth)
    facing = camera.rotate_to_view(normal)
    guide = torch.cat([points, facing, hit.to(depth.dtype)], dim=1)
    coarse = guide[..., offset[0] :: stride, offset[1] :: stride]
    footprint = 1.0 / (camera.pixels_per_unit(depth) * PLANE_SIGMA * stride)
    column = torch.arange(camera.width, device=depth.device, dtype=depth.dtype)[None, None, :] - offset[1]
    row = torch.arange(camera.height, device=depth.device, dtype=depth.dtype)[None, :, None] - offset[0]
    x, y = (column / stride).expand_as(depth[:, 0]), (row / stride).expand_as(depth[:, 0])
    left, top = x.floor(), y.floor()
    total, result = torch.zeros_like(depth), torch.zeros_like(depth)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        share = (1 - (x - left - dx).abs()) * (1 - (y - top - dy).abs())
        at = (left.long() + dx, top.long() + dy)
        visible = gather(coarse, *at)
        away = ((visible[:, :3] - points) * facing).sum(1, keepdim=True) * footprint
        alike = (visible[:, 3:6] * facing).sum(1, keepdim=True).clamp_min(0) ** NORMAL_POWER
        same = torch.where(hit, (-away * away).exp() * alike, 1.0) * (visible[:, 6:] == hit)
        weight = (share[:, None] + 1e-3) * (same + LEAST * (visible[:, 6:] == hit) + LEAST**2)
        result = result + weight * gather(low, *at)
        total = total + weight
    return result / total
