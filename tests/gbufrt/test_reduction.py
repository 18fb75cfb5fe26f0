"""Frames of every second pixel: the same surfaces in the same places."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt.reduction import every_nth


@pytest.mark.parametrize("size", [(48, 64), (73, 127), (1, 1)])
@pytest.mark.parametrize("stride", [2, 3])
@pytest.mark.parametrize("orthographic", [False, True])
def test_pixels_keep_their_points(size: tuple[int, int], stride: int, orthographic: bool):
    camera = boxes.camera(size, orthographic=orthographic).with_jitter((0.3, -0.4))
    before = boxes.camera(size, orthographic=orthographic, dx=0.2).with_jitter((-0.1, 0.2))
    frame = boxes.frame(camera, previous=before)
    small = every_nth(frame.replace(previous=boxes.frame(before)), stride)
    g, s = frame.gbuffer, small.gbuffer
    torch.testing.assert_close(s.points_view(), g.points_view()[..., ::stride, ::stride], rtol=1e-4, atol=1e-4)
    assert s.camera.size == s.depth.shape[-2:]
    assert s.previous_camera is not None
    motion, motion_z = s.camera.static_motion(s.previous_camera, s.depth, s.hit)
    torch.testing.assert_close(s.motion, motion, rtol=1e-3, atol=2e-3)
    torch.testing.assert_close(s.motion_z, motion_z, rtol=1e-3, atol=2e-3)
    for name in ("albedo", "object_id", "thickness"):
        want = getattr(g, name)
        assert torch.equal(getattr(s, name), want[..., ::stride, ::stride]), name
    assert small.previous is not None
    assert small.previous.gbuffer.camera.size == s.camera.size
    small.validate()


def test_what_is_not_one_value_a_pixel_stays():
    frame = boxes.frame(boxes.camera((24, 32)))
    frame = frame.replace(environment=torch.rand(1, 3, 24, 32), exposure=torch.ones(1, 1, 1, 1))
    frame = frame.write("mine", frame.gbuffer.depth)
    small = every_nth(frame, 2)
    assert small.environment is frame.environment
    assert small.exposure is frame.exposure
    assert torch.equal(small.read("mine"), frame.gbuffer.depth[..., ::2, ::2])
    assert torch.equal(small.read("radiance"), frame.read("radiance")[..., ::2, ::2])
