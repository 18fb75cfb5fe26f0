"""Mirrors that curve or turn: where their images were in the frame before."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.resident import waits
from gbufrt.directions import length
from gbufrt.sampling import sample

CREASE = 0.6  # cosine between the normals of neighbours below which an edge lies between them
TIGHT = 0.03  # radians from pixel to pixel: rays that a mirror turns apart by more find another surface each
SHOWN = 0.5  # least length of a mean of normals, which are zero where there is no mirror
FOCUS = 0.1  # least share of a plane's turn that curvature leaves: nearer to their focus images grow without bound


def tightly_curved(normal: Tensor, mirrors: Tensor) -> Tensor:
    """``(B, 1, H, W)`` bool: mirrors that curve so much that what they show has no surface wider than a few pixels.

    Args:
        normal: ``(B, 3, H, W)`` of the mirrors, unit length, in any space.
        mirrors: ``(B, 1, H, W)`` bool.
    """
    if not (waits(mirrors) or bool(mirrors.any())):
        return mirrors
    right, down = (length(_slope(normal, mirrors, dim)) for dim in (3, 2))
    return mirrors & (2 * torch.maximum(right, down) > TIGHT)


def normals_before(normal: Tensor, before: Tensor | None, px: Tensor) -> Tensor:
    """Normals that mirrors had in the frame before.

    Args:
        normal: ``(B, 3, H, W)`` of this frame, world space.
        before: as ``normal``, of the mirrors of the frame before, and zero elsewhere; None where nothing is known.
        px: ``(B, 2, H, W)`` where each pixel's surface was in the frame before.

    Returns:
        ``(B, 3, H, W)``, those of this frame where no mirror or one of very unlike normals was.
    """
    if before is None or before.shape != normal.shape:
        return normal
    found = sample(before.to(normal), px)
    size = length(found)
    found = found / size
    same = (size > SHOWN) & ((found * normal).sum(1, keepdim=True) > CREASE)
    return torch.where(same, found, normal)


def curved_motion(
    flat: Tensor, own: Tensor, mirrors: Tensor, distance: Tensor, points: Tensor, normal: Tensor, camera: Camera
) -> Tensor:
    """Motion of what curved mirrors show, from that of what their tangent planes would show.

    What a mirror shows at a pixel moves over it until the ray that the mirror reflects meets the same point again. A
    step over a plane turns that ray by as much as eye and point turn around the plane; where a mirror curves, its
    normals turn it further. Steps over convex mirrors are shorter by that.

    Args:
        flat: ``(B, 2, H, W)`` pixels, previous minus current: of the images in tangent planes.
        own: as ``flat``, of the mirrors.
        mirrors: ``(B, 1, H, W)`` bool.
        distance: ``(B, 1, H, W)`` world units from the mirrors to what they reflect.
        points: ``(B, 3, H, W)`` of the mirrors, view space.
        normal: as ``points``, unit length.
        camera: of the frame.

    Returns:
        ``(B, 2, H, W)`` as ``flat``, and equal to it where a mirror focuses and beyond mirrors.

    Source: ray differentials at mirrors, Igehy 1999, to the first order.
    """
    slopes = [_slope(normal, mirrors, dim) for dim in (3, 2)]
    if not waits(flat) and not any(bool(slope.any()) for slope in slopes):
        return flat
    eye = camera.to_eye(points)
    cosine = _dot(eye, normal)
    facing = torch.where(cosine > 0, cosine, torch.inf)
    lens = camera.lens.to(points)[:, :2, None, None].split(1, dim=1)
    wide = torch.ones_like(distance) if camera.orthographic else points[:, 2:]
    nearness = 1 / distance.clamp_min(1e-9) + (0.0 if camera.orthographic else 1 / length(points))
    steps, turns = [], []
    for axis, focal in enumerate(lens):
        step = torch.cat([wide / focal if k == axis else torch.zeros_like(wide) for k in range(3)], dim=1)
        steps.append(step - eye * (_dot(normal, step) / facing))  # by a pixel, in the tangent plane
        turns.append(2 * cosine * slopes[axis])
    across = [step - eye * _dot(step, eye) for step in steps]
    plane = [nearness * _dot(across[i], across[j]) for i, j in ((0, 0), (0, 1), (1, 1))]
    bend = [(_dot(steps[i], turns[j]) + _dot(steps[j], turns[i])) / 2 for i, j in ((0, 0), (0, 1), (1, 1))]
    a, b, c = (p + q for p, q in zip(plane, bend, strict=True))
    x, y = (flat - own).split(1, dim=1)
    right, down = plane[0] * x + plane[1] * y, plane[1] * x + plane[2] * y
    determinant = a * c - b * b
    moved = torch.cat([c * right - b * down, a * down - b * right], dim=1) / determinant
    clear = mirrors & (a > 0) & (determinant > FOCUS * (plane[0] * plane[2] - plane[1] * plane[1]))
    return torch.where(clear, own + moved, flat)


def _dot(a: Tensor, b: Tensor) -> Tensor:
    return (a * b).sum(1, keepdim=True)


def _slope(normal: Tensor, mirrors: Tensor, dim: int) -> Tensor:
    """Change of normals ``(B, 3, H, W)`` per pixel along ``dim``, the mean to both sides as far as the mirror goes."""
    pads = ((1, 0), (0, 1)) if dim == 3 else ((0, 0, 1, 0), (0, 0, 0, 1))
    first, second = (normal.narrow(dim, k, normal.shape[dim] - 1) for k in (0, 1))
    joined = mirrors.narrow(dim, 0, mirrors.shape[dim] - 1) & mirrors.narrow(dim, 1, mirrors.shape[dim] - 1)
    joined = (joined & (_dot(first, second) > CREASE)).to(normal)
    total, count = (F.pad(t, pads[0]) + F.pad(t, pads[1]) for t in ((second - first) * joined, joined))
    return total / count.clamp_min(1.0)
