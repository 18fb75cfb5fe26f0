"""Path-traced frames: closed forms, furnaces, the renderer, brute force; reflections of lamps."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
import torch
from voxels import DARK, EVEN_SKY, LAMP, STONE, TABLE, WATER, above, pose, random_scene, random_world, world

from gbufrt import Camera
from tracer.direct.lighting import light
from tracer.gbuffers import gbuffer
from tracer.paths.op import radiance
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Scene, Sun
from tracer.scene.world import World
from tracer.truth.truth import path_trace, reflection

SKY = torch.tensor(EVEN_SKY.zenith).view(1, 3, 1, 1)


def floor(height: int = 2, **material) -> World:
    """48x48 of one material, its top at y = 1."""
    table = MaterialTable.of([Material(name="floor", **{"variation": 0.0, **material})])
    voxels = torch.zeros(48, height, 48, dtype=torch.int16)
    voxels[:, 0] = 1
    return World.from_dense(voxels, table)


def test_a_matte_floor_under_an_even_sky_has_the_closed_form():
    scene = Scene(world=floor(albedo=(0.5, 0.6, 0.2), roughness=0.0), sun=None, sky=EVEN_SKY)
    camera = Camera.look_at((20, 9, 40), (24, 1, 28), size=(9, 8), fov_y=25.0)
    got = path_trace(scene, camera, samples=128, antialias=False)["radiance"]
    cosine = -camera.rays()[1][..., 1][:, None]
    mirrored = 0.04 + 0.96 * (1 - cosine) ** 5
    want = SKY * (torch.tensor([0.5, 0.6, 0.2]).view(1, 3, 1, 1) * (1 - mirrored) + mirrored)
    assert torch.allclose(got, want, rtol=0.06)
    assert abs(float((got / want).mean()) - 1) < 0.002


WHITE: dict[str, Any] = {"albedo": (1.0, 1.0, 1.0), "variation": 0.0}
FURNACES = {
    "metal": (0.999, Material(name="metal", metallic=1.0, roughness=0.0, **WHITE)),
    "rough metal": (0.9, Material(name="rough metal", metallic=1.0, roughness=0.3, **WHITE)),
    "stone": (0.99, Material(name="stone", roughness=0.0, **WHITE)),
    "rough stone": (0.95, Material(name="rough stone", roughness=0.8, **WHITE)),
    "alloy": (0.99, Material(name="alloy", metallic=0.5, roughness=0.0, **WHITE)),
    "glass": (0.99, Material(name="glass", opacity=0.4, roughness=0.0, **WHITE)),
}


@pytest.mark.parametrize("name", FURNACES)
def test_white_things_in_a_furnace_keep_their_light_and_send_no_more(name):
    kept, material = FURNACES[name]
    voxels = torch.rand(20, 12, 20, generator=torch.Generator().manual_seed(3)) < 0.04
    scene = Scene(world=World.from_dense(voxels.short(), MaterialTable.of([material])), sun=None, sky=EVEN_SKY)
    camera = Camera.look_at((30, 15, 24), (10, 6, 10), size=(16, 16), fov_y=30.0)
    found = path_trace(scene, camera, bounces=32, samples=64)
    got = (found["radiance"] / SKY).mean()
    noise = float(found.error["radiance"].mean()) / 16  # of a mean over the picture
    assert kept - 3 * noise < got < 1 + 1e-4 + 3 * noise


def test_unblocked_light_is_what_the_renderer_shows_without_shadows():
    stand = world((48, 8, 48), (STONE, (0, 0, 0), (48, 1, 48)), (STONE, (22, 1, 22), (26, 6, 26)))
    scene = Scene(world=stand, sun=Sun(direction=(0.5, 0.8, 0.2), angular_radius=1.0))
    g = gbuffer(scene, above(size=(40, 40), span=20.0))
    direct, ambient = light(scene, g, samples=16)
    shadow = direct.amax(dim=1, keepdim=True) < 0.5 * direct.amax()
    assert 20 < int(shadow.sum()) < 400
    first, second = (
        path_trace(scene, g.camera, unblocked=True, antialias=False, samples=2, seed=seed)["radiance"]
        for seed in (0, 1)
    )
    assert torch.equal(first, second)
    off = ((first / (direct + ambient) - 1).abs() > 5e-3).any(dim=1, keepdim=True)
    assert (off & ~shadow).float().mean() < 0.02  # its rim
    assert (first[shadow.expand_as(first)] > 1.2 * (direct + ambient)[shadow.expand_as(first)]).all()


def test_unblocked_lamps_show_and_light_nothing_else():
    stand = world((48, 6, 48), (STONE, (0, 0, 0), (48, 1, 48)), (LAMP, (22, 3, 22), (26, 4, 26)))
    scene, camera = Scene(world=stand, sun=None, sky=DARK), above(size=(40, 40), span=20.0)
    got = path_trace(scene, camera, unblocked=True, antialias=False, samples=1)["radiance"][0]
    shows = (got > 0).all(dim=0)
    assert int(shows.sum()) == 64
    assert torch.allclose(got[:, shows].mean(dim=1), torch.tensor([4.0, 3.0, 2.0]))
    assert got[:, ~shows].max() == 0


def test_next_event_estimation_agrees_with_brute_force(monkeypatch):
    table = MaterialTable.of(
        [
            Material(name="stone", albedo=(0.6, 0.5, 0.4)),
            Material(name="gloss", albedo=(0.3, 0.5, 0.4), roughness=0.5, metallic=0.5),
            Material(name="mirror", albedo=(0.9, 0.8, 0.7), roughness=0.1, metallic=1.0),
            Material(name="glass", opacity=0.3, roughness=0.1, tint=(0.9, 0.8, 0.7)),
            Material(name="lamp", emission=(3.0, 2.0, 1.0)),
        ]
    )
    voxels = torch.zeros(12, 8, 12, dtype=torch.int16)
    voxels[:, 0], voxels[0], voxels[:, :, 0] = 1, 2, 3
    voxels[6:8, 1:3, 6:8], voxels[3:5, 3:5, 8:10], voxels[8:11, 1:4, 3] = 1, 5, 4
    world_ = World.from_dense(voxels, table)
    lantern = Instance(
        model=world((2, 2, 2), (LAMP, (0, 0, 0), (2, 2, 2))), pose=lambda t: pose((9.0, 4.0, 8.0), yaw=0.5), scale=0.5
    )
    scene = Scene(world=world_, instances=(lantern,), sun=Sun(direction=(0.5, 0.9, 0.6), angular_radius=25.0))
    camera = Camera.look_at((11.5, 6, 11.5), (4, 1, 4), size=(12, 12), fov_y=60.0)
    ours = path_trace(scene, camera, bounces=2, samples=512)
    monkeypatch.setattr("tracer.truth.path_tracer.radiance", partial(radiance, next_event=False))
    brute = path_trace(scene, camera, bounces=2, samples=2048, seed=1)
    assert ours.error["radiance"].mean() < 0.6 * 2 * brute.error["radiance"].mean()
    off = (ours["radiance"] - brute["radiance"]) / (ours.error["radiance"] ** 2 + brute.error["radiance"] ** 2).sqrt()
    assert off.mean().abs() < 0.15
    assert off.square().mean() < 1.6
    assert (ours["radiance"].mean() / brute["radiance"].mean() - 1).abs() < 0.01


def test_direct_light_agrees_with_the_renderer(monkeypatch):
    monkeypatch.setattr("tracer.lights.sky.GLOW", ())
    table = MaterialTable.of([Material(name="floor", roughness=0.0), Material(name="lamp", emission=(4.0, 3.0, 2.0))])
    voxels = torch.zeros(48, 6, 48, dtype=torch.int16)
    voxels[:, 0], voxels[22:24, :4, 22:24], voxels[26:28, 3:5, 26] = 1, 1, 2
    sun = Sun(direction=(0.5, 0.8, 0.2), angular_radius=3.0)  # from above no mirror shows sun or lamp
    scene = Scene(world=World.from_dense(voxels, table), sky=DARK, sun=sun)
    g = gbuffer(scene, above(span=12.0))
    want, _ = light(scene, g, samples=256)
    assert g.emission is not None
    want = g.emission + 0.96 * (want - g.emission)  # from straight above: the rest is reflected
    got = path_trace(scene, g.camera, bounces=0, samples=256, antialias=False)["radiance"]
    lit = want > 0.01
    assert float(want[lit].std()) > 0.1
    assert (got[lit] / want[lit] - 1).abs().mean() < 0.02
    assert got[~lit].max() < 0.02
    assert abs(float(got.sum() / want.sum()) - 1) < 0.005


def test_a_mirror_shows_the_lamp_over_it():
    lamp = (2, (20, 5, 20), (28, 6, 28))
    table = MaterialTable.of(
        [
            Material(name="mirror", albedo=(0.9, 0.8, 0.7), metallic=1.0, roughness=0.0, variation=0.0),
            Material(name="lamp", emission=(4.0, 3.0, 2.0)),
        ]
    )
    voxels = torch.zeros(48, 6, 48, dtype=torch.int16)
    voxels[:, 0], voxels[20:28, 5, 20:28] = 1, lamp[0]
    scene = Scene(world=World.from_dense(voxels, table), sun=None, sky=DARK)
    camera = Camera.look_at((24, 3, 23.5), (24, 1, 24), size=(8, 8), fov_y=30.0)
    g = gbuffer(scene, camera)
    found = reflection(scene, g, samples=4)
    way = camera.rays()[1].permute(0, 3, 1, 2)
    f0 = torch.tensor([0.9, 0.8, 0.7]).view(1, 3, 1, 1)
    want = (f0 + (1 - f0) * (1 + way[:, 1:2]) ** 5) * torch.tensor([4.0, 3.0, 2.0]).view(1, 3, 1, 1)
    assert torch.allclose(found["reflection"], want, rtol=1e-3)
    assert torch.allclose(found["distance"], 4 / -way[:, 1:2], rtol=1e-3)
    assert found["onscreen"].max() == 0  # the lamp's underside is above the picture
    assert found["reflection_onscreen"].max() == 0
    both = gbuffer(scene, Camera.look_at((24, 3, 8), (24, 2.8, 24), size=(64, 64), fov_y=50.0))
    found = reflection(scene, both, samples=4)
    shows = both.hit & (both.normal[:, 1:2] > 0.9) & (found["distance"] < 100)
    assert shows.sum() > 100
    assert found["onscreen"][shows].mean() > 0.9
    assert torch.allclose(found["reflection_onscreen"], found["reflection"] * found["onscreen"], rtol=1e-3)


def test_lamps_in_rough_surfaces_are_the_same_by_mirrored_rays_and_by_rays_to_lamps(monkeypatch):
    scene = Scene(
        world=world((48, 6, 48), (STONE, (0, 0, 0), (48, 1, 48)), (LAMP, (22, 4, 22), (27, 6, 26))), sun=None, sky=DARK
    )
    g = gbuffer(scene, Camera.look_at((24, 3, 14), (24, 1, 22), size=(10, 10), fov_y=40.0))
    g = g.replace(roughness=torch.full_like(g.depth, 0.5))
    found = []
    for bound in (0.0, 1.1):
        monkeypatch.setattr("tracer.truth.truth.LAMP_ROUGHNESS", bound)
        found.append(reflection(scene, g, samples=512)["reflection"])
    assert float(found[0].mean()) > 0.01
    assert abs(float(found[0].mean() / found[1].mean()) - 1) < 0.02


def test_light_from_behind_water_is_dimmed_as_the_gbuffer_says():
    scene = Scene(
        world=world((48, 6, 48), (LAMP, (0, 0, 0), (48, 1, 48)), (WATER, (0, 1, 0), (48, 3, 48))), sun=None, sky=DARK
    )
    camera = above(span=6.0)
    g = gbuffer(scene, camera)
    assert g.transmittance is not None
    want = 0.96 * g.transmittance * torch.tensor([4.0, 3.0, 2.0]).view(1, 3, 1, 1)  # the rest is reflected
    got = path_trace(scene, camera, bounces=0, samples=256)
    assert (got["radiance"].mean(dim=(0, 2, 3)) / want.mean(dim=(0, 2, 3)) - 1).abs().max() < 0.02


def test_pictures_of_a_batch_do_not_influence_each_other():
    scene = random_scene(2)
    eyes, times = [(25.0, 18.0, 22.0), (-25.0, 12.0, 8.0)], [0.0, 1.0]
    both = path_trace(scene, Camera.look_at(eyes, (0, 4, 0), size=(7, 9)), time=times, samples=2, aperture_radius=0.3)
    for b in range(2):
        one = path_trace(
            scene, Camera.look_at(eyes[b], (0, 4, 0), size=(7, 9)), time=times[b], samples=2, aperture_radius=0.3
        )
        assert torch.equal(both["radiance"][b : b + 1], one["radiance"])
    assert both["radiance"].isfinite().all()
    g = gbuffer(scene, Camera.look_at(eyes, (0, 4, 0), size=(7, 9)), time=times)
    mirrored_ = reflection(scene, g, poses=scene.poses(times), samples=2)
    alone = gbuffer(scene, Camera.look_at(eyes[1], (0, 4, 0), size=(7, 9)), time=times[1])
    again = reflection(scene, alone, poses=scene.poses(times[1:]), samples=2)
    for name, value in again.values.items():
        assert torch.equal(mirrored_[name][1:], value)


def test_one_sample_honours_the_jitter_and_the_odd_size():
    scene = Scene(world=random_world(5), sun=None, sky=EVEN_SKY)
    camera = Camera.look_at((60, 40, 50), (18, 8, 20), size=(73, 127)).with_jitter((0.3, -0.4))
    g = gbuffer(scene, camera)
    assert g.emission is not None
    got = path_trace(scene, camera, samples=1, antialias=False)
    shines = (g.emission > 0) & g.hit
    assert (got["radiance"][shines] >= g.emission[shines] - 1e-4).all()
    assert torch.allclose(
        got["radiance"][~g.hit.expand(-1, 3, -1, -1)], SKY.expand_as(got["radiance"])[~g.hit.expand(-1, 3, -1, -1)]
    )
    assert got.error["radiance"].isinf().all()


def test_wrong_arguments_are_named():
    scene, camera = Scene(world=floor()), above()
    wrong: list[dict[str, Any]] = [{"bounces": -1}, {"samples": 0}, {"shutter": -1.0}, {"aperture_radius": -1.0}]
    for argument in wrong:
        with pytest.raises(ValueError, match=next(iter(argument))):
            path_trace(scene, camera, **argument)
    with pytest.raises(ValueError, match="focus_distance must be positive"):
        path_trace(scene, camera, aperture_radius=1.0, focus_distance=0.0)
    with pytest.raises(ValueError, match="no voxels"):
        path_trace(Scene(world=World.from_dense(torch.zeros(1, 1, 1, dtype=torch.int16), TABLE)), camera)
