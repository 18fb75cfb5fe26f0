"""Lamps in frames that do not tell emission."""

from __future__ import annotations

from functools import reduce

import torch
from torch import Tensor

from gbufrt.compute.resident import waits
from gbufrt.luminance import luminance
from post.filters.around import least, pooled
from post.filters.edges import padded, windows
from post.filters.signals import MIN_ALBEDO

GLARING = 8.0  # times the median light: as much is a lamp's if it is even
EVEN = 0.02  # relative difference of a lamp's pixels
HOLE, CLEAN = 6, 7  # pixels around a dark one that, if they are alike, make it the noise of a penumbra; and the side of
# the square in which a lamp has no such noise
RIM = 0.25  # of a lamp's light: the least of a pixel that it covers in part
AWAY = 9  # pixels: squares in which the same light as a lamp's is its own, where samples make its border ragged
SPARSE = 4  # pixels of which one counts for the median, both ways
BESIDE = 15  # pixels: squares over which surfaces beside a lamp are averaged


def light_of_lamps(light: Tensor, divisor: Tensor, hit: Tensor, albedo: Tensor | None = None) -> Tensor:
    """``(B, 3, H, W)``: a guess of emission, for frames that do not tell it; 0 where there is none.

    The lens sees lamps without noise, so that neighbours on them send the same light, and far more than most surfaces;
    what the sun lights is as even, but for dots in penumbras. Not told apart, a lamp in a ceiling shines into the light
    of the ceiling around it, and leaves a trail on it. Lamps smaller than 3x3 pixels are found where their albedo is
    black, as many renderers write it. What a lamp reflects besides is taken to be like that around it.

    Args:
        light: ``(B, 3, H, W)`` linear radiance.
        divisor: as ``light``, its albedo and all else that reflects.
        hit: ``(B, 1, H, W)`` bool.
        albedo: ``(B, 3, H, W)`` as the renderer wrote it.
    """
    level = luminance(light.detach())
    some = torch.where(hit, level, torch.nan)[..., ::SPARSE, ::SPARSE]
    bright = hit & (level > GLARING * some.flatten(1).nanmedian(1).values.nan_to_num()[:, None, None, None])
    lit = torch.where(bright, level, 0.0)
    most = (1 - EVEN) * _highest(lit, 3)
    core = bright & (most <= least(lit, 3))
    black = torch.zeros_like(hit) if albedo is None else hit & (albedo.amax(1, keepdim=True) <= MIN_ALBEDO)
    black = _even(level, bright, black)
    if not (waits(core) or bool((core | black).any())):
        return torch.zeros_like(light)
    beside = [(other > most).to(level) for other in windows(padded(lit, 1), 1)]
    holes = (lit < most) & (reduce(torch.add, beside) >= HOLE)
    core &= _highest(holes.to(level), CLEAN) == 0
    core = torch.where(core | black, level, 0.0)
    rim, far = _highest(core, 5), _highest(core, AWAY)
    lamp = bright & (((rim > 0) & (level > RIM * rim)) | ((level / far - 1).abs() < EVEN))
    others = (hit & ~lamp).to(light)
    plain, every = light / divisor, others.sum((2, 3), keepdim=True).clamp_min(1)
    near = pooled(others, torch.ones_like(others), BESIDE) > 0
    around = torch.where(near, pooled(plain, others, BESIDE), (plain * others).sum((2, 3), keepdim=True) / every)
    return torch.where(lamp, (light - divisor * around).clamp_min(0.0), 0.0)


def _even(level: Tensor, bright: Tensor, black: Tensor) -> Tensor:
    """``(B, 1, H, W)`` bool: bright pixels of black surfaces that send as much as the black ones of 3x3 around them.

    What black surfaces mirror, which alone makes them bright too, is noisy.
    """
    highest = _highest(torch.where(black, level, 0.0), 3)
    return bright & black & ((1 - EVEN) * highest <= least(torch.where(black, level, torch.inf), 3))


def _highest(value: Tensor, size: int) -> Tensor:
    """The highest value of the square of ``size`` pixels around each, within the picture."""
    return -least(-value, size)
