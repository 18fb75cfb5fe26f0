"""Jittered samples of a small picture, gathered about the pixels of a larger one, and what history may hold there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.directions import length
from gbufrt.luminance import luminance
from gbufrt.sampling import gather, inside, pixel_centers, sample, shifted
from post.history.constants import WINDOW
from post.history.taa_reference import rgb, ycocg
from post.upsampling.constants import (
    ALONG,
    BOX_WINDOW,
    COVERED,
    DECAY,
    DISTRUST,
    FIRST_WINDOW,
    FLAT,
    LEAST_WEIGHT,
    MATURE,
    NARROWEST,
    PARTING,
    SAMPLE_WINDOW,
    WIDEST,
    WIDEST_AT,
)
from post.upsampling.samples import Samples

OPPOSITE = ((1, 0), (0, 1), (1, 1), (1, -1))
CONTRAST, FLOOR = 0.25, 0.05  # of a pixel's luminance, and besides: how far a thin feature stands out to count whole
AROUND = 9  # pixels of the small picture along the square over which light is compared between frames
AREA = 5  # pixels of the small picture: squares in which all light has to change
SAME, OTHER = 0.3, 0.6  # relative change of that light up to which nothing has changed, and from which all has
DARK = 0.01  # of that light: changes of what is darker count relative to this; 0.05 is shown as a mid-tone


@dataclass(frozen=True, eq=False)
class Gathered:
    """What one frame tells of each pixel of the large picture; all ``(B, C, H, W)``."""

    color: Tensor
    """Mean of the four samples around."""
    expected: Tensor
    """Mean, by the same weights, of what the history shows where they lie."""
    weight: Tensor
    """How many samples there are, counted by how near they lie."""
    mean: Tensor
    """In YCoCg, of the wider surroundings."""
    spread: Tensor
    """Standard deviation there."""
    least: Tensor
    """Of each channel, in the four samples."""
    most: Tensor
    """See ``least``."""


def gathered(toned: Tensor, expected: Tensor, shapes: Tensor, at: Samples, weight: Tensor) -> Gathered:
    """Gather a small picture ``(B, 3, h, w)`` for the pixels of a large one.

    Args:
        toned: tone-mapped colour.
        expected: ``(B, 3, h, w)`` what the history shows where the samples lie.
        shapes: ``(B, 3, h, w)`` of `ellipses`, or of both these and `ellipses_before`.
        at: its samples.
        weight: ``(B, 1, H, W)`` of the history; with little of it the window is that of the small picture's pixels.
    """
    area, ready = at.ratio[0] * at.ratio[1], (weight / MATURE).clamp(0, 1)
    window = SAMPLE_WINDOW * ready + FIRST_WINDOW / area * (1 - ready)
    xx, xy, yy = at.nearest(shapes).split(1, dim=1)
    taps = list(at.surrounding(torch.cat([toned, expected], dim=1)))
    zero = torch.zeros_like(weight)
    count, share, sums = zero, zero, zero
    for tap, away in taps:
        x, y = away[:, :1], away[:, 1:]
        square = xx * x * x + 2 * xy * x * y + yy * y * y
        counts = near(window * square)
        count, share, sums = count + near(SAMPLE_WINDOW * square), share + counts, sums + counts * tap
    total, first, second = zero, zero, zero
    for tap, away in at.around(ycocg(toned)):
        counts = torch.exp(BOX_WINDOW / area * away.square().sum(1, keepdim=True))
        total, first, second = total + counts, first + counts * tap, second + counts * tap * tap
    mean, colors = first / total, torch.stack([tap[:, :3] for tap, _ in taps])
    spread = (second / total - mean * mean).clamp_min(0.0).add(1e-12).sqrt()
    color, expected = (sums / share).split(3, dim=1)
    return Gathered(color, expected, count + LEAST_WEIGHT, mean, spread, colors.amin(0), colors.amax(0))


def near(exponent: Tensor) -> Tensor:
    """Nearly `torch.exp` of what is not positive, in products alone."""
    power = (1 + exponent / 8).clamp_min(1 / 32)
    square = power * power
    return square * square * square * square


def ellipses(toned: Tensor) -> Tensor:
    """``(B, 3, h, w)``: how squared distances xx, twice xy and yy count; along an edge less than across it.

    Source: the kernels of Wronski et al. 2019, Handheld Multi-Frame Super-Resolution, from structure tensors.
    """
    light = F.pad(luminance(toned), (2, 2, 2, 2), mode="replicate")
    x, y = light[..., 1:-1, 2:] - light[..., 1:-1, :-2], light[..., 2:, 1:-1] - light[..., :-2, 1:-1]
    return _along(*(9 * F.avg_pool2d(torch.cat([x * x, x * y, y * y], dim=1), 3, stride=1)).split(1, dim=1))


def ellipses_before(toned: Tensor, px: Tensor) -> Tensor:
    """``(B, 3, h, w)``: as `ellipses`, from the 4x4 pixels of a history ``(B, 3, H, W)`` around positions.

    It tells how edges run between the samples of one frame.

    Args:
        toned: tone-mapped.
        px: ``(B, 2, h, w)`` pixels of the history.
    """
    light, corner = luminance(toned), torch.floor(px - 0.5).long()
    rows = [[gather(light, corner[:, 0] + i, corner[:, 1] + j) for i in range(-1, 3)] for j in range(-1, 3)]
    sums = [torch.zeros_like(px[:, :1]) for _ in range(3)]
    for above, below in pairwise(rows):
        for (a, b), (c, d) in zip(pairwise(above), pairwise(below), strict=True):
            x, y = b - a + d - c, c - a + d - b
            sums = [total + square for total, square in zip(sums, (x * x, x * y, y * y), strict=True)]
    return _along(*sums)


def _along(xx: Tensor, xy: Tensor, yy: Tensor) -> Tensor:
    """The ellipse along the edge that a structure tensor tells of."""
    larger = (xx + yy + ((xx - yy) * (xx - yy) + 4 * xy * xy + 1e-12).sqrt()) / 2
    share = (1 - ALONG) / (xx + yy + FLAT)
    return torch.cat([1 - share * (larger - xx), share * xy, 1 - share * (larger - yy)], dim=1)


def shear(motion: Tensor) -> Tensor:
    """``(B, 1, H, W)``: by how much motion ``(B, 2, H, W)`` differs from that of a neighbour at most, as a length."""
    around = F.pad(motion, (1, 1, 1, 1), mode="replicate")
    height, width = motion.shape[-2:]
    apart = [around[..., j : j + height, i : i + width] - motion for j in range(3) for i in range(3)]
    return torch.stack([difference.square().sum(1, keepdim=True) for difference in apart]).amax(0).sqrt()


def mean_weight(at: Samples) -> float:
    """What a frame's samples weigh at a pixel, in the mean."""
    return 8 / 9 * math.pi / -SAMPLE_WINDOW / (at.ratio[0] * at.ratio[1])


def clipped(old: Tensor, now: Gathered, extent: Tensor, weight: Tensor, at: Samples) -> tuple[Tensor, Tensor, Tensor]:
    """Hold a history within mean and deviation of the surroundings in YCoCg, channel by channel.

    Args:
        old: ``(B, 3, H, W)`` tone-mapped.
        now: this frame.
        extent: ``(B, 1, H, W)`` standard deviations to the sides of the box.
        weight: ``(B, 1, H, W)`` of the history: the more, the wider is the box.
        at: the frame's samples.

    Returns:
        The history; ``(B, 1, H, W)`` by how much its luma moved; and what weight is left, the less the more it moved.
    """
    was = ycocg(old)
    wide = NARROWEST + (WIDEST - NARROWEST) * (weight / (WIDEST_AT * mean_weight(at))).clamp(0, 1)
    side = extent * wide * now.spread
    kept = torch.minimum(torch.maximum(was, now.mean - side), now.mean + side)
    moved = kept - was
    left = weight / (1 + DISTRUST * moved.abs().amax(1, keepdim=True))
    return rgb(kept).clamp_min(0.0), moved[:, :1], left  # the box holds colours that no light has


def thin_features(toned: Tensor) -> Tensor:
    """``(B, 1, h, w)`` in [0, 1]: how far each pixel is brighter, or darker, than both sides of it along one axis."""
    light = luminance(toned).detach()
    found = torch.zeros_like(light)
    for dx, dy in OPPOSITE:
        one, other = shifted(light, dx, dy), shifted(light, -dx, -dy)
        stands_out = torch.maximum(light - torch.maximum(one, other), torch.minimum(one, other) - light)
        found = torch.maximum(found, stands_out)
    return (found / (FLOOR + CONTRAST * light)).clamp(0, 1)


def locked(locks: Tensor, found: Tensor, at: Samples, weight: Tensor, depth: Tensor, motion: Tensor) -> Tensor:
    """Locks of thin features: how strong they are, and the depth and motion of what was locked.

    Samples often miss a thin feature, so that the surroundings do not tell that it is still there. A lock is 1 where a
    sample has just met a feature, and less with every sample since.

    Args:
        locks: ``(B, 4, H, W)`` what `held` left of those of the frame before.
        found: ``(B, 1, h, w)`` of `thin_features`.
        at: its samples.
        weight: ``(B, 1, H, W)`` of this frame's samples.
        depth: ``(B, 1, H, W)`` of each pixel now.
        motion: ``(B, 2, H, W)`` pixels, of each pixel.
    """
    met = at.nearest(found) * torch.exp(WINDOW / 2 * at.away.square().sum(1, keepdim=True))
    now = torch.cat([met, depth, motion], dim=1)
    old = torch.cat([(locks[:, :1] - DECAY * weight.detach()).clamp_min(0.0), locks[:, 1:]], dim=1)
    return torch.where(met > old[:, :1], now, old)


def held(locks: Tensor, depth: Tensor, depth_before: Tensor, motion: Tensor) -> Tensor:
    """Locks of the frame before, at this frame's pixels: none where something nearer shows, or moves otherwise.

    Args:
        locks: ``(B, 4, H, W)`` of `locked`, read where each pixel was.
        depth: see `locked`, as ``motion``.
        depth_before: ``(B, 1, H, W)`` of each pixel in the frame before.
        motion: see ``depth``.
    """
    strength, there, moved = locks.split((1, 1, 2), dim=1)
    apart = length(moved - motion) / PARTING
    kept = strength * (1 - apart).clamp(0, 1) * (depth_before > there * (1 - COVERED))
    return torch.cat([kept, there + depth - depth_before, moved], dim=1)


def light_around(toned: Tensor) -> Tensor:
    """``(B, 1, h, w)`` typical luminance about each pixel of the small picture, which jitter hardly changes.

    The mean is that of square roots, as few bright pixels in the dark, which samples meet or miss, are no change.
    """
    side = AROUND // 2
    light = F.pad(luminance(toned).detach().clamp_min(0.0).sqrt(), (side,) * 4, mode="replicate")
    return F.avg_pool2d(F.avg_pool2d(light, (AROUND, 1), stride=1), (1, AROUND), stride=1).square()


def same_light(now: Tensor, before: Tensor, motion: Tensor) -> Tensor:
    """``(B, 1, h, w)`` in [0, 1]: 1 where light has not changed since the frame before, 0 where all has.

    A light that goes out changes an area, bodies that pass along their edges alone: what has not changed counts some
    pixels around.

    Args:
        now: of `light_around`, this frame.
        before: the frame before.
        motion: ``(B, 2, h, w)`` pixels of the small picture.
    """
    px = pixel_centers(now) + motion.detach()
    was = torch.where(inside(px, (now.shape[-2], now.shape[-1])), sample(before, px), now)
    change = (now - was).abs() / torch.maximum(now, was).clamp_min(DARK)
    return F.max_pool2d(((OTHER - change) / (OTHER - SAME)).clamp(0, 1), AREA, 1, AREA // 2)
