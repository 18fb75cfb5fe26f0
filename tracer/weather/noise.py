"""Smooth noise in space, as puddles and waves are made of."""

from __future__ import annotations

import torch
from torch import Tensor

from tracer.texture import mix

PRIMES = (73856093, 19349663, 83492791)  # Teschner et al. 2003
MOST = 0xFFFFFFFF


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


def unit(number: Tensor, dtype: torch.dtype) -> Tensor:
    """32 bits as a number in [0, 1]."""
    return number.to(dtype) / MOST


def _hashes(cell: Tensor, prime: int) -> tuple[Tensor, Tensor]:
    return cell * prime, (cell + 1) * prime
