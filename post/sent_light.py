"""What each pixel sends to others: the light that screen-space global illumination gathers."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Frame
from post.bitmask import bitmask_ao
from post.reproject import reproject

SKY_DIRECTIONS = 2  # slices that find how much sky senders see: gathering averages their noise
SKY_COARSER = 2  # and they take so many times fewer taps


def sent_light(
    frame: Frame,
    *,
    distance: float | None = None,
    thickness: Tensor | float | None = None,
    steps: int = 12,
    bounces: int = 1,
    bounce_loss: float = 1.0,
) -> Tensor:
    """What each pixel sends to others: direct light, sky light that reaches it, and bounces that came before.

    Emission counts only where the frame has not sampled its emitters as direct light. The sky light is scaled by the
    sky that the pixel sees: from a coarse sweep over the whole picture, or from the frame's ``ao`` when light is
    gathered within a ``distance``.

    Args:
        frame: with radiance.
        distance: see `post.ssgi`.
        thickness: see `post.ssgi`.
        steps: see `post.ssgi`.
        bounces: 1 for direct and sky light alone; more adds the GI of the frame before, which over the frames becomes
            the sum of all bounces.
        bounce_loss: factor on the light of further bounces (the seed's composite: 0.6).

    Returns:
        ``(B, 3, H, W)`` outgoing linear radiance.

    Raises:
        ValueError: bounces is less than 1.
    """
    if bounces < 1:
        raise ValueError(f"bounces must be at least 1, got {bounces}")
    g, light = frame.gbuffer, frame.read("radiance")
    if frame.emitters_sampled and g.emission is not None:
        light = (light - g.emission).clamp_min(0)
    if frame.ambient is not None:
        light = light + frame.ambient * _sky_share(frame, distance, thickness, steps)
    previous = frame.previous
    if bounces > 1 and previous is not None and previous.gi is not None:
        light = light + bounce_loss * reproject(g, previous.gbuffer, search=False).fetch(previous.gi)
    return torch.where(g.hit, light, 0.0)


def _sky_share(frame: Frame, distance: float | None, thickness: Tensor | float | None, steps: int) -> Tensor | float:
    if distance is not None:
        return 1.0 if frame.ao is None else frame.ao
    g = frame.gbuffer
    coarse = max(steps // SKY_COARSER, 1)
    sweep = {"radius": None, "directions": SKY_DIRECTIONS, "steps": coarse, "soft": False}
    return bitmask_ao(g.depth, g.normal, g.camera, hit=g.hit, thickness=thickness, index=frame.index, **sweep)[0]
