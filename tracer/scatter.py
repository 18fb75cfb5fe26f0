"""How surfaces scatter light: Lambert's diffuse share and a GGX specular share, on rows ``(N, 3)`` in world space."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Inner product ``(N,)`` of rows ``(N, 3)``."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def frame(normals: Tensor) -> tuple[Tensor, Tensor]:
    """Two unit vectors ``(N, 3)`` that make a right-handed frame with unit ``normals``.

    Source: Duff et al. 2017.
    """
    x, y, z = normals.unbind(1)
    sign = torch.where(z >= 0, 1.0, -1.0).to(normals)
    a = -1 / (sign + z)
    b = x * y * a
    across = torch.stack([1 + sign * x * x * a, sign * b, -sign * x], dim=1)
    return across, torch.stack([b, sign + y * y * a, -y], dim=1)


def cosine_direction(normals: Tensor, u: Tensor) -> Tensor:
    """Directions ``(N, 3)`` above ``normals``, with density cosine / pi, from numbers ``(2, N)`` in [0, 1)."""
    across, other = frame(normals)
    angle, square = 2 * math.pi * u[1], u[0]
    radius = square.sqrt()
    parts = ((across, radius * angle.cos()), (other, radius * angle.sin()), (normals, (1 - square).sqrt()))
    return sum((axis * part[:, None] for axis, part in parts), torch.zeros_like(normals))
