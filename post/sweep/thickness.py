"""How far solids reach behind their visible fronts."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.camera import Camera

UNBOUNDED = 1e6  # limit of thickness, in place of "no end", as a multiple of the depth
STRIDES = (1, 2, 3)  # pixels between neighbours, one pass each: bodies are found from up to 6 pixels around


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
    toward = -camera.to_eye(camera.unproject(torch.ones_like(depth)))[:, 2:]
    limit = (UNBOUNDED * depth).detach()
    if not isinstance(thickness, Tensor) or thickness.ndim == 0:
        return torch.minimum(torch.as_tensor(thickness).to(depth).expand_as(depth), limit) * toward
    back = depth + torch.minimum(thickness.to(depth.dtype), limit) * toward
    return bodies(depth, hit, back) - depth + hidden * toward


def bodies(depth: Tensor, hit: Tensor, back: Tensor) -> Tensor:
    """Depth of the back of each pixel's body, from all surrounding pixels whose solids overlap with its own."""
    height, width = depth.shape[-2:]
    for stride in STRIDES:
        fronts = F.pad(torch.where(hit, depth, torch.inf), (stride,) * 4, value=torch.inf)
        backs = F.pad(torch.where(hit, back, -torch.inf), (stride,) * 4, value=-torch.inf)
        deepest = back
        for dy in (0, stride, 2 * stride):
            for dx in (0, stride, 2 * stride):
                place = (..., slice(dy, dy + height), slice(dx, dx + width))
                one = (fronts[place] <= back) & (depth <= backs[place])
                deepest = torch.where(one, torch.maximum(deepest, backs[place]), deepest)
        back = deepest
    return back
