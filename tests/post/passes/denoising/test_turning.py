"""Bodies that turn: what their histories may hold, and that their light stays where the lamp is."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from post import denoise
from post.passes.denoising.turning import frames_lit, turned

SIZE, RADIUS = 56, 22.0  # pixels
SUN = torch.tensor([math.sqrt(0.5), 0.0, math.sqrt(0.5)])[None, :, None, None]


def spun(vectors: Tensor, angle: float) -> Tensor:
    """Vectors ``(1, 3, H, W)`` turned about y."""
    x, y, z = vectors.unbind(1)
    return torch.stack([x * math.cos(angle) + z * math.sin(angle), y, z * math.cos(angle) - x * math.sin(angle)], dim=1)


def ball(angle: float, jitter: tuple[float, float] = (0.0, 0.0)) -> GBuffer:
    """A ball that turns about y by ``angle`` a frame; a pixel is a unit."""
    camera = Camera.look_at((0.0, 0.0, 60.0), (0.0, 0.0, 0.0), size=(SIZE, SIZE), orthographic_height=SIZE, far=200.0)
    camera = camera.with_jitter(jitter)
    px = camera.pixel_centers() - SIZE / 2
    x, y = px[:, :1] / RADIUS, -px[:, 1:] / RADIUS
    height = (1 - x * x - y * y).clamp_min(0.0).sqrt()
    hit = height > 0.05
    normal = torch.where(hit, torch.cat([x, y, height], dim=1), 0.0)
    normal = normal / normal.square().sum(1, keepdim=True).sqrt().clamp_min(1e-6)
    before = spun(normal, -angle)
    motion = RADIUS * torch.stack([before[:, 0] - normal[:, 0], normal[:, 1] - before[:, 1]], dim=1)
    return GBuffer(
        camera=camera,
        previous_camera=camera.with_jitter(None),
        depth=torch.where(hit, 60.0 - RADIUS * normal[:, 2:], 200.0),
        hit=hit,
        normal=normal,
        motion=torch.where(hit, motion, 0.0),
        motion_z=torch.where(hit, RADIUS * (normal[:, 2:] - before[:, 2:]), 0.0),
        object_id=hit.int(),
    )


def error_of(angle: float, *, remember: bool) -> float:
    """Mean square error of noisy frames from the third on, with or without the history of those before."""
    g, generator, history, errors = ball(angle), torch.Generator().manual_seed(0), None, []
    truth = torch.where(g.hit, 0.2 + (g.normal * SUN).sum(1, keepdim=True).clamp_min(0.0), 0.0).expand(-1, 3, -1, -1)
    for _ in range(10):
        light = truth * (1 + 0.4 * torch.randn(g.depth.shape, generator=generator)).clamp_min(0.0)
        clean, history = denoise(light, g, history if remember else None)
        errors.append(float((clean - truth)[g.hit.expand_as(truth)].square().mean()))
    return sum(errors[2:]) / len(errors[2:])


@pytest.mark.parametrize("angle", [0.1, 0.3])
def test_the_history_of_a_turning_ball_is_no_worse_than_none(angle: float):
    assert error_of(angle, remember=True) < 1.1 * error_of(angle, remember=False)


@pytest.mark.parametrize("jitter", [(0.0, 0.0), (0.4, -0.3)])
@pytest.mark.parametrize("angle", [0.02, 0.2])
def test_the_angle_is_found(angle: float, jitter: tuple[float, float]):
    g = ball(angle, jitter)
    assert g.motion is not None
    turn, inside = turned(g, ball(angle), g.motion, g.hit)
    middle = (g.normal[:, 2:] > 0.8) & (g.normal[:, 1:2].abs() < 0.1)  # at the poles normals turn less
    assert middle.sum() > 50
    assert torch.allclose(turn[middle], torch.tensor(angle), rtol=0.15)
    assert inside[middle].min() == 1


def test_what_moves_without_turning_keeps_its_frames():
    light = torch.rand(1, 3, SIZE, SIZE, generator=torch.Generator().manual_seed(0))
    g = ball(0.0)
    moving = g.replace(
        motion=torch.where(g.hit, torch.tensor([-2.0, 0.0])[None, :, None, None], 0.0),
        normal=torch.where(g.hit, SUN.expand_as(g.normal), 0.0),
    )
    assert frames_lit(light, g, g) is None
    assert frames_lit(light, ball(0.2).replace(motion=None, motion_z=None), g) is None
    frames = frames_lit(light, moving, moving)
    assert frames is not None
    assert frames.isinf().all()


def test_noise_and_slow_turns_allow_more_frames():
    generator = torch.Generator().manual_seed(0)
    even = torch.ones(1, 3, SIZE, SIZE)
    grainy = even * torch.empty(1, 1, SIZE, SIZE).exponential_(generator=generator)
    middle = ball(0.0).normal[:, 2:] > 0.8

    def mean(angle: float, light: Tensor) -> float:
        frames = frames_lit(light, ball(angle), ball(angle))
        assert frames is not None
        return float(frames[middle].mean())

    assert mean(0.2, even) == 1.0
    assert 1.0 < mean(0.2, grainy) < mean(0.02, grainy) < 60.0
