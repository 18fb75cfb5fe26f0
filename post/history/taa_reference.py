"""Temporal anti-aliasing in torch: the definition of `post.history.op.anti_alias`, with its gradients."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.luminance import luminance
from gbufrt.sampling import inside, pixel_centers, sample
from post.filters.edges import offsets, padded, windows
from post.history.catmull_rom import catmull_rom
from post.history.constants import BODY, BRIGHTEST, GRAZING, IN_FRONT, SHARP, WINDOW


def anti_alias_reference(
    color: Tensor,
    jitter: Tensor | None,
    depth: Tensor,
    normal: Tensor,
    rays: Tensor,
    motion: Tensor,
    before: Tensor | None,
    age: Tensor,
    parallel: bool,
    blend: float,
    gamma: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Arguments and results are those of `post.history.op.anti_alias`."""
    toned = color / (1 + luminance(color).clamp_min(0.0))
    current = _resampled(toned, jitter)
    length = torch.ones_like(age)
    if before is not None:
        px = pixel_centers(color) + dilated(motion, depth, normal, rays, parallel)
        visible = inside(px, (color.shape[-2], color.shape[-1])) & (sample(age, px, mode="nearest") > 0)
        age = torch.where(visible, torch.minimum(sample(age, px, mode="nearest"), sharp_for(px) - 1), 0.0)
        old = _clipped(catmull_rom(before, px), toned, current, gamma)
        length = (age + 1).clamp_max(longest(blend))
        current = torch.where(visible, old + (current - old) / length, current)
    return current / (1 - luminance(current).clamp(0.0, BRIGHTEST)), current, length


def longest(blend: float) -> float:
    """Frames that a history may hold, from its largest share."""
    return 1 / max(1 - blend, 1e-9)


def sharp_for(px: Tensor) -> Tensor:
    """``(B, 1, H, W)`` frames after which a history read at such places each time is no longer worth its blur.

    Every read between pixels softens, with Catmull-Rom weights too, most of all halfway.
    """
    along = (px - 0.5) % 1.0
    return SHARP / (4 * along * (1 - along)).sum(dim=1, keepdim=True).clamp_min(1e-6)


def _resampled(image: Tensor, jitter: Tensor | None) -> Tensor:
    """The picture at pixel centres, from samples that lie beside them."""
    if jitter is None:
        return image
    place = jitter.to(image.dtype)[:, :, None, None]
    ones = windows(padded(torch.ones_like(image[:, :1]), 1), 1)
    total, result = torch.zeros_like(image[:, :1]), torch.zeros_like(image)
    for (dy, dx), tap, there in zip(offsets(1), windows(padded(image, 1), 1), ones, strict=True):
        away = (place[:, 0:1] + dx) ** 2 + (place[:, 1:2] + dy) ** 2
        weight = torch.exp(WINDOW * away) * there
        total, result = total + weight, result + weight * tap
    return result / total


def dilated(motion: Tensor, depth: Tensor, normal: Tensor, rays: Tensor, parallel: bool) -> Tensor:
    """Motion of the body that is in front in 3x3, at its edge: the edge moves with that.

    A pixel's own surface may be nearer beside it, up to where its plane is, but moves otherwise there. Of the nearest
    body in front the farthest pixel is the one at the edge, as bodies curve.
    """
    height, width = depth.shape[-2:]
    across, down, along = torch.einsum("bchw,bck->bkhw", normal.to(depth), rays.to(depth)).split(1, dim=1)
    if not parallel:
        column, row = (pixel_centers(depth) - 0.5).split(1, dim=1)
        along = along + column * across + row * down
    facing, slope = along.abs() + GRAZING, across.abs() + down.abs()
    lean = torch.where(slope >= 0, slope / facing, 0.0)  # not a number counts as none
    limit = IN_FRONT * (depth - lean if parallel else depth / (1 + lean))
    around = F.pad(depth, (1, 1, 1, 1), value=float("inf"))
    moved = F.pad(motion, (1, 1, 1, 1))
    views = [(slice(1 + dy, 1 + dy + height), slice(1 + dx, 1 + dx + width)) for dy, dx in offsets(1)]
    nearest = torch.full_like(depth, torch.inf)
    for y, x in views:
        nearest = torch.where(around[..., y, x] < nearest, around[..., y, x], nearest)
    limit = torch.where(BODY * nearest < limit, BODY * nearest, limit)
    farthest, result = torch.full_like(depth, -torch.inf), motion
    for y, x in views:
        better = (around[..., y, x] < limit) & (around[..., y, x] > farthest)
        farthest = torch.where(better, around[..., y, x], farthest)
        result = torch.where(better, moved[..., y, x], result)
    return result


def _clipped(old: Tensor, toned: Tensor, current: Tensor, gamma: float) -> Tensor:
    """Move the history toward the mean of the neighbourhood until it lies in its box in YCoCg, and is light."""
    around = ycocg(F.pad(toned, (1, 1, 1, 1), mode="replicate"))
    mean = F.avg_pool2d(around, 3, stride=1)
    spread = (F.avg_pool2d(around * around, 3, stride=1) - mean * mean).clamp_min(0.0).add(1e-12).sqrt()
    extent = torch.maximum(gamma * spread, (ycocg(current) - mean).abs())
    away = ycocg(old) - mean
    outside = (away.abs() / extent.clamp_min(1e-6)).amax(dim=1, keepdim=True).clamp_min(1.0)
    return rgb(mean + away / outside).clamp_min(0.0)  # the box holds colours that no light has


def ycocg(rgb: Tensor) -> Tensor:
    r, g, b = rgb[:, 0:1], rgb[:, 1:2], rgb[:, 2:3]
    return torch.cat([0.25 * r + 0.5 * g + 0.25 * b, 0.5 * (r - b), 0.5 * g - 0.25 * (r + b)], dim=1)


def rgb(ycocg: Tensor) -> Tensor:
    y, co, cg = ycocg[:, 0:1], ycocg[:, 1:2], ycocg[:, 2:3]
    return torch.cat([y + co - cg, y + cg, y - co - cg], dim=1)
