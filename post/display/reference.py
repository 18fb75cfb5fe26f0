"""Tone curves, the display's encoding, the vignette and the histogram of exposure in torch: the definitions, with their
gradients."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from gbufrt.compute.resident import resident
from gbufrt.directions import length
from gbufrt.luminance import luminance
from gbufrt.sampling import pixel_centers
from post.display.constants import (
    ACES_INPUT,
    ACES_OUTPUT,
    AGX_CURVE,
    AGX_DISPLAY_GAMMA,
    AGX_INSET,
    AGX_MAX_EV,
    AGX_MIN_EV,
    BINS,
    BRIGHTEST,
    DARKEST,
    NEUTRAL_DESATURATION,
    NEUTRAL_F90,
    NEUTRAL_START,
    TINY,
)

Operator = Literal["agx", "aces", "pbr_neutral", "reinhard", "linear"]


def tone_reference(
    color: Tensor, exposure: Tensor, operator: Operator, contrast: float, saturation: float, white: float
) -> Tensor:
    """``(B, 3, H, W)``. Arguments and result are those of `post.tone_map`."""
    light = (color * exposure.to(color)).clamp_min(0)
    if operator == "agx":
        return _agx(light, contrast, saturation)
    if operator == "reinhard":
        return _reinhard(light, white)
    return OPERATORS[operator](light)


def _agx(light: Tensor, contrast: float, saturation: float) -> Tensor:
    inset = matrix(AGX_INSET, light)
    stops = torch.einsum("ij,bjhw->bihw", inset, light).clamp_min(TINY).log2()
    x = ((stops - AGX_MIN_EV) / (AGX_MAX_EV - AGX_MIN_EV)).clamp(0, 1)
    curve = torch.zeros_like(x)
    for coefficient in reversed(AGX_CURVE):
        curve = curve * x + coefficient
    graded = curve.clamp_min(TINY) ** contrast
    grey = luminance(graded, 3)
    graded = grey + saturation * (graded - grey)
    shown = torch.einsum("ij,bjhw->bihw", torch.linalg.inv_ex(inset).inverse, graded)
    return shown.clamp(TINY, 1) ** AGX_DISPLAY_GAMMA


def _aces(light: Tensor) -> Tensor:
    v = torch.einsum("ij,bjhw->bihw", matrix(ACES_INPUT, light), light)
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return torch.einsum("ij,bjhw->bihw", matrix(ACES_OUTPUT, light), v).clamp(0, 1)


def _pbr_neutral(light: Tensor) -> Tensor:
    least = light.amin(1, keepdim=True)
    offset = torch.where(least < 2 * NEUTRAL_F90, least - least.square() / (4 * NEUTRAL_F90), NEUTRAL_F90)
    light = light - offset
    peak = light.amax(1, keepdim=True)
    d = 1 - NEUTRAL_START
    over = peak.clamp_min(NEUTRAL_START)
    shown = 1 - d * d / (over + d - NEUTRAL_START)
    scaled = light * shown / over
    fade = 1 - 1 / (NEUTRAL_DESATURATION * (over - shown) + 1)
    return torch.where(peak < NEUTRAL_START, light, torch.lerp(scaled, shown.expand_as(scaled), fade)).clamp(0, 1)


def _reinhard(light: Tensor, white: float) -> Tensor:
    level = luminance(light, 3)
    return (light * (1 + level / white**2) / (1 + level)).clamp(0, 1)


def _linear(light: Tensor) -> Tensor:
    return light.clamp(0, 1)


OPERATORS = {"agx": _agx, "aces": _aces, "pbr_neutral": _pbr_neutral, "reinhard": _reinhard, "linear": _linear}


def matrix(rows: tuple[tuple[float, ...], ...], like: Tensor) -> Tensor:
    """Rows scaled to sum to one, so that the rounding of published digits does not tint grey."""
    matrix = resident(rows, like)
    return matrix / matrix.sum(1, keepdim=True)


def encode_reference(image: Tensor) -> Tensor:
    """See `post.display.op.encoded`."""
    from kornia.color import linear_rgb_to_rgb  # late: kornia takes most of a second to import

    return linear_rgb_to_rgb(image.clamp(0, 1))


def vignette_reference(image: Tensor, strength: float, inner: float, outer: float) -> Tensor:
    """See `post.vignette`."""
    middle = resident((image.shape[-1] / 2, image.shape[-2] / 2), image)
    distance = length(pixel_centers(image) - middle[None, :, None, None]) / middle.norm()
    t = ((distance - inner) / (outer - inner)).clamp(0, 1)
    return image * (1 - strength * t * t * (3 - 2 * t))


def histogram_reference(color: Tensor) -> Tensor:
    """``(B, 2, BINS)``. See `post.display.op.histogram`."""
    light = luminance(color, 3).squeeze(1)
    counted = (light > 0).to(light.dtype)
    stops = light.clamp(2.0**DARKEST, 2.0**BRIGHTEST).log2()
    place = ((stops.detach() - DARKEST) * (BINS / (BRIGHTEST - DARKEST))).long().clamp(0, BINS - 1)
    empty = stops.new_zeros(*stops.shape[:2], BINS)  # bins of its own for each row: a GPU's threads wait for a bin
    return torch.stack([empty.scatter_add(2, place, x).sum(1) for x in (counted, stops * counted)], dim=1)
