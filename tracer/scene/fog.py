"""Fog: a medium that scatters light, even everywhere or thinner with height."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.numeric import check_numbers, check_three

SERIES = 1e-3  # exponents below which a series is exact in float32
STEEPEST = 60.0  # exponents beyond it overflow


@dataclass(frozen=True, eq=False, kw_only=True)
class Fog:
    """A medium between camera and surfaces. It scatters light once; light on its way to surfaces it leaves as it is.

    Args:
        extinction: share of light that is lost over a short way at height ``base``, per world unit.
        albedo: share of that which is scattered and not absorbed, linear RGB.
        anisotropy: mean cosine of the scattering angle, -1 to 1: 0 scatters to all sides, more goes on forward.
        falloff: per world unit of height, by which ``exp(-falloff * height)`` thins it; 0 is even.
        base: height at which it has its ``extinction``, world units.

    Raises:
        TypeError: what must be a number is none.
        ValueError: a number outside its range.
    """

    extinction: float
    albedo: tuple[float, float, float] = (0.95, 0.95, 0.95)
    anisotropy: float = 0.6
    falloff: float = 0.0
    base: float = 0.0

    def __post_init__(self) -> None:
        check_three("albedo", self.albedo, "fog")
        check_numbers(**{name: getattr(self, name) for name in ("extinction", "anisotropy", "falloff", "base")})
        if not 0.0 <= self.extinction < math.inf:
            raise ValueError(f"extinction must be at least 0 per world unit, got {self.extinction}")
        if not all(0.0 <= share <= 1.0 for share in self.albedo):
            raise ValueError(f"albedo must be three shares in 0..1, got {self.albedo}")
        if not -1.0 < self.anisotropy < 1.0:
            raise ValueError(f"anisotropy must lie between -1 and 1, got {self.anisotropy}")
        if not 0.0 <= self.falloff < math.inf:
            raise ValueError(f"falloff must be at least 0 per world unit, got {self.falloff}")
        if not math.isfinite(self.base):
            raise ValueError(f"base must be finite, got {self.base}")

    def depth(self, height: Tensor, rise: Tensor, distance: Tensor) -> Tensor:
        """Optical depth over a ``distance`` from ``height`` on, along rays that rise by ``rise`` a unit; any shapes."""
        return self.density(height) * distance * _thinned(self.falloff * rise * distance)

    def distance(self, height: Tensor, rise: Tensor, depth: Tensor) -> Tensor:
        """The inverse of `depth`: the distance over which it adds up."""
        even = depth / self.density(height).clamp_min(1e-30)
        x = (self.falloff * rise * even).clamp_max(1 - 1e-6)
        bend = torch.where(x.abs() < SERIES, 1 + x / 2, -torch.log1p(-x) / torch.where(x == 0, 1.0, x))
        return even * bend

    def density(self, height: Tensor) -> Tensor:
        """Extinction a world unit at heights of any shape."""
        return self.extinction * (-self.falloff * (height - self.base)).clamp(-STEEPEST, STEEPEST).exp()


def _thinned(x: Tensor) -> Tensor:
    """``(1 - exp(-x)) / x``."""
    x = x.clamp_min(-STEEPEST)
    return torch.where(x.abs() < SERIES, 1 - x / 2, -torch.expm1(-x) / torch.where(x == 0, 1.0, x))
