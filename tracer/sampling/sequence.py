"""Sample points for integrals over paths: stratified over the samples, well spread over the picture."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.quasirandom import SobolEngine

from gbufrt.noise.noise import blue_noise

BELOW_ONE = 1 - 2**-24


@dataclass(frozen=True, eq=False, kw_only=True)
class Sequence:
    """One Owen-scrambled Sobol sequence, rotated at each pixel by blue noise.

    Scrambling makes every mean unbiased over the seeds. The sequence makes the error fall faster than with random
    points. The rotation distributes the remaining error over the pixels as blue noise.

    Args:
        points: ``(S, D)`` in [0, 1).
        rotation: ``(D, H * W)`` in [0, 1).
    """

    points: Tensor
    rotation: Tensor

    @staticmethod
    def of(samples: int, dims: int, size: tuple[int, int], *, seed: int, device: torch.device) -> Sequence:
        """A sequence of ``samples`` points of ``dims`` numbers, for a picture of ``size`` ``(H, W)``."""
        points = SobolEngine(dims, scramble=True, seed=seed).draw(samples)
        rotation = blue_noise(*size, dims=dims, seed=seed, device=device).flatten(1)
        return Sequence(points=points.clamp_max(BELOW_ONE).to(device), rotation=rotation)

    def part(self, numbers: range) -> Sequence:
        """Some of the points."""
        return Sequence(points=self.points[numbers.start : numbers.stop], rotation=self.rotation)

    def dims(self, first: int, end: int | None = None) -> Sequence:
        """Some of the numbers of each point."""
        return Sequence(points=self.points[:, first:end], rotation=self.rotation[first:end])

    def draw(self, pixels: Tensor) -> Tensor:
        """``(D, S * n)`` in [0, 1): the points at n pixels, the first at all of them, then the second at all."""
        points = self.points.T[:, :, None]
        return ((points + self.rotation[:, None, pixels]) % 1.0).clamp_max(BELOW_ONE).flatten(1)


def disc(u: Tensor) -> Tensor:
    """Map the unit square ``(2, N)`` onto the unit disc: area-preserving and continuous.

    Source: Shirley and Chiu 1997.
    """
    a, b = 2 * u[0] - 1, 2 * u[1] - 1
    wide = a.abs() > b.abs()
    radius = torch.where(wide, a, b)
    ratio = torch.where(wide, b, a) / torch.where(radius == 0, 1.0, radius)
    angle = torch.where(wide, torch.pi / 4 * ratio, torch.pi / 2 - torch.pi / 4 * ratio)
    return torch.stack([radius * angle.cos(), radius * angle.sin()])
