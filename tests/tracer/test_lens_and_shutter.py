"""Path-traced pictures through a lens, and while a shutter is open."""

from __future__ import annotations

import torch
from voxels import DARK, LAMP, STONE, above, pose, world

from gbufrt import Camera
from tracer.lens import focus_distance, lens_rays
from tracer.scene.scene import Instance, Scene
from tracer.truth.truth import path_trace


def test_rays_through_a_lens_meet_on_the_focal_plane():
    camera = Camera.look_at((1, 2, 3), (4, 1, 9), size=(9, 16), fov_y=50.0)
    u = torch.rand(2, 500, generator=torch.Generator().manual_seed(0))
    px = torch.tensor([[3.7], [6.1]]).expand(2, 500)
    origins, directions, along = lens_rays(camera, px, u, aperture_radius=0.5, focus_distance=7.0)
    ends = camera.to_view((origins + directions * (7.0 / along)[:, None]).T[None])[0]
    assert torch.allclose(ends[2], torch.tensor(7.0), atol=1e-4)
    assert (camera.project(ends[None])[0] - px).abs().max() < 1e-3
    off = (origins - camera.position).norm(dim=1)
    assert 0.45 < off.max() <= 0.5 + 1e-6
    assert abs(float(off.square().mean()) - 0.125) < 0.01  # even over the disc


def test_a_lens_spreads_a_lamp_out_of_focus_over_a_disc():
    scene = Scene(world=world((3, 3, 3), (LAMP, (1, 1, 1), (2, 2, 2))), sun=None, sky=DARK)
    camera = Camera.look_at((1.5, 1.5, -18.0), (1.5, 1.5, 0.0), size=(48, 48), fov_y=30.0)
    sharp = path_trace(scene, camera, bounces=0, samples=16)["radiance"]
    blurred = path_trace(scene, camera, bounces=0, samples=64, aperture_radius=1.0, focus_distance=9.5)["radiance"]
    assert abs(float(blurred.sum() / sharp.sum()) - 1) < 0.03
    focal = float(camera.intrinsics[0, 0, 0])
    radius = focal * abs(1 / 9.5 - 1 / 19) + 0.5 * focal / 19
    y, x = torch.meshgrid(torch.arange(48) - 23.5, torch.arange(48) - 23.5, indexing="ij")
    far = (x * x + y * y).sqrt()
    assert blurred[0, 0][far > radius * 1.2 + 1].max() == 0
    assert blurred[0, 0][far < radius * 0.5].min() > 0
    focused = path_trace(scene, camera, bounces=0, samples=16, aperture_radius=1.0, focus_distance=19.0)["radiance"]
    assert (focused - sharp).abs().mean() < 0.05 * sharp.mean() + 0.01


def test_focus_goes_to_the_middle_of_the_picture_by_and_by():
    scene = Scene(world=world((48, 48, 4), (STONE, (0, 0, 2), (48, 48, 3))), sun=None)
    camera = Camera.look_at((24, 24, -10), (24, 24, 0), size=(9, 16))
    assert torch.allclose(focus_distance(scene, camera), torch.tensor([12.0]))
    distance = torch.tensor([2.0])
    for _ in range(3):
        distance = focus_distance(scene, camera, previous=distance, rate=0.5)
    assert torch.allclose(distance, torch.tensor([2.0 + 10 * 0.875]))
    away = Camera.look_at((24, 24, -10), (24, 24, -20), size=(9, 16))
    assert float(focus_distance(scene, away)) == away.far


def test_an_open_shutter_shows_a_mover_for_as_long_as_it_is_there():
    lamp = Instance(
        model=world((2, 2, 2), (LAMP, (0, 0, 0), (2, 2, 2))), pose=lambda t: pose((10.0 + 8 * t, 3.0, 23.0))
    )
    scene = Scene(world=world((48, 2, 48), (STONE, (0, 0, 0), (1, 1, 1))), instances=(lamp,), sun=None, sky=DARK)
    camera = above(size=(8, 48), span=8.0)
    given = {"bounces": 0, "samples": 64, "shutter": 1.0}
    trail = path_trace(scene, camera, **given, time=0.0)["radiance"][0, 0, 3:5].mean(dim=0) / 4
    x = torch.arange(48) + 0.5
    want = ((x - 10).clamp(0, 2) - (x - 18).clamp(0, 2)) / 8  # the share of the time that the lamp covers it
    assert (trail - want).abs().max() < 0.04
    centred = path_trace(scene, camera, **given, time=0.5, shutter_offset=-0.5)["radiance"][0, 0, 3:5].mean(dim=0) / 4
    assert torch.allclose(centred, trail)


def test_a_moving_camera_blurs_what_stands_still():
    scene = Scene(world=world((48, 3, 48), (LAMP, (23, 1, 23), (25, 3, 25))), sun=None, sky=DARK)

    def camera(t: float) -> Camera:
        return Camera.look_at(
            (24 + 4 * t, 30, 24), (24 + 4 * t, 0, 24), size=(8, 16), up=(0.0, 0.0, -1.0), orthographic_height=8.0
        )

    still = path_trace(scene, camera, bounces=0, samples=64)["radiance"]
    moved = path_trace(scene, camera, bounces=0, samples=64, shutter=1.0)["radiance"]
    assert abs(float(moved.sum() / still.sum()) - 1) < 0.02
    assert (moved > 0.01).sum() > 2 * (still > 0.01).sum()
