"""Unoccluded irradiance from uniform lights, in closed form: the sun's disc and rectangles.

Vectors are planes here, ``(3, ...)``, so that every step of the arithmetic runs over contiguous memory.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Inner product over dimension 0."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Vector product over dimension 0."""
    return torch.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def disc_cosine(cosine: Tensor, sine_radius: float) -> Tensor:
    """Mean cosine over a small disc of directions; the part below the horizon counts as zero.

    Args:
        cosine: between the surface's normal and the middle of the disc.
        sine_radius: sine of the disc's angular radius.

    Returns:
        The shape of ``cosine``: equal to it while the whole disc is above the horizon.
    """
    h = (cosine / max(sine_radius, 1e-6)).clamp(-1.0, 1.0)
    rest = (1 - h * h).clamp_min(0.0)
    partial = h * (0.5 + (h.asin() + h * rest.sqrt()) / math.pi) + 2 / (3 * math.pi) * rest**1.5
    return torch.where(h < 1.0, partial * sine_radius, cosine)


def rectangle_irradiance(points: Tensor, normals: Tensor, corner: Tensor, edge_u: Tensor, edge_v: Tensor) -> Tensor:
    """Unoccluded irradiance from one-sided rectangles of unit radiance.

    Args:
        points: ``(3, N)``.
        normals: ``(3, N)`` unit length.
        corner: ``(3, K, N)``, or ``(3, K, 1)`` where all points share them; see `tracer.lights.emitters.Lamps`.
        edge_u: as ``corner``.
        edge_v: as ``corner``.

    Returns:
        ``(K, N)``; zero behind a rectangle. What is below the surface's horizon does not count.

    Source: Lambert 1760, the contour integral of a polygon; Baum et al. 1989, eq. 1.
    """
    first = corner - points[:, None]
    normal = normals[:, None].expand_as(first)
    facing = dot(cross(edge_u, edge_v), first) < 0
    corners = (first, first + edge_u, first + edge_u + edge_v, first + edge_v)
    heights = tuple(dot(normal, c) for c in corners)
    total = torch.zeros_like(heights[0])
    leaves, enters = torch.zeros_like(first), torch.zeros_like(first)
    for i in range(4):
        a, b, za, zb = corners[i], corners[(i + 1) % 4], heights[i], heights[(i + 1) % 4]
        up, down = (za < 0) & (zb >= 0), (za >= 0) & (zb < 0)
        crossing = a + (b - a) * (za / torch.where(up | down, za - zb, 1.0))
        leaves, enters = torch.where(down, crossing, leaves), torch.where(up, crossing, enters)
        a, b = torch.where(za < 0, crossing, a), torch.where(zb < 0, crossing, b)
        total += torch.where((za >= 0) | (zb >= 0), _edge(a, b, normal), 0.0)
    total += _edge(leaves, enters, normal)
    # from the point, corners that turn about the outward normal run clockwise: the sum is negative
    return torch.where(facing, -0.5 * total, 0.0).clamp_min(0.0)


def _edge(a: Tensor, b: Tensor, normal: Tensor) -> Tensor:
    """The angle between two corners times the cosine between their plane's normal and ``normal``."""
    turn = cross(a, b)
    size = dot(turn, turn).sqrt()
    return torch.atan2(size, dot(a, b)) * dot(turn, normal) / size.clamp_min(1e-20)
