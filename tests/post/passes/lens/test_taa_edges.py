"""Edges in temporal anti-aliasing: they move with what is in front, not with what is nearer on the same surface."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera, Frame, GBuffer, History
from post.passes.lens.taa import TAA, taa

STEP, RADIUS, AWAY = 0.16, 0.5, 3.4  # world units


def ball(x: float) -> tuple[Tensor, GBuffer]:
    """A white ball before nothing, which has moved to the right to ``x``, and its G-buffer."""
    camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), size=(48, 120), fov_y=30.0, far=50.0)
    middle = torch.tensor([x, 0.0, AWAY])[None, :, None, None]
    _, rays = camera.rays()
    rays = camera.rotate_to_view(rays.permute(0, 3, 1, 2))
    along = (rays * middle).sum(1, keepdim=True)
    square = along * along - middle.square().sum() + RADIUS**2
    points, hit = rays * (along - square.clamp_min(0.0).sqrt()), square > 0
    before = points - torch.tensor([STEP, 0.0, 0.0])[None, :, None, None]
    g = GBuffer(
        camera=camera,
        previous_camera=camera,
        depth=torch.where(hit, points[:, 2:], 50.0),
        hit=hit,
        normal=torch.where(hit, camera.rotate_to_world((points - middle) / RADIUS), 0.0),
        motion=torch.where(hit, camera.project(before) - camera.project(points), 0.0),
        motion_z=torch.zeros_like(along),
        object_id=hit.int(),
    )
    return hit.float().expand(-1, 3, -1, -1).contiguous(), g


def middle_of(light: Tensor) -> float:
    row = light[:, 0].sum((0, 1))
    return float((row * torch.arange(len(row))).sum() / row.sum())


def test_a_ball_that_moves_across_hardly_runs_ahead_of_itself():
    history: History | None = None
    ahead: list[float] = []
    for index in range(12):
        light, g = ball(-0.9 + STEP * index)
        smooth, history = taa(light, g, history)
        ahead.append(middle_of(smooth) - middle_of(light))
    assert sum(ahead[6:]) / len(ahead[6:]) < 0.35, ahead  # 0.63 by the motion of the nearest pixel around


def test_light_of_random_places_in_each_pixel_becomes_smooth_at_edges():
    """As a path tracer's is after `Denoise`, whatever the signal's name; no jitter of the camera tells the places."""
    height, width = 48, 64
    camera = Camera.look_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), size=(height, width), fov_y=40.0)
    one, draw = torch.ones(1, 1, height, width), torch.Generator().manual_seed(2)
    normal = torch.cat([0 * one, 0 * one, one], dim=1)
    g = GBuffer(camera=camera, previous_camera=camera, depth=2 * one, hit=one > 0, normal=normal)
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    above = lambda dx, dy: (0.4 * (x + dx) + 5 > y + dy).float().expand(1, 3, -1, -1).contiguous()
    fine = [above((i + 0.5) / 8, (j + 0.5) / 8) for i in range(8) for j in range(8)]
    truth, state, errors = torch.stack(fine).mean(0), None, []
    for index in range(16):
        light = above(*torch.rand((2, height, width), generator=draw))
        result, state = TAA(signal="radiance")(Frame(gbuffer=g, radiance=light, index=index), state)
        errors.append(float((result.read("radiance") - truth).square().mean().sqrt()))
    assert errors[-1] < 0.5 * errors[0], errors
