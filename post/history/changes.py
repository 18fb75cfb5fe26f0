"""Follow changes of light that stand out from noise over a wide piece of a surface.

The test of `post.history.antilag`, over 3x3 pixels, takes one bright sample of a long-tailed distribution for a change,
and a history that begins anew there shows as a spot. Over a wide area such samples average out.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from gbufrt.luminance import luminance
from post.filters.constants import COARSE_POWER, HIT
from post.filters.edges import Surface
from post.filters.op import wavelet
from post.history.antilag import without_fireflies
from post.history.constants import FAST_BLEND

AREA = 2  # wavelets over which changes are averaged: they reach 6 pixels to each side, as small shadows do
NOTICED = 0.05  # of the light: smaller changes are left to the mean, since cuts and resampling bring such themselves
STRICTER = 1.5  # than `clamp` in `post.temporal`, whose noise is taken to be shared by three pixels


def follow_changes(
    sample: Tensor, state: Tensor, noise: Tensor, geometry: Surface, *, lead: int, clamp: float, firefly: float
) -> tuple[Tensor, Tensor]:
    """Draw the fast history toward the frame and the slow one toward the fast, where their surface has changed.

    Args:
        sample: ``(B, C, H, W)`` of this frame.
        state: ``(B, C + lead + 4, H, W)`` as for `post.history.op.taken_in`.
        noise: ``(B, 1, H, W)``, see `antilag.typical_variance`.
        geometry: of this frame.
        lead: number of leading channels that are compared.
        clamp: as in `post.temporal`.
        firefly: standard deviations above history and neighbours at which a sample is cut, see `without_fireflies`.

    Returns:
        The sample without what stands out, and the state with shorter histories where light changes.
    """
    old, fast, moments, share, age = state.split([sample.shape[1], lead, 2, 1, 1], dim=1)
    sample = without_fireflies(sample, old, noise, age, lead, firefly)
    known = (age > 0).to(age.dtype)
    guide = torch.cat([geometry.guide[:, :HIT], geometry.guide[:, HIT : HIT + 1] * known], dim=1)
    surface, few = replace(geometry, guide=guide), age.clamp(1.0, (1 + FAST_BLEND) / (1 - FAST_BLEND))
    floor = NOTICED * luminance(fast, lead).abs() + 1e-6

    def change(light: Tensor, difference: Tensor, frames: Tensor) -> tuple[Tensor, Tensor]:
        difference, variance = spread(difference, noise * frames, surface, AREA)
        allowed = STRICTER * clamp * variance.clamp_min(0.0).add(1e-12).sqrt() + floor
        explained = (allowed / difference.abs().amax(1, keepdim=True).clamp_min(1e-12)).clamp_max(1.0) ** 2
        shift = known * difference * (1 - explained)
        return torch.maximum(shift, -light.clamp_min(0.0)), explained  # the dark beside a highlight that has moved on

    shift, _ = change(fast, sample[:, :lead] - fast, 1 + 1 / few)
    fast, light = fast + shift, luminance(shift, lead)
    moments = torch.cat([moments[:, :1] + light, moments[:, 1:] + light * (2 * moments[:, :1] + light)], dim=1)
    shift, explained = change(old[:, :lead], fast - old[:, :lead], 1 / few + 1 / age.clamp_min(1.0))
    old = torch.cat([old[:, :lead] + shift, old[:, lead:]], dim=1)
    younger = torch.where(age > 1, 1 + (age - 1) * explained, age)
    return sample, torch.cat([old, fast, moments, share * age / younger.clamp_min(1e-6), younger], dim=1)


def spread(
    planes: Tensor, variance: Tensor, geometry: Surface, iterations: int, reach: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """Average over the surface, whatever its light.

    Args:
        planes: ``(B, C, H, W)``, any unit.
        variance: ``(B, 1, H, W)`` of a plane's noise.
        geometry: of the same size.
        iterations: wavelets, each twice as wide as the one before.
        reach: ``(B, 1, H, W)``: 1 / (2 sigma^2) of the widest average, 1 / pixels squared; none is too wide by default.

    Returns:
        ``planes`` averaged, and the variance that is left.
    """
    none = torch.zeros_like(variance)
    values = torch.cat([planes, none, variance], dim=1)  # no luminance to compare: only geometry weighs
    for iteration in range(iterations):
        values = wavelet(
            values, geometry, none if reach is None else reach, step=2**iteration,
            phi_color=1.0, phi_depth=1.0, phi_normal=COARSE_POWER,
        )  # fmt: skip
    return values[:, :-2], values[:, -1:]
