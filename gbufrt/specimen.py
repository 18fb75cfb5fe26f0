"""A small frame that shows passes a bit of everything, to have them compile their kernels."""

from __future__ import annotations

import torch

from gbufrt.camera import Camera
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer

SIDE = 16  # pixels; kernels fit any size
FAR = 100.0  # world units


def specimen() -> Frame:
    """A slanted wall below the sky, from mirror to matt, seen through glass, with all that the tracer gives."""
    camera = Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), size=(SIDE, SIDE), fov_y=50.0, far=FAR)
    one, zero = torch.ones(1, 1, SIDE, SIDE), torch.zeros(1, 3, SIDE, SIDE)
    down, across = one.cumsum(2) / SIDE, one.cumsum(3) / SIDE
    hit = down > 0.25
    gbuffer = GBuffer(
        camera=camera, previous_camera=camera, hit=hit, depth=torch.where(hit, 4 + across, FAR), thickness=one,
        normal=torch.where(hit, torch.tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1), 0.0), roughness=across,
        albedo=zero + 0.5, emission=zero, metallic=down, motion=4 * zero[:, :2] + across, motion_z=zero[:, :1],
        material_id=one.int(), object_id=one.int(),
    )  # fmt: skip
    light = torch.cat([across, down, one], dim=1)
    frame = Frame(
        gbuffer=gbuffer, radiance=light, ambient=light, environment=torch.ones(1, 3, 8, 16),
        fog_light=light[..., ::2, ::2], fog_transmittance=one / 2, diffuse=light, specular=light,
        reflection_distance=one, replayed=one, replayed_diffuse=light, replayed_specular=light,
        cached_diffuse=light,
    )  # fmt: skip
    return frame.replace(behind=frame)
