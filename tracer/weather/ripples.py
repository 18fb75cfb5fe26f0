"""Rings round raindrops on puddles and water, as slopes of the surface."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt.compute.resident import numbers
from tracer.texture import mix
from tracer.weather.noise import PRIMES, unit

CELL = 0.45  # world units a drop has to itself
LIFE = 0.55  # seconds from one drop of a cell to the next
WIDTH = 0.045  # world units from a ring's crest to where it has faded
STEEPEST = 0.687  # the most of sin(pi x) (1 - x x)^2
LAYERS = 3  # of cells, turned and shifted against each other


def ripple_slopes(points: Tensor, times: Tensor, level: float, pixels_per_unit: Tensor) -> Tensor:
    """Slopes of a level surface on which rain falls, 1 at the steepest.

    Every cell has one drop a life, at a place and a moment of its own, or none where it rains less. Its ring runs
    outward, fades with age, and ends inside the cell. Rings narrower than a pixel fade out, so that they do not alias.

    Args:
        points: ``(n, 2)`` x and z, world units.
        times: ``(n,)`` seconds.
        level: how hard it rains, 0 to 1.
        pixels_per_unit: ``(n,)`` how many pixels a world unit spans there, along the direction that spans fewest.

    Returns:
        ``(n, 2)`` slope along x and z.
    """
    slopes = torch.zeros_like(points)
    for layer in range(LAYERS):
        angle = 0.7 * layer
        c, s = math.cos(angle), math.sin(angle)
        turn = numbers(((c, -s), (s, c)), points)
        slopes = slopes + _layer(points @ turn + 17.3 * layer, times, level, layer) @ turn.T
    visible = (pixels_per_unit * WIDTH - 0.5).clamp(0.0, 1.0)
    return slopes * visible[:, None]


def _layer(points: Tensor, times: Tensor, level: float, layer: int) -> Tensor:
    cell = (points / CELL).floor()
    own = mix(cell[:, 0].long() * PRIMES[0] + cell[:, 1].long() * PRIMES[2] + layer)
    clock = times / LIFE + unit(own, points.dtype)
    drop = mix(own + clock.floor().long() * PRIMES[1])
    x, z, falls = (unit(mix(drop + k), points.dtype) for k in range(3))
    margin, most = 0.3, 0.3 * CELL - WIDTH  # of the cell: rings end inside it
    middle = (cell + margin + (1 - 2 * margin) * torch.stack([x, z], dim=-1)) * CELL
    away = points - middle
    distance = away.norm(dim=-1).clamp_min(1e-4)
    age = clock - clock.floor()
    beside = (distance - age * most) / WIDTH
    wave = -torch.sin(math.pi * beside) * (1 - beside * beside).clamp_min(0) ** 2 * (1 - age) / STEEPEST
    wave = wave * (distance / WIDTH).clamp_max(1.0)  # level in the middle
    wave = torch.where(falls < level, wave, 0.0)
    return (wave / distance)[:, None] * away
