"""Smooth noise in space, as puddles and waves are made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.compute.resident import number
from tracer.texture import mix

PRIMES = (73856093, 19349663, 83492791)  # Teschner et al. 2003
MOST = 0xFFFFFFFF
SIDE = 256  # cells after which a lattice repeats: a power of two


def noise3(points: Tensor, *, seed: int = 0) -> Tensor:
    """Value noise: random numbers at whole coordinates, blended between them with continuous second derivatives.

    Args:
        points: ``(..., 3)``.
        seed: another seed, another noise.

    Returns:
        ``(...)`` in [0, 1], with mean 0.5.

    Source: Perlin 2002 for the blend.
    """
    corner = points.floor()
    x, y, z = (points - corner).unbind(dim=-1)
    hashes = [_hashes(corner[..., k].long(), PRIMES[k]) for k in range(3)]
    u, v, w = fade(x), fade(y), fade(z)

    def at(i: int, j: int, k: int) -> Tensor:
        return unit(mix(hashes[0][i] + hashes[1][j] + hashes[2][k] + seed), points.dtype)

    def row(j: int, k: int) -> Tensor:
        return torch.lerp(at(0, j, k), at(1, j, k), u)

    return torch.lerp(torch.lerp(row(0, 0), row(1, 0), v), torch.lerp(row(0, 1), row(1, 1), v), w)


def fade(t: Tensor) -> Tensor:
    """From 0 at 0 to 1 at 1, with no slope and no curvature there."""
    return t * t * t * (t * (t * 6 - 15) + 10)


def unit(bits: Tensor, dtype: torch.dtype) -> Tensor:
    """32 bits as a number in [0, 1]."""
    return bits.to(dtype) / MOST


def _hashes(cell: Tensor, prime: int) -> tuple[Tensor, Tensor]:
    return cell * prime, (cell + 1) * prime


@dataclass(frozen=True, eq=False, kw_only=True)
class Lattice:
    """A slice of `noise3`, for many look-ups: random numbers at whole coordinates that repeat.

    Args:
        numbers: ``(SIDE * SIDE,)``.
    """

    numbers: Tensor

    @staticmethod
    def of(third: float, device: torch.device | str) -> Lattice:
        """The slice at a third coordinate."""
        slow = math.floor(third)
        cells = torch.arange(SIDE, device=device)
        flat = cells[:, None] * PRIMES[0] + cells * PRIMES[1]
        before, after = (unit(mix(flat + (slow + k) * PRIMES[2]), torch.float32) for k in range(2))
        share = fade(number(third - slow, before))
        return Lattice(numbers=torch.lerp(before, after, share).flatten())

    def value(self, places: Tensor) -> Tensor:
        """``(...)`` in [0, 1] at ``(..., 2)``."""
        (a, b, c, d), u, v = self._corners(places)
        return torch.lerp(torch.lerp(a, b, fade(v)), torch.lerp(c, d, fade(v)), fade(u))

    def slopes(self, places: Tensor) -> Tensor:
        """``(..., 2)`` derivatives of the value."""
        (a, b, c, d), u, v = self._corners(places)
        first = torch.lerp(c - a, d - b, fade(v)) * _faded(u)
        second = torch.lerp(b - a, d - c, fade(u)) * _faded(v)
        return torch.stack([first, second], dim=-1)

    def curvatures(self, places: Tensor) -> tuple[Tensor, Tensor]:
        """``(..., 2)`` derivatives of the value, and the second ones ``(..., 3)``: by the first, both, the second."""
        (a, b, c, d), u, v = self._corners(places)
        across, along = torch.lerp(c - a, d - b, fade(v)), torch.lerp(b - a, d - c, fade(u))
        bends = torch.stack([across * _bent(u), (d - c - b + a) * _faded(u) * _faded(v), along * _bent(v)], dim=-1)
        return torch.stack([across * _faded(u), along * _faded(v)], dim=-1), bends

    def _corners(self, places: Tensor) -> tuple[list[Tensor], Tensor, Tensor]:
        corner = places.floor()
        u, v = (places - corner).unbind(dim=-1)
        i, j = corner.long().unbind(dim=-1)
        rows, columns = (((i + k) & SIDE - 1) * SIDE for k in range(2)), [(j + k) & SIDE - 1 for k in range(2)]
        return [self.numbers[row + column].to(u.dtype) for row in rows for column in columns], u, v


def _faded(t: Tensor) -> Tensor:
    """The slope of `fade`."""
    return 30 * t * t * (t * (t - 2) + 1)


def _bent(t: Tensor) -> Tensor:
    """The second derivative of `fade`."""
    return 60 * t * (t - 1) * (2 * t - 1)
