"""How far solids reach behind their visible fronts."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.camera import Camera
from post.sweep.op import bodies

UNBOUNDED = 1e6  # limit of thickness, in place of "no end", as a multiple of the depth


def planar_thickness(
    camera: Camera, depth: Tensor, hit: Tensor, thickness: Tensor | float, hidden: Tensor | float = 0.0
) -> Tensor:
    """Planar depth from front to back.

    Measured thickness ends where the view ray leaves the body, which at an edge or on a slope is soon after it enters.
    Rays of neighbouring pixels show that the body continues there: solids that overlap in depth are one body, which
    reaches as deep as the deepest of them.

    Args:
        camera: of the picture.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        hit: ``(B, 1, H, W)`` bool.
        thickness: ``(B, 1, H, W)`` measured along the view ray, world units; or one assumed for everything, a number
            or 0-dim tensor, which is taken as it is.
        hidden: added to measured thickness, world units, for hidden geometry behind it.

    Returns:
        ``(B, 1, H, W)`` world units.
    """
    toward = camera.along_axis(depth.dtype)
    limit = (UNBOUNDED * depth).detach()
    if not isinstance(thickness, Tensor) or thickness.ndim == 0:
        return torch.minimum(torch.as_tensor(thickness).to(depth).expand_as(depth), limit) * toward
    back = depth + torch.minimum(thickness.to(depth.dtype), limit) * toward
    return bodies(depth, hit, back) - depth + hidden * toward
