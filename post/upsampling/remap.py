"""Pictures read between their pixels as means over squares, with edges inside: reads that hardly blur."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.sampling import gather
from post.upsampling.constants import STEPPED


def remapped(image: Tensor, px: Tensor) -> Tensor:
    """Means of an image ``(B, C, H, W)`` over squares at positions ``(B, 2, h, w)`` in pixels, centres at +0.5.

    A pixel between a darker and a brighter one holds a mean of both: it is taken for a step from one to the other,
    where its value says that the step lies, and in part for a slope, as pictures of rounded things have. Across, then
    down. Nothing overshoots, which beside lamps would grow with every frame that moves; outside lies the border.

    Args:
        image: what pixels hold, means over their areas.
        px: where.

    Returns:
        ``(B, C, h, w)``.

    Source: Hirt and Nichols 1981 (fractions of volumes, carried on with sharp faces); van Leer 1977 (slopes).
    """
    corner = torch.floor(px - 0.5)
    across, down = (px - 0.5 - corner).split(1, dim=1)
    x, y = corner.long().unbind(dim=1)
    rows = [_moved([gather(image, x + i, y + j) for i in (-1, 0, 1, 2)], across) for j in (-1, 0, 1, 2)]
    return _moved(rows, down)


def _moved(four: list[Tensor], f: Tensor) -> Tensor:
    """The mean from ``f`` of the way through the second of four pixels to as far in the third."""
    a, b, c, d = four
    rising, next_rising = (b - a) * (c - b) > 0, (c - b) * (d - c) > 0
    step = (b - c) / torch.where(rising, a - c, 1.0)
    next_step = (c - d) / torch.where(next_rising, b - d, 1.0)
    stepped = (step - f).clamp_min(0.0) * a + (1 - torch.maximum(step, f)) * c
    next_stepped = torch.minimum(next_step, f) * b + (f - next_step).clamp_min(0.0) * d
    sloped = (1 - f) * (b + _slope(a, b, c) * f / 2)
    next_sloped = f * (c - _slope(b, c, d) * (1 - f) / 2)
    first = torch.where(rising, torch.lerp(sloped, stepped, STEPPED), (1 - f) * b)
    return first + torch.where(next_rising, torch.lerp(next_sloped, next_stepped, STEPPED), f * c)


def _slope(a: Tensor, b: Tensor, c: Tensor) -> Tensor:
    """Of the pixel in the middle of three that rise or fall, as steep as leaves it between its neighbours."""
    steepest = 2 * torch.minimum((b - a).abs(), (c - b).abs())
    return torch.minimum(torch.maximum((c - a) / 2, -steepest), steepest)
