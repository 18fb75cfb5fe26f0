"""Local linear regression by filters: a plane fitted to the light around a pixel, in place of the mean of that light.

A mean of neighbours lies to one side where a surface ends, and light has a gradient there: corners of rooms come out
too bright or too dark. The plane that fits the same neighbours, with the same weights, has no such bias. Filters
average, and the plane follows from averages of what `with_places` gives.
"""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.luminance import luminance

PIXELS = 16.0  # to a unit of place: squares of places then stay exact enough in float32 for pictures of any usual size
PLACES = 5  # planes of places and of their products
SHRINKAGE = 0.01  # of slopes, square units: what a filter a few pixels wide averages has little to tell of them
NOISE = 0.1  # square units: more shrinkage for each unit of relative variance
STEEPEST = 0.5  # share of the mean by which the fit may differ from it


def with_places(signal: Tensor) -> Tensor:
    """What a filter is to average for `fitted`: a signal, places, their products, and those with the signal.

    Args:
        signal: ``(B, C, H, W)``.

    Returns:
        ``(B, 3 C + 5, H, W)``.
    """
    x, y = _places(signal)
    return torch.cat([signal, x, y, x * x, x * y, y * y, x * signal, y * signal], dim=1)


def fitted(averages: Tensor, variance: Tensor, lead: int | None = None) -> Tensor:
    """The plane through the signal around each pixel, at the pixel.

    Slopes are shrunk (ridge regression), the more so the more noise there is.

    Args:
        averages: ``(B, 3 C + 5, H, W)`` of `with_places`, with weights that sum to one.
        variance: ``(B, 1, H, W)`` of the luminance of the averaged signal.
        lead: how many of the first channels make the luminance; all by default.

    Returns:
        ``(B, C, H, W)``.

    Source: Bitterli et al. 2016 (first-order regression in windows); Hoerl and Kennard 1970 (ridge regression).
    """
    channels = (averages.shape[1] - PLACES) // 3
    mean, mean_x, mean_y, xx, xy, yy, by_x, by_y = averages.split([channels, *(1,) * PLACES, channels, channels], dim=1)
    ridge = SHRINKAGE + NOISE * variance / luminance(mean, lead).square().clamp_min(1e-8)
    xx = (xx - mean_x * mean_x).clamp_min(0.0) + ridge
    yy = (yy - mean_y * mean_y).clamp_min(0.0) + ridge
    xy = xy - mean_x * mean_y
    by_x, by_y = by_x - mean_x * mean, by_y - mean_y * mean
    x, y = _places(mean)
    x, y = x - mean_x, y - mean_y
    determinant = (xx * yy - xy * xy).clamp_min(1e-12)
    along_x, along_y = (yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant
    most = STEEPEST * mean.abs()
    return mean + torch.minimum(torch.maximum(along_x * by_x + along_y * by_y, -most), most)


def _places(signal: Tensor) -> tuple[Tensor, Tensor]:
    """``(B, 1, H, W)`` x and y of the pixels, from the middle of the picture, in units of `PIXELS`."""
    batch, _, height, width = signal.shape
    x = (torch.arange(width, dtype=signal.dtype, device=signal.device) - width / 2) / PIXELS
    y = (torch.arange(height, dtype=signal.dtype, device=signal.device) - height / 2) / PIXELS
    size = batch, 1, height, width
    return x.expand(size), y[:, None].expand(size)
