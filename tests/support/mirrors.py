"""True hits of rays inside a scene of boxes, and whether they are visible: the oracle for screen-space rays."""

from __future__ import annotations

from typing import Any, NamedTuple

import boxes
import torch
from torch import Tensor

from gbufrt import Camera, Frame
from gbufrt.sampling import inside
from post import SSR


class SkyAlone(SSR):
    """Guesses no surroundings: off screen there is the sky alone, so that what a mirror shows is known."""

    def tunables(self) -> dict[str, Any]:
        return {**super().tunables(), "surroundings": False}


class Truth(NamedTuple):
    hit: Tensor  # (B,1,H,W): the ray hits a box
    visible: Tensor  # (B,1,H,W): and that point is visible
    px: Tensor  # (B,2,H,W): where
    distance: Tensor  # (B,1,H,W), 0 without a hit
    box: Tensor  # (B,1,H,W) which box
    normal: Tensor  # (B,3,H,W) world


def cast(origins: Tensor, directions: Tensor, scene: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Nearest box of each ray ``(..., 3)``: distance (inf on a miss), index, normal."""
    near = (scene[:, 0] - origins[..., None, :]) / directions[..., None, :]
    far = (scene[:, 1] - origins[..., None, :]) / directions[..., None, :]
    entry = torch.minimum(near, far)
    enter, axis = entry.max(dim=-1)
    enter = torch.where((enter < torch.maximum(near, far).amin(dim=-1)) & (enter > 1e-4), enter, torch.inf)
    distance, index = enter.min(dim=-1)
    axis = axis.gather(-1, index[..., None])
    normal = torch.zeros_like(directions).scatter(-1, axis, -directions.gather(-1, axis).sign())
    return distance, index, normal


def intersect(camera: Camera, points_world: Tensor, directions_world: Tensor, scene: Tensor = boxes.ROOM) -> Truth:
    """Cast rays from ``(B, 3, H, W)`` surface points; zero directions hit nothing."""
    origins, directions = points_world.permute(0, 2, 3, 1), directions_world.permute(0, 2, 3, 1)
    moving = directions.norm(dim=-1, keepdim=True) > 0.5
    # a skewed direction replaces zero ones: exact zeros would divide by zero in the slab test
    distance, index, normal = cast(origins, torch.where(moving, directions + 1e-9, 0.577), scene)
    hit = torch.isfinite(distance) & moving[..., 0]
    distance = torch.where(hit, distance, 0.0)
    ends = (origins + directions * distance[..., None]).permute(0, 3, 1, 2)
    view = camera.to_view(ends)
    px = camera.project(view, jittered=True)
    toward = camera.to_eye(view)
    eye = camera.rotate_to_world(toward).permute(0, 2, 3, 1) + 1e-9
    blocked, _, _ = cast(ends.permute(0, 2, 3, 1) + 1e-3 * normal, eye, scene)
    onscreen = hit[:, None] & inside(px, camera.size) & (view[:, 2:] > camera.near)
    onscreen &= torch.isinf(blocked)[:, None] | (blocked[:, None] > view.norm(dim=1, keepdim=True))
    return Truth(hit[:, None], onscreen, px, distance[:, None], index[:, None], normal.permute(0, 3, 1, 2))


def reflected(frame) -> tuple[Tensor, Tensor]:
    """World-space points and reflected view directions of a frame's surfaces, zero where the sky is."""
    g = frame.gbuffer
    points = g.points_view()
    eye, normal = g.camera.to_eye(points), g.camera.rotate_to_view(g.normal)
    mirrored = 2 * (eye * normal).sum(1, keepdim=True) * normal - eye
    return g.camera.to_world(points), g.camera.rotate_to_world(torch.where(g.hit, mirrored, 0.0))


def shiny(camera: Camera | None = None, *, rough: float = 0.0, metal: float = 1.0, scene: Tensor = boxes.ROOM) -> Frame:
    """Boxes of one radiance each, without shading, so that a mirror's picture follows from the box that is hit."""
    frame = boxes.frame(camera or boxes.camera((90, 120)), boxes=scene)
    g = frame.gbuffer
    g = g.replace(
        roughness=torch.full_like(g.depth, rough),
        metallic=torch.full_like(g.depth, metal),
        albedo=torch.ones_like(g.depth).expand(-1, 3, -1, -1),
    )
    assert g.material_id is not None
    palette = torch.cat([torch.tensor([[0.5, 0.5, 0.5]]), boxes.ALBEDO])
    light = palette[g.material_id[:, 0].long()].permute(0, 3, 1, 2)
    return frame.replace(gbuffer=g, radiance=light, ambient=None)
