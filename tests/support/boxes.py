"""Frames of axis-aligned boxes, ray traced in a few lines: exact G-buffers for tests that must not need the tracer."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera, Frame, GBuffer

ROOM = torch.tensor(
    [  # min corner, max corner; world units, y up
        [[-20.0, -1.0, -20.0], [20.0, 0.0, 20.0]],  # floor, its top at y = 0
        [[-20.0, -1.0, -21.0], [20.0, 20.0, -20.0]],  # far wall, its face at z = -20
        [[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]],  # a box in the middle
        [[3.0, 0.0, -4.0], [3.3, 5.0, -3.7]],  # a thin pole
    ]
)
ALBEDO = torch.tensor([[0.6, 0.6, 0.6], [0.7, 0.5, 0.4], [0.8, 0.2, 0.2], [0.3, 0.3, 0.8]])


def camera(size: tuple[int, int] = (72, 96), *, orthographic: bool = False, dx: float = 0.0) -> Camera:
    """Looks down at the box from the front and a little above."""
    return Camera.look_at(
        (2.0 + dx, 4.0, 9.0),
        (0.0 + dx, 1.0, 0.0),
        size=size,
        fov_y=50.0,
        far=100.0,
        orthographic_height=9.0 if orthographic else None,
    )


def cameras(count: int, size: tuple[int, int], *, apart: float = 0.7, orthographic: bool = False) -> Camera:
    """A batch of such cameras, side by side."""
    each = [camera(size, dx=apart * i, orthographic=orthographic) for i in range(count)]
    return Camera(
        intrinsics=torch.cat([c.intrinsics for c in each]),
        world_from_view=torch.cat([c.world_from_view for c in each]),
        size=size,
        near=each[0].near,
        far=each[0].far,
        orthographic=orthographic,
    )


def trace(cam: Camera, boxes: Tensor = ROOM) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Nearest hit of every pixel's ray: ray distance (inf on a miss), box index, world normal, exit distance."""
    origin, direction = cam.rays()
    near = (boxes[:, 0] - origin[..., None, :]) / direction[..., None, :]
    far = (boxes[:, 1] - origin[..., None, :]) / direction[..., None, :]
    entry = torch.minimum(near, far)
    enter, axis = entry.max(dim=-1)
    leave = torch.maximum(near, far).amin(dim=-1)
    enter = torch.where((enter < leave) & (enter > 0), enter, torch.inf)
    distance, index = enter.min(dim=-1)
    axis = axis.gather(-1, index[..., None])
    normal = torch.zeros_like(direction).scatter(-1, axis, -direction.gather(-1, axis).sign())
    return distance, index, normal, leave.gather(-1, index[..., None])[..., 0]


def frame(
    cam: Camera | None = None, *, previous: Camera | None = None, boxes: Tensor = ROOM, index: int = 0, sun: bool = True
) -> Frame:
    """A whole frame with every channel; light is an unshadowed sun and a grey sky."""
    cam = cam or camera()
    previous = previous or cam
    distance, which, normal, leave = trace(cam, boxes)
    hit = torch.isfinite(distance)[:, None]
    _, direction = cam.rays()
    along = (direction * cam.forward[:, None, None, :]).sum(-1)
    depth = torch.where(hit, (distance * along)[:, None], torch.tensor(cam.far))
    normal = torch.where(hit, normal.permute(0, 3, 1, 2), 0.0)
    motion, motion_z = cam.static_motion(previous, depth, hit)
    palette = ALBEDO[which % len(ALBEDO)].permute(0, 3, 1, 2)
    albedo = torch.where(hit, palette, 0.0)
    toward_sun = torch.nn.functional.normalize(torch.tensor([0.4, 0.8, 0.5]), dim=0)[None, :, None, None]
    cosine = (normal * toward_sun).sum(1, keepdim=True).clamp_min(0) if sun else torch.zeros_like(depth)
    sky = torch.full((cam.batch, 3, *cam.size), 0.5)
    gbuffer = GBuffer(
        camera=cam,
        previous_camera=previous,
        depth=depth,
        hit=hit,
        normal=normal,
        normal_geo=normal,
        motion=motion,
        motion_z=motion_z,
        albedo=albedo,
        roughness=torch.where(hit, 0.3, torch.ones_like(depth)),
        metallic=torch.zeros_like(depth),
        emission=torch.zeros_like(albedo),
        opacity=torch.where(hit, 1.0, torch.zeros_like(depth)),
        transmittance=torch.zeros_like(albedo),
        material_id=torch.where(hit, which[:, None] + 1, 0).int(),
        object_id=torch.where(hit & (which[:, None] == 2), 1, 0).int(),
        thickness=torch.where(hit, (leave - distance)[:, None], 0.0),
    )
    return Frame(
        gbuffer=gbuffer,
        index=index,
        radiance=torch.where(hit, albedo * cosine, sky),
        ambient=torch.where(hit, albedo * 0.5, 0.0),
        environment=torch.full((cam.batch, 3, 16, 32), 0.5),
    )
