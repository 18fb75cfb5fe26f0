"""Errors that a single picture cannot show: flicker between frames, and ghosting.

Pictures are ``(B, C, H, W)``, one a frame, with their G-buffers in the same order. A noisy truth comes as a pair of
independent halves: errors are then products of the differences from the two, so that its noise cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor

from gbufrt.gbuffer import GBuffer
from gbufrt.metrics.image import masked_mean
from gbufrt.sampling import inside, pixel_centers, sample

Truth = Tensor | tuple[Tensor, Tensor]

DEPTH_TOLERANCE = 0.02  # relative difference in view z up to which two frames show the same surface
GHOST_FRAMES = 4


def came_from(gbuffer: GBuffer) -> Tensor:
    """``(B, 2, H, W)`` px of each pixel's surface a frame ago; without a motion channel, its present px."""
    here = pixel_centers(gbuffer.depth)
    return here.expand(gbuffer.batch, -1, -1, -1) if gbuffer.motion is None else here + gbuffer.motion


def seen_before(gbuffer: GBuffer, previous: GBuffer) -> Tensor:
    """``(B, 1, H, W)`` bool: whether the surface, or sky, at each pixel was visible on screen a frame ago.

    The nearest pixel must have hit too, at the depth that the motion predicts, and on the same object; for the sky it
    must have missed.
    """
    px = came_from(gbuffer)
    there = inside(px, gbuffer.camera.size)
    hit = sample(previous.hit.to(px.dtype), px, mode="nearest") > 0.5
    expected = gbuffer.depth if gbuffer.motion_z is None else gbuffer.depth + gbuffer.motion_z
    found = sample(previous.depth, px, mode="nearest")
    same = (found - expected).abs() <= DEPTH_TOLERANCE * expected.abs()
    if gbuffer.object_id is not None and previous.object_id is not None:
        same &= sample(previous.object_id.to(px.dtype), px, mode="nearest").round() == gbuffer.object_id
    return there & torch.where(gbuffer.hit, hit & same, ~hit)


def frames_seen(gbuffers: Sequence[GBuffer]) -> Tensor:
    """``(B, 1, H, W)``: for how many frames the surfaces of the last frame have been on screen; 0 is disoccluded.

    A surface that was there in the first frame counts as many frames as there are.
    """
    age = torch.full_like(gbuffers[0].depth, 1e9)
    for before, now in pairwise(gbuffers):
        age = torch.where(seen_before(now, before), sample(age, came_from(now), mode="nearest") + 1, 0.0)
    return age.clamp_max(float(len(gbuffers)))


def flicker(pictures: Sequence[Tensor], gbuffers: Sequence[GBuffer], truth: Sequence[Truth] | None = None) -> Tensor:
    """RMS change from frame to frame along the motion, on static surfaces that stay on screen.

    Args:
        pictures: at least two.
        gbuffers: theirs. Where they have ``object_id``, static is what has 0; without, all is.
        truth: what the pictures should be; its own change is not flicker. By default nothing may change.

    Returns:
        ``(B,)`` in the pictures' unit; 0 where they change as the truth does. NaN where nothing stays on screen.

    Raises:
        ValueError: fewer than two pictures, or counts that differ.
    """
    if len(pictures) < 2 or len(gbuffers) != len(pictures) or (truth is not None and len(truth) != len(pictures)):
        raise ValueError(
            f"flicker needs at least two pictures and as many gbuffers (and truth), got {len(pictures)}, "
            f"{len(gbuffers)}" + ("" if truth is None else f" and {len(truth)}")
        )
    maps, masks = [], []
    for t in range(1, len(pictures)):
        g = gbuffers[t]
        change = _change(pictures[t], pictures[t - 1], g)
        true: Truth = torch.zeros_like(change)
        if truth is not None:
            (now, again), (before, earlier) = _pair(truth[t]), _pair(truth[t - 1])
            true = _change(now, before, g), _change(again, earlier, g)
        still = torch.ones_like(g.hit) if g.object_id is None else g.object_id == 0
        maps.append(_square(change, true))
        masks.append(g.hit & still & seen_before(g, gbuffers[t - 1]))
    return masked_mean(torch.cat(maps, dim=2), torch.cat(masks, dim=2)).clamp_min(0.0).sqrt()


def ghosting(
    picture: Tensor, truth: Truth, gbuffers: Sequence[GBuffer], *, fresh: Tensor | None = None,
    frames: int = GHOST_FRAMES,
) -> Tensor:  # fmt: skip
    """Error at pixels whose surface was disoccluded during the last ``frames`` frames.

    Args:
        picture: the last frame.
        truth: what it should be.
        gbuffers: of this frame and of those before it, at least ``frames`` + 1.
        fresh: the result of the same passes with a clean history; its error is not ghosting and is subtracted.
        frames: how many.

    Returns:
        ``(B,)`` RMSE in the picture's unit, with ``fresh`` the part beyond it; NaN where nothing was disoccluded.

    Raises:
        ValueError: too few G-buffers.
    """
    if len(gbuffers) <= frames:
        raise ValueError(f"gbuffers must hold at least {frames + 1} frames, got {len(gbuffers)}")
    new = gbuffers[-1].hit & (frames_seen(gbuffers) < frames)
    error = masked_mean(_square(picture, truth), new)
    if fresh is not None:
        error = error - masked_mean(_square(fresh, truth), new)
    return error.clamp_min(0.0).sqrt()


def _change(picture: Tensor, previous: Tensor, gbuffer: GBuffer) -> Tensor:
    return picture - sample(previous, came_from(gbuffer))


def _pair(truth: Truth) -> tuple[Tensor, Tensor]:
    return truth if isinstance(truth, tuple) else (truth, truth)


def _square(value: Tensor, truth: Truth) -> Tensor:
    """``(B, 1, H, W)``: squared error, averaged over the components."""
    one, other = _pair(truth)
    return ((value - one) * (value - other)).mean(1, keepdim=True)
