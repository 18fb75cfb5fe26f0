"""Points on rectangles, uniform in solid angle: sampling near ones by area would be noisy."""

from __future__ import annotations

import torch
from torch import Tensor

from tracer.sampling.scatter import dot

FLATTEST = 1e-5  # world units above a rectangle's plane, below which it counts as edge-on


def rectangle_points(
    points: Tensor, corner: Tensor, edge_u: Tensor, edge_v: Tensor, u: Tensor
) -> tuple[Tensor, Tensor]:
    """One point on each rectangle, uniform in the solid angle that it subtends.

    In double precision, because the solid angle is a small difference of large angles.

    Args:
        points: ``(N, 3)`` receivers.
        corner: ``(N, 3)`` of each rectangle.
        edge_u: ``(N, 3)``.
        edge_v: ``(N, 3)`` at right angles to ``edge_u``.
        u: ``(2, N)`` in [0, 1).

    Returns:
        ``(N, 3)`` the vector to the point; and ``(N,)`` the solid angle, 0 where a rectangle is edge-on.

    Source: Urena, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles".
    """
    first, s, t = (corner - points).double(), u[0].double(), u[1].double()
    along, up = edge_u.double(), edge_v.double()
    width, height = dot(along, along).sqrt(), dot(up, up).sqrt()
    along, up = along / width[:, None], up / height[:, None]
    away = torch.linalg.cross(along, up)
    z = dot(first, away)
    edge_on = z.abs() < FLATTEST
    away = torch.where((z > 0)[:, None], -away, away)
    z = -z.abs().clamp_min(FLATTEST)
    x0, y0 = dot(first, along), dot(first, up)
    x1, y1 = x0 + width, y0 + height
    # sines of the elevation of the planes through the receiver and the four sides
    b0, b1, b2, b3 = (side / (side * side + z * z).sqrt() for side in (-y0, x1, y1, -x0))
    # the normals of neighbouring planes share no axis but z, so their cosine is the product of these
    g0, g1, g2, g3 = ((-b * c).clamp(-1, 1).acos() for b, c in ((b0, b1), (b1, b2), (b2, b3), (b3, b0)))
    rest = 2 * torch.pi - g2 - g3
    angle = g0 + g1 - rest
    turn = s * angle + rest
    f = (turn.cos() * b0 - b2) / turn.sin()
    c = torch.where(f > 0, 1.0, -1.0) / (f * f + b0 * b0).sqrt().clamp_min(1e-12)
    c = c.clamp(-1 + 1e-12, 1 - 1e-12)
    x = (-c * z / (1 - c * c).sqrt()).clamp(x0, x1)
    square = x * x + z * z
    h0, h1 = y0 / (square + y0 * y0).sqrt(), y1 / (square + y1 * y1).sqrt()
    h = (h0 + t * (h1 - h0)).clamp(-1 + 1e-12, 1 - 1e-12)
    y = (h * (square / (1 - h * h)).sqrt()).clamp(y0, y1)
    way = along * x[:, None] + up * y[:, None] + away * z[:, None]
    return way.to(points), torch.where(edge_on, 0.0, angle).to(points)
