"""Fixed stars, as a camera shows them: points of light on a sphere that turns."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor

CELLS = 48  # along each side of a cube's faces; each holds one star or none
FILLED = 0.35  # of the cells: some five thousand stars, as the eye sees on a clear night
FAINTEST = 2e-9  # irradiance; brighter stars are fewer, as the power -3/2 of it
BRIGHTEST = 300.0  # over the faintest
MARGIN = 0.15  # of a cell that holds no star's centre, so that no star is cut


def stars(directions: Tensor, turned: Tensor, pixel: Tensor) -> Tensor:
    """Radiance of stars, each spread over about a pixel, so that none flickers when the camera moves.

    Args:
        directions: ``(B, 3, ...)`` world space, unit length.
        turned: ``(3, 3)`` from world space to the sphere of the stars.
        pixel: ``()`` radians that a pixel of the camera covers.

    Returns:
        ``(B, 3, ...)`` linear radiance.
    """
    way = torch.einsum("ij,bj...->bi...", turned.to(directions), directions)
    size, axis = way.abs().max(dim=1, keepdim=True)
    across, up = (way.gather(1, (axis + k) % 3) / size.clamp_min(1e-9) for k in (1, 2))
    face = axis * 2 + (way.gather(1, axis) > 0)
    column, row = (((v.atan() * (4 / math.pi) + 1) * (CELLS / 2)).clamp(0, CELLS - 1e-3) for v in (across, up))
    number = (face * CELLS + row.long()) * CELLS + column.long()
    shown, x, y, flux, warmth = (_random(number, k) for k in range(5))
    center = [MARGIN + (1 - 2 * MARGIN) * v for v in (x, y)]
    place = [
        (((v.floor() + c) * (2 / CELLS) - 1) * (math.pi / 4)).tan() for v, c in zip((column, row), center, strict=True)
    ]
    star = torch.stack([torch.ones_like(place[0]), *place], dim=1)
    seen = torch.stack([torch.ones_like(across), across, up], dim=1)
    off = (F.normalize(star, dim=1) - F.normalize(seen, dim=1)).square().sum(dim=1)
    width = (0.55 * pixel).clamp_min(1e-4)
    spread = torch.exp(-off / (2 * width * width)) / (2 * math.pi * width * width)
    bright = FAINTEST * flux.clamp_min(BRIGHTEST**-1.5) ** (-2 / 3)
    color = torch.cat([0.8 + 0.4 * warmth, torch.ones_like(warmth), 1.2 - 0.4 * warmth], dim=1)
    return torch.where(shown < FILLED, bright * spread, 0.0) * color


def _random(number: Tensor, stream: int) -> Tensor:
    """A number in [0, 1) for each cell. Source: Jarzynski and Olano 2020 (PCG hash)."""
    state = ((number * 5 + stream) * 747796405 + 2891336453) & 0xFFFFFFFF
    word = ((((state >> ((state >> 28) + 4)) ^ state) & 0xFFFFFFFF) * 277803737) & 0xFFFFFFFF
    return (((word >> 22) ^ word) & 0xFFFFFF).to(torch.float32) / 0x1000000
