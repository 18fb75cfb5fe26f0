"""Errors against two independent halves of a truth, and the pixels that they count."""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from torch import Tensor

from gbufrt.metrics.image import masked_mean

Figures = dict[str, float]
Truth = Mapping[str, Tensor]
Pair = tuple[Tensor, Tensor]
"""Two independent halves of something traced."""

ON_SCREEN = 0.99  # least share of a pixel's rays that end on on-screen surfaces, or of its light that comes by them

FEWEST = 64  # pixels below which a mean says nothing
LEAST = 1e-4  # displayed error too small for any display to show


def halves(truth: Truth, name: str) -> Pair:
    """The two independent halves of a truth; the whole twice where it has none."""
    return truth.get(f"{name}_first", truth[name]), truth.get(f"{name}_second", truth[name])


def rms_error(estimate: Tensor | Pair, truths: Pair, mask: Tensor) -> Tensor:
    """``(B,)`` RMSE against two halves of the truth; a noisy estimate comes in halves as well."""
    return masked_mean(squared_errors(estimate, truths), mask).clamp_min(0.0).sqrt()


def squared_errors(estimate: Tensor | Pair, truths: Pair) -> Tensor:
    """``(B, 1, H, W)`` squared errors, see `rms_error`; noise may make some negative."""
    a, b = both_halves(estimate)
    return ((a - truths[0]) * (b - truths[1])).mean(1, keepdim=True)


def both_halves(value: Tensor | Pair) -> Pair:
    return value if isinstance(value, tuple) else (value, value)


def gain(better: Tensor | Pair, worse: Tensor | Pair, truth: Tensor | Pair, changed: Tensor) -> float:
    """Gain in PSNR, decibels, of the first displayed picture over the second, on the pixels of ``changed``."""
    mask, truths = enough(changed), both_halves(truth)
    return psnr_over(better, truths, mask) - psnr_over(worse, truths, mask)


def psnr_over(picture: Tensor | Pair, truths: Pair, mask: Tensor) -> float:
    """PSNR of a displayed picture against two halves of a displayed truth, decibels."""
    error = mean_of(rms_error(picture, truths, mask))
    return error if math.isnan(error) else -20 * math.log10(max(error, LEAST))


def share_of_pixels(part: Tensor, whole: Tensor) -> float:
    """The share of the pixels of ``whole`` that are in ``part``, a subset of them."""
    return float(part.sum()) / max(float(whole.sum()), 1.0)


def share_of_error(picture: Tensor | Pair, truths: Pair, part: Tensor, whole: Tensor) -> float:
    """The share of a displayed picture's squared error on ``whole`` that lies in ``part``, a subset of its pixels."""
    square = squared_errors(picture, truths)
    every = float(square[enough(whole)].sum())
    return min(max(float(square[part].sum()) / every, 0.0), 1.0) if every > 0 else float("nan")


def by_onscreen_points(onscreen: Pair, truths: Pair) -> Tensor:
    """``(B, 1, H, W)`` bool: pixels whose light came by on-screen points, to within a hundredth."""
    some, all_ = ((a + b).mean(1, keepdim=True) for a, b in (onscreen, truths))
    return some >= ON_SCREEN * all_


def relative_energy(estimate: Tensor | Pair, truths: Pair, mask: Tensor) -> float:
    """Sum of squared errors over the sum of the squared truth; NaN where the truth is black.

    An estimate that shares the noise of the truth comes in halves as well.
    """
    a, b = both_halves(estimate)
    total = float((truths[0] * truths[1] * mask).sum())
    return float(((a - truths[0]) * (b - truths[1]) * mask).sum()) / total if total > 0 else float("nan")


def enough(mask: Tensor) -> Tensor:
    return mask if int(mask.sum()) >= FEWEST else torch.zeros_like(mask)


def mean_of(value: Tensor) -> float:
    return float(value.mean())
