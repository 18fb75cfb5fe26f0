"""The sun, the sky and lamps on a picture: shadows, penumbrae, shares of materials, what all agree on."""

from __future__ import annotations

import math

import pytest
import torch
import torch.nn.functional as F
from lit import FLOOR, above, irradiance
from voxels import DARK, GLASS, LAMP, STONE, TABLE, WATER, points_of, pose, world

from gbufrt import Camera, GBuffer
from tracer.direct.lighting import light
from tracer.gbuffers import gbuffer
from tracer.lights.sky import sky_irradiance, sky_radiance, sun_radiance
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Scene, Sky, Sun
from tracer.scene.world import World


def test_the_sun_at_an_angle_gives_its_cosine():
    scene = Scene(world=world((48, 4, 48), FLOOR), sky=DARK, sun=Sun(direction=(0.6, 0.8, 0.0)))
    got = irradiance(scene, gbuffer(scene, above()))
    assert scene.sun is not None
    want = 0.8 * torch.tensor(scene.sun.irradiance).view(1, 3, 1, 1)
    assert torch.allclose(got, want.expand_as(got), rtol=1e-5)


@pytest.mark.parametrize("camera", [above((9, 9)), Camera.look_at((20, 9, 40), (24, 0, 24), size=(9, 11), fov_y=30.0)])
def test_a_white_floor_under_a_uniform_sky_is_as_bright_as_the_sky(camera):
    white = MaterialTable.of([Material(name="white", albedo=(1.0, 1.0, 1.0), variation=0.0)])
    grid = torch.ones(48, 1, 48, dtype=torch.int16)
    sky = Sky(zenith=(0.5, 0.6, 0.7), horizon=(0.5, 0.6, 0.7), ground=(0.5, 0.6, 0.7))
    scene = Scene(world=World.from_dense(grid, white), sky=sky, sun=None)
    radiance, ambient = light(scene, gbuffer(scene, camera))
    assert torch.allclose(ambient, torch.tensor(sky.zenith).view(1, 3, 1, 1).expand_as(ambient), rtol=1e-5)
    assert radiance.abs().max() == 0


def test_the_shadow_of_a_wall_ends_where_geometry_says():
    wall = (STONE, (20, 1, 0), (21, 6, 48))
    sun = Sun(direction=(-1.0, 1.0, 0.0), angular_radius=0.05)
    scene = Scene(world=world((48, 8, 48), FLOOR, wall), sky=DARK, sun=sun)
    g = gbuffer(scene, above((4, 480), span=0.2))  # 24 units over 480 pixels, x from 12 to 36
    x = points_of(g)[0, 0, 0]
    got = irradiance(scene, g)[0, 0, 0]
    floor = (points_of(g)[0, 1, 0] - 1).abs() < 1e-3
    assert (got[floor & (x > 21.01) & (x < 25.97)] == 0).all()
    assert torch.allclose(got[floor & (x > 26.03)], got[-1])
    assert torch.allclose(got[floor & (x < 19.99)], got[-1])


def test_penumbrae_widen_with_distance_and_have_the_right_profile():
    """Under the lower edge of a bar, the share of the sun's disc that is below the edge."""
    radius, widths = 3.0, []
    for low in (4, 13):
        bar = (STONE, (20, low, 0), (21, 24, 48))
        sun = Sun(direction=(-1.0, 1.0, 0.0), angular_radius=radius)
        scene = Scene(world=world((48, 24, 48), FLOOR, bar), sky=DARK, sun=sun)
        g = gbuffer(scene, above((48, 480), span=2.4))
        x, shade = points_of(g)[0, 0, 0], irradiance(scene, g)[0, 0].mean(0)
        angle = torch.atan2(torch.tensor(low - 1.0), x - 20.0) - math.pi / 4
        t = (angle / math.radians(radius)).clamp(-1.0, 1.0)
        share = 0.5 + (t * (1 - t * t).sqrt() + t.asin()) / math.pi
        beside = (x > 21.2) & (x < 35.0)
        full = math.sqrt(0.5) * sun.irradiance[0]
        assert torch.allclose(shade[beside] / full, share[beside], atol=0.04)
        widths.append(int(((shade > 0.1 * full) & (shade < 0.9 * full) & beside).sum()))
    assert 3.2 < widths[1] / widths[0] < 4.8  # 12 against 3 units from edge to floor


def test_stopping_early_changes_nothing_to_speak_of():
    boxes = [(STONE, (20, 1, 18), (22, 6, 20)), (STONE, (27, 3, 20), (29, 4, 30)), (LAMP, (24, 5, 24), (25, 6, 25))]
    scene = Scene(world=world((48, 8, 48), FLOOR, *boxes), sky=DARK, sun=Sun(angular_radius=2.0))
    g = gbuffer(scene, above((48, 48)))
    got, want = irradiance(scene, g), irradiance(scene, g, index=1, samples=128)
    assert ((got - want).mean() / want.mean()).abs() < 1e-3
    assert ((got - want).square().mean().sqrt() / want.mean()) < 0.02


def test_inner_corners_and_flush_blocks_show_no_false_shadow():
    """Sunlit steps viewed at a slant: every pixel is either in a real shadow or fully lit, along creases too."""
    steps = [(STONE, (0, 0, z), (48, 1 + (47 - z) // 4, z + 1)) for z in range(48)]
    sun = Sun(direction=(0.0, 1.0, 0.2), angular_radius=0.1)
    scene = Scene(world=world((48, 16, 48), *steps), sky=DARK, sun=sun)
    g = gbuffer(scene, Camera.look_at((18.3, 30.0, 70.0), (24.0, 4.0, 24.0), size=(90, 120), fov_y=30.0))
    toward = F.normalize(torch.tensor(sun.direction), dim=0).view(1, 3, 1, 1)
    want = (g.normal * toward).sum(1, keepdim=True).clamp_min(0) * sun.irradiance[0]
    got = irradiance(scene, g)[:, :1]
    lit = g.hit & (g.normal[:, 0:1].abs() < 0.5)
    assert ((got - want).abs()[lit] < 1e-4).all()


def test_light_through_glass_is_tinted():
    pane = (GLASS, (0, 3, 0), (48, 4, 48))
    scene = Scene(
        world=world((48, 8, 48), FLOOR, pane), sky=DARK, sun=Sun(direction=(0.0, 1.0, 0.0), angular_radius=0.1)
    )
    camera = Camera.look_at((24.0, 2.5, 24.0), (24.0, 0.0, 23.0), size=(5, 5), fov_y=20.0)
    got = irradiance(scene, gbuffer(scene, camera))
    assert scene.sun is not None
    want = 0.96 * torch.tensor(scene.sun.irradiance) * (1 - TABLE.opacity[GLASS]) * TABLE.tint[GLASS]
    assert torch.allclose(got, want.view(1, 3, 1, 1).expand_as(got), rtol=1e-3)


def test_metals_and_transmissive_surfaces_show_their_share_only():
    table = MaterialTable.of([Material(name="half", metallic=0.5, albedo=(0.5, 0.5, 0.5), variation=0.0)])
    grid = torch.ones(48, 1, 48, dtype=torch.int16)
    scene = Scene(world=World.from_dense(grid, table), sun=Sun(direction=(0.0, 1.0, 0.0)))
    radiance, ambient = light(scene, gbuffer(scene, above((4, 4))))
    assert scene.sun is not None
    assert radiance[0, 0, 0, 0].item() == pytest.approx(0.25 / math.pi * scene.sun.irradiance[0], rel=1e-4)
    assert ambient[0, 0, 0, 0].item() == pytest.approx(
        0.25 / math.pi * sky_irradiance(scene, torch.tensor([0.0, 1.0, 0.0]).view(1, 3, 1, 1))[0, 0].item(), rel=1e-4
    )
    lake = Scene(world=world((48, 4, 48), (WATER, (0, 0, 0), (48, 1, 48))), sun=Sun(direction=(0.0, 1.0, 0.0)))
    g = gbuffer(lake, above((4, 4)))
    radiance, _ = light(lake, g)
    assert g.albedo is not None
    want = 0.5 * g.albedo[0, 0] / math.pi * 3.2
    assert torch.allclose(radiance[0, 0], want, rtol=1e-4)


def test_the_sky_shows_itself_and_the_suns_disc():
    scene = Scene(world=world((4, 4, 4), (STONE, (0, 0, 0), (1, 1, 1))), sun=Sun(direction=(0.0, 0.5, -1.0)))
    camera = Camera.look_at((20.0, 2.0, 0.0), (20.0, 2.5, -1.0), size=(31, 41), fov_y=4.0)
    g = gbuffer(scene, camera)
    radiance, ambient = light(scene, g)
    way = camera.rays()[1].permute(0, 3, 1, 2)
    assert not g.hit.any()
    assert ambient.abs().max() == 0
    assert scene.sun is not None
    assert torch.allclose(radiance, sky_radiance(scene, way) + sun_radiance(scene.sun, way))
    assert radiance[0, 0, 15, 20] > 1000
    assert radiance[0, 0, 0, 0] < 20


def busy() -> tuple[Scene, Camera, GBuffer, torch.Tensor]:
    """Two cameras at two times over lamps, glass and a moving lamp."""
    model = world((2, 2, 2), (LAMP, (0, 0, 0), (2, 2, 2)))
    boxes = [(STONE, (20, 1, 18), (22, 6, 20)), (GLASS, (27, 1, 20), (29, 4, 30)), (LAMP, (24, 5, 24), (25, 6, 25))]
    scene = Scene(
        world=world((48, 8, 48), FLOOR, *boxes),
        instances=(Instance(model=model, pose=lambda t: pose((26.0 + t, 3.0, 17.0), yaw=0.5)),),
    )
    eyes = torch.tensor([[34.0, 10.0, 40.0], [14.0, 8.0, 36.0]])
    camera = Camera.look_at(eyes, (24.0, 1.0, 24.0), size=(33, 47))
    return scene, camera, gbuffer(scene, camera, time=[0.0, 2.0]), scene.poses([0.0, 2.0])


def test_batch_equals_loop_and_noise_repeats():
    scene, camera, g, poses = busy()
    radiance, ambient = light(scene, g, poses=poses, index=5)
    again, _ = light(scene, g, poses=poses, index=5)
    assert torch.equal(radiance, again)
    assert not torch.equal(radiance, light(scene, g, poses=poses, index=6)[0])
    assert not torch.equal(radiance, light(scene, g, poses=poses, index=5, seed=1)[0])
    for b, time in enumerate((0.0, 2.0)):
        one = Camera.from_intrinsics(camera.intrinsics[b], camera.world_from_view[b], size=camera.size)
        alone = light(scene, gbuffer(scene, one, time=time), poses=poses[b], index=5)
        assert torch.allclose(alone[0][0], radiance[b], atol=1e-5)
        assert torch.allclose(alone[1][0], ambient[b], atol=1e-6)


def test_a_lamp_that_moves_takes_its_light_along():
    scene, _, _, _ = busy()
    dark = Scene(world=scene.world, instances=scene.instances, sun=None, sky=DARK)
    camera = above((24, 24), height=2.9)
    brightest = []
    for time in (0.0, 6.0):
        g = gbuffer(dark, camera, time=time)
        near = torch.where(g.normal[0, 1] > 0.5, irradiance(dark, g, poses=dark.poses([time]))[0, 0], 0.0)
        lifted = near - irradiance(Scene(world=dark.world, sun=None, sky=DARK), g)[0, 0] * (g.normal[0, 1] > 0.5)
        brightest.append(int(lifted.flatten().argmax()) % 24)
    assert 4 <= brightest[1] - brightest[0] <= 8


def test_no_light_at_all_is_black_and_finite():
    scene = Scene(world=world((48, 4, 48), FLOOR), sun=None, sky=DARK)
    radiance, ambient = light(scene, gbuffer(scene, Camera.look_at((24, 5, 24), (24, 4, 0), size=(13, 17))), samples=1)
    assert radiance.abs().max() == 0
    assert ambient.abs().max() == 0


def test_bad_arguments_say_what_was_expected():
    scene, _, g, poses = busy()
    with pytest.raises(ValueError, match="samples must not be negative, got -1"):
        light(scene, g, poses=poses, samples=-1)
    with pytest.raises(ValueError, match=r"poses must be \(1,4,4\) or \(2,1,4,4\), got none"):
        light(scene, g)
    with pytest.raises(ValueError, match="gbuffer must have albedo"):
        light(scene, g.replace(albedo=None), poses=poses)
