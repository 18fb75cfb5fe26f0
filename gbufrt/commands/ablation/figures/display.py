"""Light as it is judged: displayed at a fixed exposure, and where two displays differ."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.commands.ablation.figures.errors import Pair
from gbufrt.files.color_maps import to_srgb, viridis

MIDDLE_GREY = 0.18

CHANGED = 2.0 / 255  # difference of a displayed pixel above which an effect has changed it
TRACED = 8.0 / 255  # the same between two traced pictures, which have noise
ERROR_TOP = 0.25  # displayed error at the end of the colour map


def exposure_of(truth: Tensor, hit: Tensor) -> float:
    """The factor that brings the geometric mean luminance of a true picture to middle grey."""
    level = truth.mean(1, keepdim=True)[hit].clamp_min(1e-4)
    return MIDDLE_GREY / float(level.log().mean().exp()) if level.numel() else 1.0


def display(light: Tensor, exposure: float) -> Tensor:
    """Linear light as it is judged: fixed exposure, the curve x / (1 + x) of each component, sRGB."""
    light = light.clamp_min(0.0) * exposure
    return to_srgb(light / (1.0 + light))


def displayed(lights: Pair, exposure: float) -> Pair:
    """`display` of both halves."""
    return display(lights[0], exposure), display(lights[1], exposure)


def unbiased(lights: Pair, exposure: float) -> Tensor:
    """`display` of what two independent noisy pictures are means of, free of their noise's bias to the first order.

    The curve bends, so noise shifts what is displayed in proportion to its variance: by half as much in the mean of
    both pictures as in each of them.

    Source: Quenouille 1956 (the jackknife).
    """
    first, second = displayed(lights, exposure)
    return 2 * display((lights[0] + lights[1]) / 2, exposure) - (first + second) / 2


def error_picture(estimate: Tensor, truth: Tensor, hit: Tensor) -> Tensor:
    """``(B, 3, H, W)``: the mean absolute difference of displayed pictures in viridis, black where nothing was hit."""
    error = (estimate - truth).abs().mean(1, keepdim=True)
    return torch.where(hit, viridis(error / ERROR_TOP), 0.0)


def changed_pixels(a: Tensor, b: Tensor, *, level: float = CHANGED) -> Tensor:
    """``(B, 1, H, W)`` bool: where two displayed pictures differ by more than ``level`` in a component."""
    return (a - b).abs().amax(1, keepdim=True) > level


def truly_changed(a: Pair, b: Pair, *, level: float = TRACED) -> Tensor:
    """`changed_pixels` of two noisy pictures in halves: by the mean over 3x3 pixels, which cancels noise."""
    square = ((a[0] - b[0]) * (a[1] - b[1])).mean(1, keepdim=True)
    return F.avg_pool2d(square, 3, stride=1, padding=1, count_include_pad=False) > level**2
