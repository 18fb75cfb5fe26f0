"""Sample points for integrals over paths: stratified over the samples, well spread over the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import torch
from torch import Tensor
from torch.quasirandom import SobolEngine

from gbufrt.noise.noise import TILE, blue_noise
from gbufrt.numeric import check_counts

BELOW_ONE = 1 - 2**-24


@dataclass(frozen=True, eq=False, kw_only=True)
class Sequence:
    """One Owen-scrambled Sobol sequence, rotated at each pixel by blue noise.

    Scrambling makes every mean unbiased over the seeds. The sequence makes the error fall faster than with random
    points. The rotation distributes the remaining error over the pixels as blue noise.

    Args:
        points: ``(S, D)`` in [0, 1).
        rotation: ``(D, T)`` in [0, 1), of the T pixels of a tile that repeats over the picture.
        places: ``(H * W,)`` int64, which of them each pixel has.
    """

    points: Tensor
    rotation: Tensor
    places: Tensor

    @staticmethod
    def of(samples: int, dims: int, size: tuple[int, int], *, seed: int, device: torch.device) -> Sequence:
        """A sequence of ``samples`` points of ``dims`` numbers, for a picture of ``size`` ``(H, W)``.

        The last one is kept: all layers of a film's frames have the same.
        """
        check_counts(samples=samples, seed=seed)
        return _sequence(int(samples), int(dims), size, int(seed), device)

    def part(self, numbers: range) -> Sequence:
        """Some of the points."""
        return replace(self, points=self.points[numbers.start : numbers.stop])

    def dims(self, first: int, end: int | None = None) -> Sequence:
        """Some of the numbers of each point."""
        return replace(self, points=self.points[:, first:end], rotation=self.rotation[first:end])

    @property
    def turns(self) -> Tensor:
        """``(D, H * W)``, the rotation at every pixel."""
        return self.rotation[:, self.places]

    def draw(self, pixels: Tensor) -> Tensor:
        """``(D, S * n)`` in [0, 1): the points at n pixels, the first at all of them, then the second at all."""
        points = self.points.T[:, :, None]
        return ((points + self.rotation[:, None, self.places[pixels]]) % 1.0).clamp_max(BELOW_ONE).flatten(1)


@lru_cache(maxsize=1)
def _sequence(samples: int, dims: int, size: tuple[int, int], seed: int, device: torch.device) -> Sequence:
    height, width = tile = min(size[0], TILE), min(size[1], TILE)
    with torch.inference_mode(False), torch.no_grad():
        rows, columns = (torch.arange(n, device=device) for n in size)
        points = SobolEngine(dims, scramble=True, seed=seed).draw(samples).clamp_max(BELOW_ONE).to(device)
        rotation = blue_noise(*tile, dims=dims, seed=seed, device=device).flatten(1)
        places = rows[:, None] % height * width + columns % width
    return Sequence(points=points, rotation=rotation, places=places.flatten())


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
