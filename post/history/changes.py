"""Follow changes of light that stand out from noise over a wide piece of a surface.

Over few pixels one bright sample of a long-tailed distribution looks like a change, and a history that begins anew
there shows as a spot, while a change that is weaker than the noise is missed. Over a wide area such samples average
out, and so does noise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import GBuffer
from post.filters.constants import COARSE_POWER
from post.filters.edges import Surface
from post.filters.op import wavelet
from post.filters.surfaces import surface
from post.history.constants import FAST_BLEND
from post.history.op import Sample, unexplained

AREA = 2  # wavelets over which changes are averaged: they reach 6 pixels to each side, as small shadows do
FAST_FRAMES = (1 + FAST_BLEND) / (1 - FAST_BLEND)  # of as many a plain mean has the noise of the fast history
STRICTER = 1.5  # than `clamp` in `post.temporal`: the noise of neighbours may be correlated


class Changes(NamedTuple):
    """How the light of histories has changed, see `post.history.op.unexplained`."""

    fast: Tensor
    slow: Tensor


def follow_changes(
    sample: Sample, state: Tensor, gbuffer: GBuffer, *, lead: int, clamp: float, roughness: Tensor | None = None
) -> Changes:
    """Find by how much to draw the fast history toward the frame, and the slow one toward the fast.

    Args:
        sample: of `post.history.op.taken_in`.
        state: ``(B, C + lead + 4, H, W)``, see there.
        gbuffer: of this frame.
        lead: number of leading channels that are compared.
        clamp: as in `post.temporal`.
        roughness: ``(B, 1, H, W)`` if surfaces are told apart by it.
    """
    old, fast, age = state[:, :lead], state[:, -lead - 4 : -4], state[:, -1:]
    none, known = torch.zeros_like(age), gbuffer.hit & (age > 0)
    geometry = surface(gbuffer.depth, gbuffer.normal, known, gbuffer.camera, roughness)

    def apart(difference: Tensor, longest: float) -> Tensor:  # whose caller holds no more than it while wavelets run
        few = 1 / age.clamp(1.0, FAST_FRAMES)
        frames = few + 1 / age.clamp(1.0, longest)
        return torch.cat([difference, none, sample.noise * frames], dim=1)

    def moved(averaged: Tensor, slow: bool) -> Tensor:
        return unexplained(averaged, state, lead=lead, clamp=STRICTER * clamp, slow=slow)

    first = moved(_averaged(apart(sample.signal[:, :lead] - fast, 1.0), geometry, AREA, none), slow=False)
    difference = _averaged(apart(fast + first[:, :lead] - old, math.inf), geometry, AREA, none)
    return Changes(first, moved(difference, slow=True))


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
