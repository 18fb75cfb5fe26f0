"""What lies between cameras and what they see: haze, or the water that they are in."""

from __future__ import annotations

import torch
from torch import Tensor

from tracer.lights.haze import Air, haze_before
from tracer.scene.scene import Scene
from tracer.traversal.hits import Hits
from tracer.underwater.medium import Medium


def air_before(scene: Scene, medium: Medium | None, directions: Tensor, hits: Hits) -> Air | None:
    """The air or water before what rays ``(B, H, W, 3)`` of cameras hit.

    Args:
        scene: what is there; its haze ends where an eye is in water.
        medium: round the cameras.
        directions: of the rays, unit length.
        hits: of the rays.
    """
    air = None if scene.haze is None else haze_before(scene, directions, hits)
    if medium is None:
        return air
    distances = torch.where(hits.hit, hits.t, 0.0)
    share = 1 - medium.clear(distances)
    light = medium.scattered(directions[..., 1], distances) / share.clamp_min(1e-6)
    rougher = share.amin(dim=1, keepdim=True)
    if air is not None:
        wet = medium.wet.view(-1, 1, 1, 1)
        share, light = torch.where(wet, share, air.share), torch.where(wet, light, air.light)
        rougher = torch.where(wet, rougher, air.rougher)
    return Air(share=share, light=light, rougher=rougher)
