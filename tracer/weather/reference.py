"""Where rays meet waves, in plain torch: the definition, and the reference of `tracer.weather.kernel`."""

from __future__ import annotations

import torch
from torch import Tensor

from tracer.weather.water import Water

STEPS = 256
CLOSE, CLOSE_RELATIVE = 1e-4, 2e-6  # world units over the wave where a ray has met it, and part of the distance


def meet(water: Water, origins: Tensor, directions: Tensor, t: Tensor, end: Tensor) -> Tensor:
    """Where rays that enter still water meet the wave.

    Steps are as long as no slope of the waves can make them pass it.

    Args:
        water: with waves.
        origins: ``(n, 3)`` world space.
        directions: ``(n, 3)`` unit length, downward.
        t: ``(n,)`` where they enter.
        end: ``(n,)`` where they come to something else.

    Returns:
        ``(n,)`` the distance, ``end`` if that comes first.

    Source: Hart 1996.
    """
    found = t.clone()
    mean = (origins[:, 1] + directions[:, 1] * t).round() - water.waves.amplitude
    left = torch.arange(len(t), device=t.device)
    for _ in range(STEPS):
        if len(left) == 0:
            break
        o, d, now = origins[left], directions[left], found[left]
        points = o + d * now[:, None]
        gap = points[:, 1] - mean[left] - water.height(points[:, [0, 2]])
        steep = water.steepest(water.away(points[:, [0, 2]]))
        closing = d[:, 0].abs() * steep[0] + d[:, 2].abs() * steep[1] - d[:, 1]
        now = torch.minimum(now + (gap / closing).clamp_min(0), end[left])
        found[left] = now
        left = left[(gap > CLOSE + CLOSE_RELATIVE * now) & (now < end[left])]
    return found
