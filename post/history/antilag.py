"""Distinguish changes of light from noise, so that histories follow the former and average the latter."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.resident import waits
from gbufrt.luminance import luminance
from post.filters.around import least, pooled
from post.filters.op import spatial_moments
from post.filters.surfaces import surface
from post.history.constants import FAST_BLEND, FAST_FRAMES, MOMENTS_BLEND, NOTICED, POOL, YOUNG

UNSURE = 15.0  # frames: the shorter the history, the less certain its variance and the wider the blur
GRAINY = 0.03  # share of the light: where noise is stronger for `WIDE` pixels around, only stronger edges count
SPECKLED = 120.0  # grain of single samples from which on dark ones prove no shadow: a third of the light is noise
FIRST = 5  # pixels: square over which pixels of one sample share their relative variance
AROUND, WIDE = 7, 25  # pixels: squares over which noise is compared with light, and of which the least counts


def sample_variance(moments: Tensor, age: Tensor) -> Tensor:
    """Variance of one frame's luminance, unbiased for the few frames that the moments hold."""
    count = age.clamp(2.0, (1 + MOMENTS_BLEND) / (1 - MOMENTS_BLEND))
    return (moments[:, 1:] - moments[:, :1] ** 2).clamp_min(0.0) * count / (count - 1)


def typical_variance(moments: Tensor, age: Tensor) -> Tensor:
    """Variance from 7x7 pixels: not every one of them has had one of the rare bright samples yet."""
    wide = 2 * POOL + 1
    own, mature = sample_variance(moments, age), (age >= YOUNG).to(age.dtype)
    typical = torch.maximum(own, pooled(own, mature, wide))
    visible = (age > 0).to(age.dtype)
    around = pooled(moments[:, 1:], visible, wide) - pooled(moments[:, :1], visible, wide) ** 2
    return torch.where(age < YOUNG, torch.maximum(typical, around), typical)


def variance_left(sample: Tensor, moments: Tensor, share: Tensor, length: Tensor, g: GBuffer, lead: int) -> Tensor:
    """Variance ``(B, 1, H, W)`` of the mean's luminance; that of few frames has at least the spread of those around.

    Args:
        sample: ``(B, C, H, W)`` of this frame, without fireflies.
        moments: ``(B, 2, H, W)`` mean and mean square of luminance.
        share: ``(B, 1, H, W)`` sum of squared weights of the mean.
        length: ``(B, 1, H, W)`` frames in it.
        g: of this frame.
        lead: channels that make the luminance.
    """
    variance = sample_variance(moments, length)
    if waits(length) or bool((length < YOUNG).any()):
        geometry = surface(g.depth, g.normal, g.hit, g.camera)
        _, around = spatial_moments(sample, geometry, radius=2, lead=lead)
        variance = torch.where(length < YOUNG, torch.maximum(around, variance), variance)
    return variance * share


def without_fireflies(signal: Tensor, old: Tensor, variance: Tensor, age: Tensor, lead: int, firefly: float) -> Tensor:
    """Scale down samples that stand far above both their own history and the 3x3 pixels around them.

    Without any history a lone bright pixel may be detail, and is kept.
    """
    if firefly <= 0:
        return signal
    light, ones = luminance(signal, lead), torch.ones_like(age)
    around = (9 * pooled(light, ones) - light) / 8
    spread = ((9 * pooled(light * light, ones) - light * light) / 8 - around**2).clamp_min(0.0)
    own = luminance(old, lead) + firefly * variance.add(1e-12).sqrt()
    limit = torch.maximum(own, around + firefly * spread.add(1e-12).sqrt())
    scale = torch.where((age > 0) & (light > limit) & (limit > 0), limit / light.clamp_min(1e-12), 1.0)
    return torch.cat([signal[:, :lead] * scale, signal[:, lead:]], dim=1)


def sample_reference(signal: Tensor, state: Tensor, lead: int, firefly: float) -> tuple[Tensor, Tensor]:
    """What `post.history.op.taken_in` finds: the signal without fireflies, and the noise of its luminance."""
    old, _, moments, _, age = state.split([signal.shape[1], lead, 2, 1, 1], dim=1)
    noise = typical_variance(moments, age)
    return without_fireflies(signal, old, noise, age, lead, firefly), noise


def differences_reference(signal: Tensor, noise: Tensor, state: Tensor, first: Tensor, lead: int) -> Tensor:
    """What `post.history.changes.differences` returns."""
    old, fast, age = state[:, :lead], state[:, -lead - 4 : -4], state[:, -1:]
    few = 1 / age.clamp(1.0, FAST_FRAMES)
    if first.shape[1] == 0:
        return torch.cat([signal[:, :lead] - fast, noise * (few + 1)], dim=1)
    return torch.cat([fast + first - old, noise * (few + 1 / age.clamp_min(1.0))], dim=1)


def unexplained_reference(averaged: Tensor, state: Tensor, lead: int, clamp: float, slow: bool) -> Tensor:
    """What `post.history.changes.unexplained` returns."""
    fast, age = state[:, -lead - 4 : -4], state[:, -1:]
    difference, variance = averaged.split([lead, 1], dim=1)
    allowed = clamp * variance.clamp_min(0.0).add(1e-12).sqrt() + NOTICED * luminance(fast, lead).abs() + 1e-6
    explained = (allowed / difference.abs().amax(1, keepdim=True).clamp_min(1e-12)).clamp_max(1.0) ** 2
    shift, light = (age > 0) * difference * (1 - explained), state[:, :lead] if slow else fast
    shift = torch.maximum(shift, -light.clamp_min(0.0))  # the dark beside a highlight that has moved on
    return torch.cat([shift, explained], dim=1) if slow else shift


def blend_reference(
    sample: Tensor, state: Tensor, longest: Tensor, fast_change: Tensor, slow_change: Tensor, lead: int
) -> Tensor:
    """The state that `post.history.op.blended` returns; changes have no channels where none is followed."""
    old, fast, moments, share, age = state.split([sample.shape[1], lead, 2, 1, 1], dim=1)
    if fast_change.shape[1] > 0:
        shift, (move, explained) = fast_change, slow_change.split([lead, 1], dim=1)
        light, fast, old = luminance(shift, lead), fast + shift, torch.cat([old[:, :lead] + move, old[:, lead:]], dim=1)
        moments = torch.cat([moments[:, :1] + light, moments[:, 1:] + light * (2 * moments[:, :1] + light)], dim=1)
        younger = torch.where(age > 1, 1 + (age - 1) * explained, age)
        share, age = share * age / younger.clamp_min(1e-6), younger
    length = torch.where(age > 0, torch.minimum(age + 1, longest.clamp_min(1.0)), torch.ones_like(age))
    light, alpha = luminance(sample, lead), 1 / length
    fresh = torch.cat([light, light * light], dim=1)
    after = [
        old + alpha * (sample - old),
        fast + alpha.clamp_min(1 - FAST_BLEND) * (sample[:, :lead] - fast),
        moments + alpha.clamp_min(1 - MOMENTS_BLEND) * (fresh - moments),
        share * (1 - alpha) ** 2 + alpha**2,
        length,
    ]
    return torch.cat(after, dim=1)


def trusted(grain: Tensor, length: Tensor) -> Tensor:
    """How far one sample tells light from shadow, ``(B, 1, H, W)`` in [0, 1]: little where samples are often dark.

    Args:
        grain: see `grain_of`.
        length: ``(B, 1, H, W)`` frames in the mean.
    """
    return 1 / (1 + (grain * length / SPECKLED) ** 3)


def grain_of(mean: Tensor, variance: Tensor, hit: Tensor) -> Tensor:
    """How much of the light is noise, wherever one looks around; 1 is `GRAINY`, squared.

    Much noise in a narrow band is that of a penumbra and does not count.

    Args:
        mean: ``(B, 3, H, W)`` accumulated light without albedo.
        variance: ``(B, 1, H, W)`` of its luminance.
        hit: ``(B, 1, H, W)`` bool.

    Returns:
        ``(B, 1, H, W)``, 0 where nothing was hit.
    """
    lit = hit.to(mean.dtype)
    noise, light = pooled(torch.cat([variance, luminance(mean)], dim=1), lit, AROUND).split(1, dim=1)
    grain = torch.where(hit, noise / (GRAINY * light).square().clamp_min(1e-8), torch.inf)
    return torch.where(hit, least(grain, WIDE), 0.0)


def shared_at_first(mean: Tensor, variance: Tensor, length: Tensor, hit: Tensor) -> Tensor:
    """Variance of the mean, that of pixels of one sample from the relative variance of such pixels around.

    That of a pixel and the few of its surface around it follows their samples: it is small where all of them happened
    to miss the light, and great where one met it, so that wavelets trust the one and not the other. Noise relative to
    the light hardly depends on the surface, so it is taken over a square; pixels of older, surer means do not count.

    Args:
        mean: ``(B, 3, H, W)`` accumulated light without albedo.
        variance: ``(B, 1, H, W)`` of its luminance.
        length: ``(B, 1, H, W)`` frames in the mean.
        hit: ``(B, 1, H, W)`` bool.

    Returns:
        ``(B, 1, H, W)``.
    """
    first = hit & (length < 2)
    if not (waits(length) or bool(first.any())):
        return variance
    count, light = first.to(mean.dtype), luminance(mean)
    noise, around = pooled(torch.cat([variance, light], dim=1), count, FIRST).split(1, dim=1)
    relative = noise / around.square().clamp_min(1e-8)
    return torch.where(first, relative * pooled(light, count).square(), variance)


def tolerated(
    variance: Tensor, grain: Tensor, length: Tensor, hit: Tensor, *, unsure: float = UNSURE, least: float = 0.0
) -> Tensor:
    """Variance of the mean as the wavelets are told it: exaggerated where it is uncertain, or much of the light.

    Where there is little noise, edges as weak as the noise are worth keeping. Where there is much all around, they
    would show as blotches, since the variance of few rare bright samples is itself uncertain.

    Args:
        variance: ``(B, 1, H, W)`` of the luminance of the mean.
        grain: see `grain_of`.
        length: ``(B, 1, H, W)`` frames in the mean.
        hit: ``(B, 1, H, W)`` bool.
        unsure: shares of the variance by which it is exaggerated in a mean of one frame; less in longer ones.
        least: share of the variance by which it is exaggerated everywhere: for wavelets whose light a regression fits,
            which may average over more noise before they lose gradients.

    Returns:
        ``(B, 1, H, W)``, nowhere below ``variance``.
    """
    short = (unsure / length.clamp_min(1.0)).clamp_min(least)
    return variance * (1 + torch.where(hit, torch.maximum(grain, short), 0.0))
