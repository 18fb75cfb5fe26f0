"""Cubic splines through a picture's pixels: reads that lose next to nothing, however often a history is moved."""

from __future__ import annotations

import math
from functools import cache

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.resident import resident
from gbufrt.sampling import gather, sample
from post.upsampling.constants import ALMOST_NEXT

POLE = math.sqrt(3) - 2  # of the filter that turns samples into B-spline coefficients
REACH = 6  # pixels after which its response has fallen to 4e-4


@cache
def spline_taps() -> tuple[float, ...]:
    """The filter of `spline_coefficients` along one axis."""
    taps = [POLE ** abs(k) for k in range(-REACH, REACH + 1)]
    return tuple(tap / sum(taps) for tap in taps)


def spline_coefficients(image: Tensor) -> Tensor:
    """Coefficients ``(B, C, H, W)`` of the cubic B-splines that go through all pixels of an image ``(B, C, H, W)``.

    Source: Unser, Aldroubi and Eden 1993.
    """
    taps = resident(spline_taps(), image).expand(image.shape[1], 1, 1, -1)
    for across in (True, False):
        pad = (REACH, REACH, 0, 0) if across else (0, 0, REACH, REACH)
        weights = taps if across else taps.transpose(2, 3)
        image = F.conv2d(F.pad(image, pad, mode="replicate"), weights, groups=image.shape[1])
    return image


def spline_read(coefficients: Tensor, px: Tensor) -> Tensor:
    """Read a spline at positions ``(B, 2, h, w)`` in pixels, centres at +0.5; outside it reads the border.

    Sixteen taps as four bilinear reads.

    Args:
        coefficients: of `spline_coefficients`.
        px: where.

    Returns:
        ``(B, C, h, w)``; may overshoot the pixels around, see `without_overshoot`.

    Source: Sigg and Hadwiger 2005, GPU Gems 2 chapter 20.
    """
    corner = torch.floor(px - 0.5) + 0.5
    f = px - corner
    square, cube = f * f, f * f * f
    first, last = (1 - f) ** 3 / 6, cube / 6
    second = 2 / 3 - square + cube / 2
    left, right = first + second, 1 - first - second
    at_left, at_right = corner - 1 + second / left, corner + 1 + last / right
    result = torch.zeros(())
    for x, wx in ((at_left, left), (at_right, right)):
        for y, wy in ((at_left, left), (at_right, right)):
            place = torch.stack([x[:, 0], y[:, 1]], dim=1)
            result = result + wx[:, 0:1] * wy[:, 1:2] * sample(coefficients, place)
    return result


def without_overshoot(read: Tensor, image: Tensor, px: Tensor) -> Tensor:
    """What was read between an image's pixels, kept within the four around.

    What overshoots beside a lamp would do so more with every frame that moves: a black ring.

    Args:
        read: ``(B, C, h, w)``.
        image: ``(B, C, H, W)``.
        px: ``(B, 2, h, w)`` pixels, centres at +0.5.

    Source: the clamp after the Lanczos filter of AMD FidelityFX FSR 2, 2022.
    """
    x, y = torch.floor(px - 0.5 + ALMOST_NEXT).long().unbind(dim=1)
    around = torch.stack([gather(image, x + i, y + j) for j in (0, 1) for i in (0, 1)])
    return torch.minimum(torch.maximum(read, around.amin(dim=0)), around.amax(dim=0))
