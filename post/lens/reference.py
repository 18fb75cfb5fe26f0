"""Layers of like blur in torch: the definition of `post.lens.op.spread_layers`, with its gradients."""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.resident import waits
from post.lens.constants import BRIGHT, CONFIDENT, EDGE, TINY


def layers_reference(color: Tensor, coc: Tensor, radii: list[float]) -> Tensor:
    """``(B, C, H, W)``. Arguments and result are those of `post.lens.op.spread_layers`."""
    height, width = color.shape[-2:]
    sides = border(coc, radii)
    left, _, top, _ = sides
    source = F.pad(torch.cat([color, torch.ones_like(coc)], dim=1), sides, mode="replicate")
    coc = F.pad(coc, sides, mode="replicate")
    calm = 1 / (1 + source[:, :-1].detach().mean(dim=1, keepdim=True) / bright_level(color.detach()))
    result, free = torch.zeros_like(color), torch.ones_like(color[:, :1])
    fill = torch.zeros_like(source[..., :height, :width])

    def spread(share: Tensor, radius: float) -> Tensor:
        picture = source * share
        if radius:
            disc = _disc_spectrum(abs(radius), source)
            picture = torch.fft.irfft2(torch.fft.rfft2(picture) * disc, s=tuple(source.shape[-2:]))
        return picture[..., top : top + height, left : left + width]

    for radius, share, behind in _layers(coc, radii):
        layer = spread(share, radius)
        coverage = layer[:, -1:].clamp_min(0)
        taken = torch.minimum(coverage, free)
        result = result + layer[:, :-1] * (taken / coverage.clamp_min(TINY))
        free = free - taken
        if behind is not None:
            fill = fill + taken * spread(behind * calm, radius)
    known = fill[:, -1:].clamp_min(0)
    trusted = free * known / (known + CONFIDENT)
    result = result + trusted * fill[:, :-1] / known.clamp_min(TINY)
    return result / (1 - free + trusted).clamp_min(TINY)


def border(coc: Tensor, radii: list[float]) -> tuple[int, int, int, int]:
    """Pixels to add at the left, right, top and bottom, so that no disc reaches around the picture's end.

    The padded picture has a size that suits Fourier transforms.
    """
    height, width = coc.shape[-2:]
    largest = radii[-1] if waits(coc) else float(coc.detach().abs().max())
    margin = 2 * (math.ceil(largest) + 1)
    rows, columns = _fast_size(height + 2 * margin), _fast_size(width + 2 * margin)
    return margin, columns - width - margin, margin, rows - height - margin


def signed(radii: list[float]) -> list[float]:
    """Radii from the nearest layer, where they are negative, to the farthest."""
    return [-r for r in reversed(radii[1:])] + radii


def bright_level(color: Tensor) -> Tensor:
    """``(B, 1, 1, 1)``: the level of pixels that count half as background, so that no highlight fills all around it.

    Summed in double precision, where the order of adding changes nothing.
    """
    return (BRIGHT * color.mean(dim=(1, 2, 3), keepdim=True, dtype=torch.float64)).clamp_min(TINY).to(color.dtype)


def _layers(coc: Tensor, radii: list[float]) -> Iterator[tuple[float, Tensor, Tensor | None]]:
    """Signed radii from the nearest layer to the farthest, each with every pixel's share in it.

    A pixel between two radii belongs to both, so shared that the variance of its blur is right, hence the squares.
    Layers in front of the focal plane also come with the share of what lies clearly behind them.
    """
    square = coc * coc.abs()
    at = [r * abs(r) for r in signed(radii)]
    for i, radius in enumerate(signed(radii)):
        share = torch.ones_like(coc)
        if i > 0:
            share = torch.minimum(share, (square - at[i - 1]) / (at[i] - at[i - 1]))
        if i + 1 < len(at):
            share = torch.minimum(share, (at[i + 1] - square) / (at[i + 1] - at[i]))
        share = share.clamp_min(0)
        if waits(coc) or bool((share > 0).any()):
            behind = (square - at[i + 1]) / (at[i + 2] - at[i + 1]) if radius < 0 and i + 2 < len(at) else None
            yield radius, share, None if behind is None else behind.clamp(0, 1)


def _disc_spectrum(radius: float, like: Tensor) -> Tensor:
    """Transform of a disc that sums to one, centred on the first pixel and wrapped around."""
    rows, columns = like.shape[-2:]
    y = torch.fft.fftfreq(rows, 1 / rows, dtype=like.dtype, device=like.device)
    x = torch.fft.fftfreq(columns, 1 / columns, dtype=like.dtype, device=like.device)
    disc = (radius + EDGE - torch.hypot(y[:, None], x[None])).clamp(0, 1)
    return torch.fft.rfft2(disc / disc.sum())


def _fast_size(size: int) -> int:
    """The next number without prime factors above 5, for fast Fourier transforms."""
    rest = size
    for factor in (2, 3, 5):
        while rest % factor == 0:
            rest //= factor
    return size if rest == 1 else _fast_size(size + 1)
