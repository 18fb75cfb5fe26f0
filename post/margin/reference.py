"""The margin past the picture's border: the planes at the border, continued."""

from __future__ import annotations

from dataclasses import replace

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.camera import Camera
from post.margin.constants import LEAST_FACING

SHARE = 0.25  # of the picture's longer side; more makes no difference to occlusion within a few metres
LEAST = 1  # pixels: taps that end at the border lie at most half a pixel and `sweep.constants.FIRST` past it


def width(camera: Camera) -> int:
    """Pixels of margin on each side of the picture."""
    return max(1, round(max(camera.size) * SHARE))


def continued(camera: Camera, depth: Tensor, hit: Tensor, normal: Tensor, m: int) -> tuple[Tensor, Tensor]:
    """Depth in the margin: each pixel shows the plane of the border pixel nearest to it, where that plane faces it.

    Walls, floors and ceilings cut by the border mostly continue past it. An empty margin would make pixels near the
    border, and whole interiors, too open.

    Args:
        camera: of the picture.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        hit: ``(B, 1, H, W)`` bool.
        normal: ``(B, 3, H, W)`` world space.
        m: the margin's width, pixels.

    Returns:
        depth and hit ``(B, 1, H + 2 m, W + 2 m)``; depth is 0 where empty.
    """
    inner = (..., slice(m, m + camera.height), slice(m, m + camera.width))
    normal = camera.rotate_to_view(normal)
    level = spread((normal * camera.unproject(depth)).sum(1, keepdim=True), m)
    plane = spread(normal, m)
    k = camera.intrinsics.clone()
    k[:, :2, 2] += m
    wide = replace(camera, intrinsics=k, size=(camera.height + 2 * m, camera.width + 2 * m))
    ray = wide.unproject(torch.ones_like(level))
    if camera.orthographic:  # rays of a perspective camera start at the origin
        start = wide.unproject(torch.zeros_like(level))
        ray, level = ray - start, level - (plane * start).sum(1, keepdim=True)
    facing = -(plane * ray).sum(1, keepdim=True)
    far = -level / facing.clamp_min(LEAST_FACING)
    stands = spread(hit.to(depth.dtype), m) * (facing > LEAST_FACING) * (far > camera.near) > 0
    stands[inner] = hit
    outer = torch.ones_like(stands)
    outer[inner] = False
    continued = torch.where(outer, far, empty(depth, m))
    return torch.where(stands, continued, 0.0), stands


def empty(picture: Tensor, margin: int) -> Tensor:
    """A ``(B, C, H, W)`` picture with nothing beyond its border."""
    return F.pad(picture, (margin, margin, margin, margin))


def spread(picture: Tensor, margin: int) -> Tensor:
    """A ``(B, C, H, W)`` picture with its border pixels repeated ``margin`` times."""
    return F.pad(picture, (margin, margin, margin, margin), mode="replicate")


def padded(
    camera: Camera, depth: Tensor, normal: Tensor, hit: Tensor, reach: Tensor, light: Tensor | None, m: int
) -> Tensor:
    """``(B, 2 or 8, H', W')``: the picture of `post.margin.op.scene`."""
    front, stands = continued(camera, depth, hit, normal, m)
    planes = [front, torch.where(stands, spread(reach, m), 0.0)]
    if light is not None:
        planes += [empty(light * hit, m), spread(camera.rotate_to_view(normal), m)]
    return F.pad(torch.cat(planes, dim=1), (1, 1, 1, 1))
