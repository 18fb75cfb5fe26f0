"""Reading pictures at arbitrary positions: the only grid_sample and the only gathers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Literal

import torch
import torch.nn.functional as F
from torch import Tensor


def sample(image: Tensor, px: Tensor, *, mode: Literal["bilinear", "nearest", "bicubic"] = "bilinear") -> Tensor:
    """Read a picture between its pixels; positions outside read the border.

    Args:
        image: ``(B, C, H, W)`` float.
        px: ``(B, 2, h, w)`` pixels, centres at +0.5 (a position that the picture's camera sampled; see
            ``Camera.project(..., jittered=True)``).
        mode: ``bilinear``, ``nearest`` or ``bicubic``.

    Returns:
        ``(B, C, h, w)``; differentiable in ``image`` and, except for ``nearest``, in ``px``.
    """
    height, width = image.shape[-2:]
    grid = torch.stack([px[:, 0] * (2 / width) - 1, px[:, 1] * (2 / height) - 1], dim=-1)
    batch = max(image.shape[0], grid.shape[0])
    image, grid = image.expand(batch, -1, -1, -1), grid.expand(batch, -1, -1, -1)
    return F.grid_sample(image, grid.to(image.dtype), mode=mode, padding_mode="border", align_corners=False)


def sample_volume(volume: Tensor, place: Tensor) -> Tensor:
    """Read a table of three dimensions between its entries.

    Args:
        volume: ``(B, C, D, H, W)`` float.
        place: ``(B, 3, h, w)`` along W, H and D, where 0 is the first entry and 1 the last.

    Returns:
        ``(B, C, h, w)``; differentiable in both.
    """
    grid = (2 * place - 1).permute(0, 2, 3, 1)[:, None]
    return F.grid_sample(volume, grid, mode="bilinear", padding_mode="border", align_corners=True)[:, :, 0]


def gather(image: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """Read whole pixels of any type; positions outside read the border.

    Args:
        image: ``(B, C, H, W)``, any dtype.
        x: ``(B, h, w)`` integer column (0 is the leftmost pixel).
        y: as ``x``, row.

    Returns:
        ``(B, C, h, w)``.
    """
    batch, channels, height, width = image.shape
    index = (y.clamp(0, height - 1) * width + x.clamp(0, width - 1)).long().flatten(1)
    picked = image.flatten(2).gather(2, index[:, None].expand(-1, channels, -1))
    return picked.view(batch, channels, *x.shape[1:])


def shifted(image: Tensor, dx: int, dy: int) -> Tensor:
    """``out[y, x] = image[y + dy, x + dx]``, repeating the border: a tap of a fixed kernel, without a gather."""
    height, width = image.shape[-2:]
    padded = F.pad(image, (max(-dx, 0), max(dx, 0), max(-dy, 0), max(dy, 0)), mode="replicate")
    return padded[..., max(dy, 0) : max(dy, 0) + height, max(dx, 0) : max(dx, 0) + width]


def pixel_centers(image: Tensor) -> Tensor:
    """``(1, 2, H, W)`` px of the middle of every pixel of ``image`` ``(B, C, H, W)``: `sample` there gives it back."""
    y = torch.arange(image.shape[-2], dtype=image.dtype, device=image.device) + 0.5
    x = torch.arange(image.shape[-1], dtype=image.dtype, device=image.device) + 0.5
    rows, columns = torch.meshgrid(y, x, indexing="ij")
    return torch.stack([columns, rows])[None]


def inside(px: Tensor, size: tuple[int, int]) -> Tensor:
    """``(B, 1, h, w)`` bool: whether positions ``(B, 2, h, w)`` in pixels lie in a picture of ``size`` ``(H, W)``."""
    x, y = px[:, 0:1], px[:, 1:2]
    return (x >= 0) & (x < size[1]) & (y >= 0) & (y < size[0])


def sample_table(table: Tensor, places: Sequence[Tensor]) -> Tensor:
    """Read a table of any number of dimensions between its entries; places outside read the border.

    Args:
        table: ``(N1, ..., Nk, C)``, at least two entries along each dimension.
        places: along each of the k dimensions, ``(...)``, where 0 is the first entry and 1 the last.

    Returns:
        ``(..., C)``; differentiable in both.
    """
    ends, shares = [], []
    for place, count in zip(places, table.shape[:-1], strict=True):
        at = place.clamp(0.0, 1.0) * (count - 1)
        first = at.detach().long().clamp_max(count - 2)
        ends.append((first, first + 1))
        shares.append((1 - (at - first), at - first))
    parts = []
    for corner in product((0, 1), repeat=len(places)):
        share = math.prod((s[k] for s, k in zip(shares, corner, strict=True)), start=torch.ones_like(places[0]))
        parts.append(share[..., None] * table[tuple(e[k] for e, k in zip(ends, corner, strict=True))])
    return torch.stack(parts).sum(0)
