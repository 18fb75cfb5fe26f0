"""Histories of what moves: cameras, what they uncover, jitter, images in mirrors, depth steps."""

# pyright: reportPossiblyUnboundVariable=false

from __future__ import annotations

import boxes
import pytest
import torch
from accumulated import SIZE, noisy, rms, truth_of

from gbufrt import Camera, GBuffer
from gbufrt.noise.noise import halton_jitter
from post.passes.denoising.temporal import Temporal, temporal


def test_constant_stays_under_a_moving_camera():
    state, previous = None, None
    for step in range(6):
        camera = boxes.camera(SIZE, dx=0.2 * step)
        frame = boxes.frame(camera, previous=previous)
        out, state = Temporal()(frame.replace(ao=torch.full_like(frame.gbuffer.depth, 0.6)), state)
        assert torch.allclose(out.read("ao"), torch.full((), 0.6), atol=1e-5)
        previous = camera


def test_moving_camera_keeps_most_of_its_history():
    generator, state, previous, out = torch.Generator().manual_seed(2), None, None, None
    for step in range(16):
        camera = boxes.camera((60, 80), dx=0.07 * step)
        frame = boxes.frame(camera, previous=previous)
        out, state = Temporal(motion_response=0.0)(noisy(frame, generator), state)
        previous = camera
    assert out is not None
    hit = out.gbuffer.hit
    assert float(out.read("ao_history")[hit].mean()) > 12
    now = noisy(boxes.frame(out.gbuffer.camera), generator)
    left = rms((out.read("ao") - truth_of(out))[hit])
    assert left < 0.4 * rms((now.read("ao") - truth_of(now))[hit])


def test_trails_are_gone_four_frames_after_disocclusion():
    """A thin bright pole in front of a dark wall, a sliding camera: the pole must leave no trail on the wall."""
    state, previous = None, None
    for step in range(12):
        camera = boxes.camera((60, 80), dx=0.12 * step)
        frame = boxes.frame(camera, previous=previous)
        pole = frame.gbuffer.material_id == 4
        frame = frame.replace(ao=torch.where(pole, 1.0, 0.1))
        out, state = Temporal()(frame, state)
        wrong = (out.read("ao") - frame.read("ao")).abs()
        assert float(wrong.max()) < 0.02, f"frame {step}"
        previous = camera


def test_still_jittered_camera_keeps_its_history():
    state, previous, generator = None, None, torch.Generator().manual_seed(5)
    for index in range(24):
        camera = boxes.camera((48, 64)).with_jitter(halton_jitter(index))
        frame = boxes.frame(camera, previous=previous)
        out, state = Temporal()(noisy(frame, generator), state)
        previous = camera
    assert float(out.read("ao_history").mean()) > 15


def test_mirror_image_is_reprojected_by_its_virtual_position():
    """A mirror floor shows stripes that lie 6 units behind it; the camera slides along."""
    errors = {}
    for virtual in (True, False):
        state, previous = None, None
        for step in range(10):
            camera = boxes.camera((60, 80), dx=0.15 * step)
            frame = boxes.frame(camera, previous=previous, boxes=boxes.ROOM[:1])
            g = frame.gbuffer
            points = g.points_view()
            image = camera.to_world(points - camera.to_eye(points) * 6.0)
            stripes = (0.5 + 0.5 * torch.sin(image[:, :1] * 1.5)).expand(-1, 3, -1, -1) * g.hit
            frame = frame.replace(
                gbuffer=g.replace(roughness=torch.zeros_like(g.depth)),
                reflection=stripes,
                reflection_confidence=torch.ones_like(g.depth),
                reflection_distance=torch.full_like(g.depth, 6.0),
            )
            out, state = Temporal(signal="reflection", virtual=virtual, clamp=0.0)(frame, state)
            previous = camera
        errors[virtual] = rms((out.read("reflection") - stripes)[g.hit.expand(-1, 3, -1, -1)])
    assert errors[True] < 0.3 * errors[False]


@pytest.mark.parametrize(("footprints", "expected"), [(0.1, 11.0), (1.0, 4.0), (5.0, 1.0)])
def test_sharp_history_borrows_little_from_a_step_beside_and_nothing_from_afar(footprints, expected):
    camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), size=SIZE, far=100.0)
    depth = torch.full((1, 1, *SIZE), 10.0)
    flat = torch.tensor([0.0, 0.0, 1.0])[:, None, None].expand(1, 3, *SIZE)
    still = torch.zeros(1, 2, *SIZE)
    wall = GBuffer(
        camera=camera,
        depth=depth,
        hit=depth > 0,
        normal=flat,
        motion=still,
        motion_z=still[:, :1],
        previous_camera=camera,
    )
    history = None
    for _ in range(10):
        _, history = temporal(torch.full_like(flat, 0.5), wall, history, sharp=True)
    step = wall.replace(depth=depth + footprints / camera.pixels_per_unit(depth))
    mean, history = temporal(torch.full_like(flat, 0.5), step, history, sharp=True)
    assert torch.allclose(history.length, torch.tensor(expected))
    assert torch.allclose(mean, torch.tensor(0.5))
