"""Where the pixels of an upscaled picture were, from the surfaces of a smaller G-buffer."""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.sampling import gather, pixel_centers
from post.history.reproject import motion_of
from post.upsampling.constants import EDGE_ON, IN_FRONT, STRETCH, TOLERANCE
from post.upsampling.samples import Samples


class Movement(NamedTuple):
    """Where each pixel of the large picture was."""

    px: Tensor
    """``(B, 2, H, W)`` pixels of the large picture."""
    seen: Tensor
    """``(B, 1, H, W)`` bool: whether the frame before showed what the pixel shows."""
    depth: Tensor
    """``(B, 1, H, W)`` planar view z now, world units."""
    depth_before: Tensor
    """``(B, 1, H, W)`` in the frame before, as it must have been."""
    hidden: Tensor
    """``(B, 1, H, W)`` in [0, 1]: share of the samples around it, in the frame before, that lay nearer."""


@torch.no_grad()
def moving_surfaces(g: GBuffer, before: Camera) -> Tensor:
    """``(B, 9, h, w)``: depth, hit, plane (normal in view space, offset), and motion besides that of a still world.

    Args:
        g: of this frame, small.
        before: camera of the frame before.
    """
    motion, motion_z = motion_of(g, before)
    still, still_z = g.camera.static_motion(before, g.depth, g.hit)
    facing = g.camera.rotate_to_view(g.normal.to(g.depth))
    offset = (facing * g.points_view()).sum(1, keepdim=True)
    depth = torch.where(g.hit, g.depth, g.camera.far * 2)
    return torch.cat([depth, g.hit.to(depth), facing, offset, motion - still, motion_z - still_z], dim=1)


@torch.no_grad()
def depths_before(previous: GBuffer) -> Tensor:
    """``(B, 2, h, w)`` greatest depth in 3x3 of a frame, and the pixel's own, world units."""
    depth = torch.where(previous.hit, previous.depth, previous.camera.far * 2)
    return torch.cat([F.max_pool2d(F.pad(depth, (1, 1, 1, 1), mode="replicate"), 3, stride=1), depth], dim=1)


@torch.no_grad()
def upscaled_motion(
    surfaces: Tensor, depths: Tensor, camera: Camera, before: Camera, at: Samples, size: tuple[int, int]
) -> Movement:
    """Where each pixel of the large picture was, and whether the frame before showed what it shows.

    A pixel takes the nearest surface of the four samples that surround it, as edges move with what is in front. That
    surface's plane is carried on to the pixel: with the motion of the sample itself, floors would drift.

    Args:
        surfaces: of `moving_surfaces`, this frame.
        depths: of `depths_before`, the frame before.
        camera: of this frame, small.
        before: of the frame before, small.
        at: the samples about each pixel.
        size: ``(H, W)`` of the large picture.

    Returns:
        See `Movement`; without gradients.
    """
    x, y = _in_front(surfaces[:, :1], at)
    near, hit, facing, offset, own_motion, own_z = gather(surfaces, x, y).split((1, 1, 3, 1, 2, 1), dim=1)
    large = camera.resized(size)
    depth = _on_plane(large, near, facing, offset)
    moved, moved_z = large.static_motion(before.resized(size), depth, hit > 0)
    scale = moved.new_tensor(at.ratio)[None, :, None, None]
    there = pixel_centers(moved) + moved + own_motion * scale
    jitter = 0.0 if before.jitter is None else before.jitter.to(there)[:, :, None, None]
    then = depth + moved_z + own_z
    px = there / scale - jitter
    column, row = torch.floor(px).long().unbind(dim=1)
    seen = then <= gather(depths[:, :1], column, row) * (1 + TOLERANCE)
    return Movement(there, seen, depth, then, _hidden(depths[:, 1:], px - 0.5, then))


def _hidden(depth: Tensor, place: Tensor, then: Tensor) -> Tensor:
    """Bilinear share of four samples of ``depth`` about ``place``, column and row, that lie nearer than ``then``."""
    x, y = torch.floor(place).long().unbind(dim=1)
    u, v = (place - torch.floor(place)).split(1, dim=1)
    result = torch.zeros_like(then)
    for dx, dy, share in ((0, 0, (1 - u) * (1 - v)), (1, 0, u * (1 - v)), (0, 1, (1 - u) * v), (1, 1, u * v)):
        result = result + share * (then > gather(depth, x + dx, y + dy) * (1 + TOLERANCE))
    return result


def _in_front(depth: Tensor, at: Samples) -> tuple[Tensor, Tensor]:
    """Column and row ``(B, H, W)`` of the nearest surface among the four samples that surround each pixel."""
    height, width = depth.shape[-2:]
    across = (at.x - at.away[:, 0].sign().long()).clamp(0, width - 1)
    down = (at.y - at.away[:, 1].sign().long()).clamp(0, height - 1)
    nearest, column, row = gather(depth, at.x, at.y), at.x, at.y
    for x, y in ((across, at.y), (at.x, down), (across, down)):
        there = gather(depth, x, y)
        closer = there < nearest * (1 - IN_FRONT)
        nearest = torch.where(closer, there, nearest)
        column, row = torch.where(closer[:, 0], x, column), torch.where(closer[:, 0], y, row)
    return column, row


def _on_plane(camera: Camera, near: Tensor, facing: Tensor, offset: Tensor) -> Tensor:
    """Depth at which each pixel's ray meets the plane of its surface, as far as that is near the sample's."""
    start = camera.unproject(torch.zeros_like(near))
    along = (facing * (camera.unproject(torch.ones_like(near)) - start)).sum(1, keepdim=True)
    met = (offset - (facing * start).sum(1, keepdim=True)) / torch.where(along.abs() > EDGE_ON, along, torch.inf)
    found = (along.abs() > EDGE_ON) & (met > near / STRETCH) & (met < near * STRETCH)
    return torch.where(found, met, near)
