"""Gradients of ray hits: the compiled march finds the pixel, a closed form gives the motion of the hit."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.sampling import gather
from post.march.rays import Hits

SAME_PX = 1e-3  # px between a march's hit and the closed form's, above which they are different points
SAME_WAY = 1e-4  # likewise for the distance, relative


def attach_hits(hits: Hits, depth: Tensor, normal: Tensor, origins: Tensor, directions: Tensor, camera: Camera) -> Hits:
    """Give the positions and distances of hits their gradients; values stay as they are.

    Where a ray ends at the plane of a pixel, ``px`` and ``distance`` follow that plane and the ray. The choice of pixel
    is held fixed, so changes at silhouettes have no gradient. Nor is there one where the march departs from the
    crossing point: along an axis on which it read the pixel's centre to avoid another surface, in cracks between
    pixels, and for rays that sides occlude.

    Args:
        hits: of `post.march.rays.march_rays` for the same rays.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit; that of the hierarchy.
        origins: ``(B, 3, h, w)`` view space, world units.
        directions: ``(B, 3, h, w)`` view space, unit; a zero vector sends no ray.
        camera: of the hierarchy.

    Returns:
        The hits; the same ones where no gradient is wanted.
    """
    if not (torch.is_grad_enabled() and any(t.requires_grad for t in (depth, normal, origins, directions))):
        return hits
    planes = torch.cat([camera.unproject(depth), camera.rotate_to_view(normal)], dim=1)
    column, row = hits.px[:, 0].floor(), hits.px[:, 1].floor()
    point, facing = gather(planes, column, row).split(3, dim=1)
    along = (facing * directions).sum(1, keepdim=True)
    ends = (hits.hit | hits.blocked) & (along.abs() > 1e-6)
    distance = (facing * (point - origins)).sum(1, keepdim=True) / torch.where(ends, along, 1.0)
    ends = ends & ((distance - hits.distance).abs() <= SAME_WAY * hits.distance)
    distance = torch.where(ends, distance, 0.0)
    px = camera.project(origins + directions * distance, jittered=True)
    follows = ends & hits.hit & ((px - hits.px).abs() <= SAME_PX)
    return hits._replace(
        px=hits.px + _change(torch.where(follows, px, 0.0)), distance=hits.distance + _change(distance)
    )


def _change(value: Tensor) -> Tensor:
    """Zero with the gradient of ``value``."""
    return value - value.detach()
