"""Layers of like blur and an open shutter as torch operators: kernels on the CPU and CUDA, else torch references."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.compute.resident import resident
from post.lens.constants import EDGE, FINEST, MOST_CHANNELS, MOST_LAYERS
from post.lens.reference import bright_level, layers_reference, signed
from post.lens.shutter_reference import farthest, reconstruct_reference, similar_reference


class Tables(NamedTuple):
    """What the kernel knows of L layers, whose discs reach at most R pixels."""

    reach: np.ndarray
    """``(L,)``: how many pixels from its middle each disc reaches."""
    weights: np.ndarray
    """``(L, R + 1, R + 1)``: a quarter of each disc by row and column, 1 in its middle."""
    inner: np.ndarray
    """``(L, R + 1)``: the first column of each row whose weight is less than 1."""
    outer: np.ndarray
    """``(L, R + 1)``: the first column of each row whose weight is 0."""
    ramps: np.ndarray
    """``(L, 2, 5)``: see `post.lens.spread_kernel.Ramp`; for a layer, and for what lies clearly behind it."""


@operator("gbufrt::spread_layers")
def layers_cpu(color: Tensor, coc: Tensor, radii: list[float]) -> Tensor:
    """``(B, C, H, W)``. See `spread_layers`."""
    from gbufrt.compute.kernel import array, threads
    from post.lens.drivers import layer_each, layer_tiles

    out = torch.empty_like(color, memory_format=torch.contiguous_format)
    pictures, known = (out, color, coc[:, 0], bright_level(color).flatten()), tables(tuple(radii))
    if form_of(color, cuda=fits_cuda(color, radii)) is Form.CUDA:
        layer_each(coc.numel(), *pictures, *touched(coc, radii))
    else:
        layer_tiles(*map(array, pictures), *known, threads())
    return out


@layers_cpu.register_fake
def _(color, coc, radii):
    return torch.empty_like(color, memory_format=torch.contiguous_format)


def spread_layers(color: Tensor, coc: Tensor, radii: list[float], *, compiled: bool | None = None) -> Tensor:
    """Cut a picture into layers of like blur, spread each by its own disc, and lay them over one another.

    Args:
        color: ``(B, C, H, W)`` linear, finite.
        coc: ``(B, 1, H, W)`` signed radius of each pixel's disc, pixels; negative in front of the focal plane.
        radii: of the layers behind the focal plane, pixels, from 0 up, at least to the largest of ``coc``.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, C, H, W)``.
    """
    if form_of(color, coc, compiled=compiled, cuda=fits_cuda(color, radii)) is Form.REFERENCE:
        return layers_reference(color, coc, radii)
    return layers_cpu(color, coc, radii)


@operator("gbufrt::reconstruct_blur")
def reconstruct_cpu(
    color: Tensor, depth: Tensor, path: Tensor, dominant: Tensor, noise: Tensor, opening: float, samples: int,
    softness: float,
) -> Tensor:  # fmt: skip
    """``(B, C, H, W)``. See `reconstruct`."""
    from gbufrt.compute.kernel import array, threads
    from post.lens.drivers import reconstruct_each, reconstruct_rows
    from post.lens.shutter_kernel import TOGETHER

    out = torch.empty_like(color, memory_format=torch.contiguous_format)
    picture = side_by_side(prefiltered_by_kernel(color, path, opening), TOGETHER)
    planes = (color, depth[:, 0], path, dominant, picture, torch.cat([depth, path], 1).flatten(2), noise)
    if form_of(color, cuda=color.shape[1] <= MOST_CHANNELS) is Form.CUDA:
        reconstruct_each(depth.numel(), out, *planes, opening, samples, softness)
    else:
        reconstruct_rows(array(out), *map(array, planes), opening, samples, softness, threads())
    return out


def prefiltered_by_kernel(color: Tensor, path: Tensor, opening: float) -> Tensor:
    """See `post.lens.shutter_reference.prefiltered`."""
    from gbufrt.compute.kernel import array, threads
    from post.lens.prefilter_kernel import prefilter_each, prefilter_rows

    out, reach = torch.empty_like(color, memory_format=torch.contiguous_format), farthest(opening)
    if form_of(color, cuda=True) is Form.CUDA:
        prefilter_each(out[:, 0].numel(), out, color, path, reach)
    else:
        prefilter_rows(*map(array, (out, color, path)), reach, threads())
    return out


def side_by_side(color: Tensor, together: int) -> Tensor:
    """``(B, G, N)``: the channels of each pixel, in groups of ``together``; the last group is filled up with zeros.

    A kernel also reads a row and a pixel after the last, but with no weight: they are zeros.
    """
    batch, channels, _, width = color.shape
    groups = -(-channels // together)
    filled = F.pad(color.flatten(2), (0, width + 1, 0, groups * together - channels))
    return filled.view(batch, groups, together, -1).mT.reshape(batch, groups, -1)


@reconstruct_cpu.register_fake
def _(color, depth, path, dominant, noise, opening, samples, softness):
    return torch.empty_like(color, memory_format=torch.contiguous_format)


def reconstruct(
    color: Tensor,
    depth: Tensor,
    path: Tensor,
    dominant: Tensor,
    noise: Tensor,
    *,
    opening: float,
    samples: int,
    softness: float | Tensor,
    compiled: bool | None = None,
) -> Tensor:
    """What an open shutter records, from one picture and its motion; see `post.motion_blur`.

    Args:
        color: ``(B, C, H, W)`` linear, finite.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        path: ``(B, 2, H, W)`` the way of each pixel's surface while the shutter is open, backward in time, pixels.
        dominant: as ``path``: of the fastest surface nearby; what it leads to may have another path, which is then
            followed. Where it is shorter than half a pixel, the picture stays.
        noise: ``(H, W)`` in [0, 1): where in its share of the exposure each moment lies.
        opening: when the shutter opens, as a share of its time before the frame: -0.5 or 0.
        samples: moments of the exposure.
        softness: see `post.motion_blur`.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, C, H, W)``.
    """
    planes, fits = (color, depth, path, dominant, noise), color.shape[1] <= MOST_CHANNELS
    if form_of(*planes, softness, compiled=compiled, cuda=fits) is Form.REFERENCE:
        return reconstruct_reference(*planes, opening, samples, softness)
    return reconstruct_cpu(*planes, opening, samples, float(softness))


@operator("gbufrt::blur_alike")
def similar_cpu(color: Tensor, path: Tensor, noise: Tensor, opening: float, samples: int) -> Tensor:
    """``(B, C, H, W)``. See `blur_alike`."""
    from post.lens.drivers import similar_each

    out = torch.empty_like(color, memory_format=torch.contiguous_format)
    similar_each(
        out[:, 0].numel(), out, color, prefiltered_by_kernel(color, path, opening), path, noise, opening, samples
    )
    return out


@similar_cpu.register_fake
def _(color, path, noise, opening, samples):
    return torch.empty_like(color, memory_format=torch.contiguous_format)


def blur_alike(
    color: Tensor, path: Tensor, noise: Tensor, *, opening: float, samples: int, compiled: bool | None = None
) -> Tensor:
    """Blur along each pixel's own path over what moves alike: the ``similarity`` weights of `post.motion_blur`.

    Arguments and result are those of `reconstruct`.
    """
    if form_of(color, path, noise, compiled=compiled, cuda=True) is Form.REFERENCE:
        return similar_reference(color, path, noise, opening, samples)
    return similar_cpu(color, path, noise, opening, samples)


def layer_radii(largest: float, step: float) -> list[float]:
    """Radii from 0 to the largest, pixels; the steps start at a quarter of a pixel and grow by the share ``step``."""
    radii = [0.0]
    while radii[-1] < largest:
        radii.append(radii[-1] * (1 + step) + FINEST)
    return radii


def fits_cuda(color: Tensor, radii: list[float]) -> bool:
    """Whether a thread of a GPU has room for so many layers of so many channels."""
    return 2 * len(radii) - 1 <= MOST_LAYERS and color.shape[1] <= MOST_CHANNELS


def touched(coc: Tensor, radii: list[float]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """What `post.lens.gather_kernel` asks of a picture, without a number that the host would wait for.

    Returns:
        ``(B, H, W)`` int32 each: the nearer layer in which a pixel has a share, and how far away the farthest disc
        begins that may reach it; radii ``(L,)`` and `Tables.ramps`.
    """
    known = tables(tuple(radii))
    at, last = resident(tuple(signed(radii)), coc), len(known.reach) - 1
    first = (torch.bucketize(coc[:, 0].contiguous(), at, right=True) - 1).clamp(0, last)
    reach = resident(tuple(known.reach.tolist()), coc)
    own = torch.maximum(reach[first], reach[(first + 1).clamp_max(last)])
    margin = int(known.reach.max())
    down = F.max_pool2d(own, (2 * margin + 1, 1), stride=1, padding=(margin, 0))
    farthest = F.max_pool2d(down, (1, 2 * margin + 1), stride=1, padding=(0, margin))
    return first.int(), farthest.int(), at.abs(), resident(_ramps(tuple(radii)), coc)


@cache
def _ramps(radii: tuple[float, ...]) -> tuple[tuple[tuple[float, ...], ...], ...]:
    return tuple(tuple(tuple(row) for row in pair) for pair in tables(radii).ramps.tolist())


@cache
def tables(radii: tuple[float, ...]) -> Tables:
    """See `Tables`; ``radii`` as in `spread_layers`, but for `cache` a tuple."""
    at = np.array(signed(list(radii)))
    reach = np.floor(np.abs(at) + EDGE).astype(np.int64)
    away = np.arange(reach.max() + 1)
    weights = (np.abs(at)[:, None, None] + EDGE - np.hypot(away[:, None], away)).clip(0, 1)
    weights[at == 0] = away[:, None] + away == 0
    square, quarters = at * np.abs(at), np.where(away > 0, 2, 1)
    scale = 1 / (weights * quarters[:, None] * quarters).sum((1, 2))
    ramps = np.empty((len(at), 2, 5))
    edges = np.concatenate([[-np.inf], square, [np.inf, np.inf]])  # infinitely far from one, any slope gives all
    slope = np.concatenate([[1.0], 1 / np.diff(square), [1.0, 1.0]])
    for i in range(len(at)):
        ramps[i, 0] = edges[i], slope[i], edges[i + 2], slope[i + 1], scale[i]
        ramps[i, 1] = edges[i + 2], slope[i + 2], np.inf, 1.0, scale[i]
    inner, outer = (weights == 1).sum(2), (weights > 0).sum(2)
    return Tables(reach, weights.astype(np.float32), inner, outer, ramps.astype(np.float32))
