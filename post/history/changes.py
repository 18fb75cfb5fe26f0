"""Follow changes of light that stand out from noise over a wide piece of a surface.

Over few pixels one bright sample of a long-tailed distribution looks like a change, and a history that begins anew
there shows as a spot, while a change that is weaker than the noise is missed. Over a wide area such samples average
out, and so does noise.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from post.filters.constants import COARSE_POWER, HIT
from post.filters.edges import Surface
from post.filters.op import wavelet
from post.history.constants import FAST_BLEND
from post.history.op import Sample, unexplained

AREA = 2  # wavelets over which changes are averaged: they reach 6 pixels to each side, as small shadows do
FAST_FRAMES = (1 + FAST_BLEND) / (1 - FAST_BLEND)  # of as many a plain mean has the noise of the fast history
STRICTER = 1.5  # than `clamp` in `post.temporal`: the noise of neighbours may be correlated


class Changes(NamedTuple):
    """How the light of histories has changed, see `post.history.op.unexplained`."""

    fast: Tensor
    slow: Tensor


def follow_changes(sample: Sample, state: Tensor, geometry: Surface, *, lead: int, clamp: float) -> Changes:
    """Find by how much to draw the fast history toward the frame, and the slow one toward the fast.

    Args:
        sample: of `post.history.op.taken_in`.
        state: ``(B, C + lead + 4, H, W)``, see there.
        geometry: of this frame.
        lead: number of leading channels that are compared.
        clamp: as in `post.temporal`.
    """
    old, fast, age = state[:, :lead], state[:, -lead - 4 : -4], state[:, -1:]
    known, none, few = (age > 0).to(age.dtype), torch.zeros_like(age), 1 / age.clamp(1.0, FAST_FRAMES)
    guide = torch.cat([geometry.guide[:, :HIT], geometry.guide[:, HIT : HIT + 1] * known], dim=1)
    surface = replace(geometry, guide=guide)

    def change(difference: Tensor, frames: Tensor, slow: bool) -> Tensor:
        planes = torch.cat([difference, none, sample.noise * frames], dim=1)
        averaged = _averaged(planes, surface, AREA, none)
        return unexplained(averaged, state, lead=lead, clamp=STRICTER * clamp, slow=slow)

    first = change(sample.signal[:, :lead] - fast, 1 + few, slow=False)
    return Changes(first, change(fast + first[:, :lead] - old, few + 1 / age.clamp_min(1.0), slow=True))


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
    none = torch.zeros_like(variance)  # no luminance to compare: only geometry weighs
    reach = none if reach is None else reach
    values = _averaged(torch.cat([planes, none, variance], dim=1), geometry, iterations, reach)
    return values[:, :-2], values[:, -1:]


def _averaged(values: Tensor, geometry: Surface, iterations: int, reach: Tensor) -> Tensor:
    """Planes, nothing, and the variance of their noise, averaged over the surface."""
    for iteration in range(iterations):
        values = wavelet(
            values, geometry, reach, step=2**iteration, phi_color=1.0, phi_depth=1.0, phi_normal=COARSE_POWER
        )
    return values
