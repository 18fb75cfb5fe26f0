"""Outgoing light of each pixel, which gathered and marched GI and reflections find on screen."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from gbufrt import Frame
from gbufrt.compute.resident import waits
from gbufrt.numeric import check_between, check_counts
from post.history.read import read_history
from post.sweep.bitmask import bitmask_ao

SKY_DIRECTIONS = 1  # slices for the sky visibility of senders: gathering averages their noise
SKY_COARSER = 2  # factor by which they take fewer taps
TYPICAL_REFLECTANCE = 0.3  # of a scene, to convert a number of bounces to a gain of endless feedback
BRIGHTEST = 0.9  # greatest ratio of a bounce's light to that of the bounce before


def gathered_radiance(frame: Frame) -> Tensor:
    """Radiance ``(B, 3, H, W)`` that diffuse light may gather: emission counts only if emitters were not sampled."""
    return _without_emission(frame, known=frame.emitters_sampled)


def _without_emission(frame: Frame, *, known: bool) -> Tensor:
    """Radiance, less emission where the frame holds all that it sends already."""
    light, emission = frame.read("radiance"), frame.gbuffer.emission
    return (light - emission).clamp_min_(0) if known and emission is not None else light


def sent_light(
    frame: Frame,
    *,
    distance: float | Tensor | None = None,
    thickness: Tensor | float | None = None,
    steps: int = 12,
    bounces: int = 1,
    bounce_loss: float = 1.0,
) -> Tensor:
    """Light that each pixel sends to others: direct light, visible sky light, and earlier bounces.

    Emission counts only if the frame has not sampled its emitters as direct light. The sky light is scaled by the
    pixel's sky visibility: that of the previous frame, or where it did not show the surface that of a coarse sweep over
    the whole picture; when light is gathered within a ``distance``, the frame's ``ao``.

    Args:
        frame: with radiance.
        distance: see `post.ssgi`.
        thickness: see `post.ssgi`.
        steps: see `post.ssgi`.
        bounces: 1 for direct and sky light alone; more adds the previous frame's GI, which over the frames becomes the
            sum of all bounces.
        bounce_loss: factor on the light of further bounces (0.6 in ME1's composite).

    Returns:
        ``(B, 3, H, W)`` outgoing linear radiance.

    Raises:
        TypeError: bounces is no whole number, or bounce_loss no number.
        ValueError: bounces is less than 1, or bounce_loss negative.
    """
    check_counts(bounces=bounces)
    check_between(0, math.inf, bounce_loss=bounce_loss)
    if bounces < 1:
        raise ValueError(f"bounces must be at least 1, got {bounces}")
    g, light, previous = frame.gbuffer, gathered_radiance(frame), frame.previous
    gi = previous.gi if bounces > 1 and previous is not None else None
    sky = previous.sky_visibility if frame.ambient is not None and distance is None and previous is not None else None
    known, valid = None, torch.zeros_like(g.hit)
    kept = [signal for signal in (gi, sky) if signal is not None]
    if previous is not None and kept:
        found = read_history(g, previous.gbuffer, torch.cat(kept, dim=1), search=False)
        known, valid = found.image, found.valid
    if frame.ambient is not None:
        share = None if sky is None or known is None else known[:, -1:]
        new = g.hit if share is None else g.hit & ~valid
        if share is None or waits(new) or bool(new.any()):
            swept = _sky_share(frame, distance, thickness, steps, new)
            share = swept if share is None else torch.where(valid, share, swept)
        light = torch.addcmul(light, frame.ambient, share)
    if gi is not None and known is not None:
        light = light + bounce_loss * known[:, :3]
    return torch.where(g.hit, light, 0.0)


def feedback_gain(bounces: int) -> float:
    """Factor on the last frame's bounced light with which endless feedback sums to ``bounces``.

    Args:
        bounces: 1 or more; exact where surfaces reflect `TYPICAL_REFLECTANCE` of incoming light.

    Returns:
        0 for one bounce, toward 1 for many.

    Raises:
        TypeError: bounces is no whole number.
        ValueError: bounces is below 1.
    """
    check_counts(bounces=bounces)
    if bounces < 1:
        raise ValueError(f"bounces must be at least 1, got {bounces}")
    total = (1 - TYPICAL_REFLECTANCE**bounces) / (1 - TYPICAL_REFLECTANCE)
    return (1 - 1 / total) / TYPICAL_REFLECTANCE


def bounce_light(frame: Frame, *, bounces: int = 1) -> Tensor:
    """Light that each surface sends to others: direct light, visible sky light, and last frame's bounced light.

    Emitters that the renderer has sampled as direct light (``frame.emitters_sampled``) do not count again.

    Args:
        frame: needs ``radiance``; ``emission``, ``ambient``, ``ao`` and ``previous.gi`` count if present.
        bounces: 1 leaves out last frame's light; see `feedback_gain`.

    Returns:
        ``(B, 3, H, W)`` linear radiance.
    """
    light, gain = _with_visible_sky(frame, gathered_radiance(frame)), feedback_gain(bounces)
    previous = frame.previous
    if gain > 0 and previous is not None and previous.gi is not None:
        light = light + gain * read_history(frame.gbuffer, previous.gbuffer, previous.gi).image.to(light)
    return light


def outgoing_light(frame: Frame) -> Tensor:
    """Known outgoing light of each surface: direct light, visible sky light, and bounced light.

    Emission that the frame's mirrors show already (``frame.emitters_mirrored``) does not count again.

    Args:
        frame: needs ``radiance``; ``ambient``, ``sky_visibility`` or ``ao``, and ``gi`` count if present.

    Returns:
        ``(B, 3, H, W)`` linear radiance.
    """
    light = _with_visible_sky(frame, _without_emission(frame, known=frame.emitters_mirrored))
    return light if frame.gi is None else light + frame.gi


def _with_visible_sky(frame: Frame, light: Tensor) -> Tensor:
    visibility = frame.ao if frame.sky_visibility is None else frame.sky_visibility
    if frame.ambient is not None:
        one = light.new_ones(()) if visibility is None else visibility
        light = torch.addcmul(light, frame.ambient, one)
    return light


def nothing_before(frame: Frame) -> Tensor:
    """``(B, 1, 1, 1)`` bool: whether there is no previous frame's bounced light to continue from."""
    lone = frame.previous is None or frame.previous.gi is None
    new = torch.full((frame.gbuffer.batch,), lone, device=frame.gbuffer.depth.device)
    return (new if frame.cut is None else new | frame.cut.to(new.device))[:, None, None, None]


def starts(frame: Frame) -> bool:
    """Whether `nothing_before` holds anywhere. Only a frame that says whether it is a `cut` asks a GPU."""
    lone = frame.previous is None or frame.previous.gi is None
    return lone or (frame.cut is not None and bool(frame.cut.any()))


def all_bounces(once: Tensor, further: Callable[[Tensor], Tensor], bounces: int) -> Tensor:
    """Limit of all bounces: ``bounces`` are gathered, and the rest are extrapolated from the ratio of the last two.

    Args:
        once: ``(B, 3, H, W)`` with one bounce.
        further: maps the light so far to that with one bounce more.
        bounces: at least 2.
    """
    light, last, before = once, once, once
    for _ in range(bounces - 1):
        more = further(light)
        light, last, before = more, more - light, last
    ratio = last.sum((2, 3), keepdim=True) / before.sum((2, 3), keepdim=True).clamp_min(1e-9)
    return light - last + last / (1 - ratio.clamp(0.0, BRIGHTEST))


def _sky_share(
    frame: Frame, distance: float | Tensor | None, thickness: Tensor | float | None, steps: int, where: Tensor
) -> Tensor:
    """Visibility of the sky at the pixels ``where`` it is wanted; others may get any."""
    if distance is not None:
        return torch.ones_like(frame.gbuffer.depth) if frame.ao is None else frame.ao
    g = frame.gbuffer
    coarse = max(steps // SKY_COARSER, 1)
    sweep = {"radius": None, "directions": SKY_DIRECTIONS, "steps": coarse, "where": where}
    return bitmask_ao(g.depth, g.normal, g.camera, hit=g.hit, thickness=thickness, index=frame.index, **sweep)[0]
