"""What lies around pixels: means, least and largest values over squares, and which neighbours show the same surface."""

from __future__ import annotations

from functools import reduce

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.filters.constants import (
    COARSE_POWER,
    DEPTH,
    HIT,
    KINDRED_AWAY,
    KINDRED_DEPTH,
    LEAST_SHARE,
    NX,
    NZ,
    ROUGHNESS,
    ROUGHNESS_SCALE,
    SAME,
)
from post.filters.edges import Surface, edge_weight, offsets, padded, windows


@operator("gbufrt::pooled")
def pooled_cpu(value: Tensor, mask: Tensor, size: int) -> Tensor:
    """See `pooled`."""
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import pooled_rows

    out = torch.empty_like(value, memory_format=torch.contiguous_format)
    pooled_rows(*map(array, (out, value, mask)), size // 2, threads())
    return out


@pooled_cpu.register_fake
def _(value, mask, size):
    return torch.empty_like(value, memory_format=torch.contiguous_format)


@operator("gbufrt::least_around")
def least_cpu(value: Tensor, size: int) -> Tensor:
    """See `least`."""
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import least_rows

    out = torch.empty_like(value, memory_format=torch.contiguous_format)
    least_rows(*map(array, (out[:, 0], value[:, 0])), size // 2, threads())
    return out


@least_cpu.register_fake
def _(value, size):
    return torch.empty_like(value, memory_format=torch.contiguous_format)


@operator("gbufrt::alike")
def alike_cpu(guide: Tensor, plane: Tensor, perspective: bool) -> Tensor:
    """See `alike`; ``guide`` and ``plane`` are those of `Surface`."""
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import alike_rows

    same = guide.new_empty(guide.shape[0], 9, *guide.shape[2:], dtype=torch.bool)
    alike_rows(*map(array, (same, guide, plane)), perspective, threads())
    return same


@alike_cpu.register_fake
def _(guide, plane, perspective):
    return guide.new_empty(guide.shape[0], 9, *guide.shape[2:], dtype=torch.bool)


@operator("gbufrt::kindred")
def kindred_op(value: Tensor, mask: Tensor, where: Tensor, guide: Tensor, plane: Tensor, radius: int) -> Tensor:
    """See `kindred`; ``guide`` and ``plane`` are those of `Surface`."""
    from post.filters.pixel_drivers import kindred_each

    out = torch.empty_like(value, memory_format=torch.contiguous_format)
    kindred_each(where.numel(), out, value, mask[:, 0], where[:, 0], guide, plane, radius)
    return out


@kindred_op.register_fake
def _(value, mask, where, guide, plane, radius):
    return torch.empty_like(value, memory_format=torch.contiguous_format)


def pooled(value: Tensor, mask: Tensor, size: int = 3, *, compiled: bool | None = None) -> Tensor:
    """Mean over a square of the pixels in ``mask``, 0 where there are none.

    Args:
        value: ``(B, C, H, W)``, any unit.
        mask: ``(B, 1, H, W)`` or as ``value``: how much each pixel counts, at least 0.
        size: odd side of the square, pixels.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        As ``value``.
    """
    if form_of(value, mask, compiled=compiled) is not Form.REFERENCE:
        return pooled_cpu(value, mask, size)
    total = F.avg_pool2d(value * mask, size, stride=1, padding=size // 2)
    return total / F.avg_pool2d(mask, size, stride=1, padding=size // 2).clamp_min(LEAST_SHARE)


def most_beside(value: Tensor) -> Tensor:
    """The largest of each channel among the eight pixels around, as ``value``; beyond the picture there is 0."""
    views = windows(padded(value, 1), 1)
    return reduce(torch.maximum, (*views[:4], *views[5:]))


def least(value: Tensor, size: int, *, compiled: bool | None = None) -> Tensor:
    """Least value ``(B, 1, H, W)`` over a square of odd side ``size``, as far as it lies in the picture."""
    if form_of(value, compiled=compiled) is not Form.REFERENCE:
        return least_cpu(value, size)
    for sides in ((size, 1), (1, size)):
        value = -F.max_pool2d(-value, sides, stride=1, padding=(sides[0] // 2, sides[1] // 2))
    return value


def alike(geometry: Surface, *, compiled: bool | None = None) -> Tensor:
    """``(B, 9, H, W)`` bool: which of the 3x3 pixels around show the same surface, or the sky if the centre does."""
    if form_of(geometry.guide, geometry.plane, compiled=compiled) is not Form.REFERENCE:
        return alike_cpu(geometry.guide, geometry.plane, geometry.perspective)
    guides = windows(padded(geometry.guide, 1), 1)
    away = windows(padded(1 - geometry.guide[:, HIT : HIT + 1], 1), 1)
    same = []
    for (dy, dx), guide, sky in zip(offsets(1), guides, away, strict=True):
        weight = edge_weight(
            geometry.guide, guide, geometry.plane, dx, dy,
            perspective=geometry.perspective, depth_sensitivity=1.0, normal_power=COARSE_POWER,
        )  # fmt: skip
        same.append((weight > SAME) | ((sky * away[len(away) // 2])[:, 0] > 0))
    return torch.stack(same, dim=1)


def kindred(
    value: Tensor, mask: Tensor, where: Tensor, geometry: Surface, radius: int, *, compiled: bool | None = None
) -> Tensor:
    """Mean over every other pixel of a square, of any surface, those most that face the same way and lie as deep.

    A tap counts by the sixth power of the mean of one and the cosine between the normals, by its depth beside that of
    the pixel, in pixel footprints, and by its roughness where the geometry tells it. Those that face away do not count.
    Taps are those of the pixel's colour on a chessboard: half the time for a square as wide.

    Args:
        value: ``(B, C, H, W)``, any unit.
        mask: ``(B, 1, H, W)``: how much each pixel counts, at least 0.
        where: ``(B, 1, H, W)`` bool: pixels whose mean is wanted, and which alone take time; that of others is 0.
        geometry: of the same size.
        radius: of the square, pixels.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        As ``value``.
    """
    given = value, mask, geometry.guide, geometry.plane
    if form_of(*given, compiled=compiled, cuda=True) is not Form.REFERENCE:
        return kindred_op(value, mask, where, geometry.guide, geometry.plane, radius)
    here, footprints = geometry.guide, geometry.plane[:, 3:] * KINDRED_DEPTH
    guides, values = (windows(padded(t, radius), radius) for t in (here, torch.cat([value, mask], dim=1)))
    total, sums = torch.zeros_like(mask), torch.zeros_like(value)
    for (dy, dx), guide, tap in zip(offsets(radius), guides, values, strict=True):
        if (dy + dx) % 2:
            continue
        cosine = (guide[:, NX : NZ + 1] * here[:, NX : NZ + 1]).sum(1, keepdim=True)
        unlike = (guide[:, DEPTH : DEPTH + 1] - here[:, DEPTH : DEPTH + 1]).abs() * footprints
        if here.shape[1] > ROUGHNESS:
            unlike = unlike + (guide[:, ROUGHNESS:] - here[:, ROUGHNESS:]).abs() / ROUGHNESS_SCALE
        facing = torch.where(cosine > KINDRED_AWAY, (0.5 + 0.5 * cosine) ** 6, 0.0)
        weight = tap[:, -1:] * facing * torch.exp(-unlike)
        total, sums = total + weight, sums + weight * tap[:, :-1]
    return torch.where(where, sums / total.clamp_min(LEAST_SHARE), 0.0)
