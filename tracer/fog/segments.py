"""Parts of rays that lie in fog, how much light it lets through there, and where it turns light to."""

from __future__ import annotations

import math
from dataclasses import dataclass

from torch import Tensor

from gbufrt.directions import tangent_frame
from tracer.scene.fog import Fog


@dataclass(frozen=True, eq=False, kw_only=True)
class Segments:
    """Parts of rays through fog, ``(N, 3)`` and ``(N,)``: world space, unit directions, world units."""

    origins: Tensor
    directions: Tensor
    begin: Tensor
    end: Tensor

    def points(self, t: Tensor) -> Tensor:
        """``(N, 3)`` at distances ``(N,)`` from the origins."""
        return self.origins + self.directions * t[:, None]

    def entry(self) -> tuple[Tensor, Tensor]:
        """Height where each begins, and its rise a unit."""
        return self.points(self.begin)[:, 1], self.directions[:, 1]

    def length(self) -> Tensor:
        """World units; none where the end comes first."""
        return (self.end - self.begin).clamp_min(0)

    def of(self, chosen: Tensor | slice) -> Segments:
        """Those of an index."""
        fields = (self.origins, self.directions, self.begin, self.end)
        origins, directions, begin, end = (t[chosen] for t in fields)
        return Segments(origins=origins, directions=directions, begin=begin, end=end)


def phase(fog: Fog, cosine: Tensor) -> Tensor:
    """Share of light that is scattered into a steradian, by the cosine of the angle that it turns.

    Source: Henyey and Greenstein 1941.
    """
    g = fog.anisotropy
    return (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * cosine).clamp_min(1e-9) ** 1.5)


def phase_direction(fog: Fog, directions: Tensor, u: Tensor) -> Tensor:
    """``(N, 3)`` from where light comes that turns into ``-directions``, as often as `phase` says.

    Args:
        fog: that scatters.
        directions: ``(N, 3)`` unit length, from the eye into the fog.
        u: ``(2, N)`` in [0, 1).
    """
    g = fog.anisotropy
    x = (1 - g * g) / (1 - g + 2 * g * u[0])
    cosine = (1 + g * g - x * x) / (2 * g) if abs(g) > 1e-3 else 1 - 2 * u[0]
    cosine = cosine.clamp(-1, 1)[:, None]
    sine, angle = (1 - cosine * cosine).sqrt(), 2 * math.pi * u[1, :, None]
    across, other = tangent_frame(directions)
    return across * (sine * angle.cos()) + other * (sine * angle.sin()) + directions * cosine


def passes(fog: Fog, segments: Segments) -> Tensor:
    """``(N,)``: the share of light that fog lets through."""
    return (-fog.depth(*segments.entry(), segments.length())).exp()
