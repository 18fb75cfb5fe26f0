"""Points and directions between spaces, and between view space and the picture."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from gbufrt.directions import length


def check_vectors(vectors: Any) -> None:
    """Raise TypeError unless points or directions are a tensor of floats, and ValueError unless ``(B, 3, ...)``."""
    if not isinstance(vectors, Tensor) or not vectors.is_floating_point():
        got = vectors.dtype if isinstance(vectors, Tensor) else type(vectors).__name__
        raise TypeError(f"points and directions must be a tensor of float32 or float64, got {got}")
    if vectors.ndim < 2 or vectors.shape[1] != 3:
        raise ValueError(f"points and directions must be (B,3,...), got {tuple(vectors.shape)}")


def rotate(matrix: Tensor, vectors: Tensor) -> Tensor:
    """Directions ``(B, 3, ...)`` turned by the rotation in ``(B, 3 or 4, 3 or 4)``."""
    check_vectors(vectors)
    rotation = matrix[:, :3, :3].to(vectors.dtype)
    return torch.einsum("bij,bj...->bi...", rotation, vectors)


def transform(matrix: Tensor, points: Tensor) -> Tensor:
    """Points ``(B, 3, ...)`` moved by a rigid ``(B, 4, 4)``."""
    check_vectors(points)
    offset = matrix[:, :3, 3].to(points.dtype).reshape(-1, 3, *(1,) * (points.ndim - 2))
    return rotate(matrix, points) + offset


def inverted(rigid: Tensor) -> Tensor:
    """The inverse of rigid transforms ``(B, 4, 4)``."""
    rotation = rigid[:, :3, :3].transpose(1, 2)
    inverse = torch.zeros_like(rigid)
    inverse[:, :3, :3] = rotation
    inverse[:, :3, 3] = -(rotation @ rigid[:, :3, 3:])[..., 0]
    inverse[:, 3, 3] = 1.0
    return inverse


def sampled_rows(size: tuple[int, int], jitter: Tensor | None, like: Tensor) -> tuple[Tensor, Tensor]:
    """``(1 or B, 1, 1, W)`` and ``(1 or B, 1, H, 1)``: x and y of the pixel centres of a picture of ``size``, moved by
    ``jitter`` ``(B, 2)``."""
    y = torch.arange(size[0], dtype=like.dtype, device=like.device).view(1, 1, -1, 1) + 0.5
    x = torch.arange(size[1], dtype=like.dtype, device=like.device).view(1, 1, 1, -1) + 0.5
    if jitter is None:
        return x, y
    moved = jitter.to(like.dtype)[..., None, None]
    return x + moved[:, 0:1], y + moved[:, 1:2]


def sampled_at(size: tuple[int, int], jitter: Tensor | None, like: Tensor) -> Tensor:
    """``(1 or B, 2, H, W)``: px of the pixel centres of a picture of ``size``, moved by ``jitter`` ``(B, 2)``."""
    return torch.cat(torch.broadcast_tensors(*sampled_rows(size, jitter, like)), dim=1)


def unprojected(depth: Tensor, px: tuple[Tensor, Tensor], intrinsics: Tensor, *, orthographic: bool) -> Tensor:
    """``(B, 3, H, W)``: view-space points at planar ``depth`` ``(B, 1, H, W)`` behind ``px``: x and y, which broadcast
    to it."""
    k = intrinsics.to(depth.dtype)[..., None, None]
    x = (px[0] - k[:, 0, 2, None]) / k[:, 0, 0, None]
    y = (px[1] - k[:, 1, 2, None]) / k[:, 1, 1, None]
    x, y = (x.expand_as(depth), y.expand_as(depth)) if orthographic else (x * depth, y * depth)
    return torch.cat([x, y, depth], dim=1)


def projected(points: Tensor, intrinsics: Tensor, *, orthographic: bool) -> Tensor:
    """``(B, 2, ...)``: px, without jitter, of view-space points ``(B, 3, ...)``."""
    check_vectors(points)
    ones = (1,) * (points.ndim - 2)
    k = intrinsics.to(points.dtype)
    z = 1.0 if orthographic else points[:, 2].clamp_min(1e-9)
    x = points[:, 0] / z * k[:, 0, 0].reshape(-1, *ones) + k[:, 0, 2].reshape(-1, *ones)
    y = points[:, 1] / z * k[:, 1, 1].reshape(-1, *ones) + k[:, 1, 2].reshape(-1, *ones)
    return torch.stack([x, y], dim=1)


def off_picture(motion: Tensor, behind: Tensor, size: tuple[int, int]) -> Tensor:
    """``motion`` ``(B, 2, H, W)``, where ``behind`` ``(B, 1, H, W)`` so long that it ends off a picture of ``size``."""
    away = motion / motion.abs().amax(1, keepdim=True).clamp_min(1e-9)
    return torch.where(behind, 2.0 * max(size) * away, motion)


def unit_to_eye(points: Tensor, *, orthographic: bool) -> Tensor:
    """Unit view-space directions from points ``(B, 3, H, W)`` toward the eye."""
    if orthographic:
        return torch.zeros_like(points) - points.new_tensor([0.0, 0.0, 1.0])[None, :, None, None]
    return -points / length(points).clamp_min(1e-12)


def depth_per_unit(lens: Tensor, size: tuple[int, int]) -> Tensor:
    """``(B, 1, H, W)``: planar depth of a world unit along each ray of a pinhole with ``lens`` ``(B, 6)``."""
    x, y = sampled_rows(size, lens[:, 4:], lens)
    fx, fy, cx, cy = lens[:, :4, None, None].split(1, dim=1)
    across, down = (x - cx) / fx, (y - cy) / fy
    return 1 / (torch.addcmul(across * across, down, down) + 1).sqrt()
