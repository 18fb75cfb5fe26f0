"""Light at one sample a pixel, and the same samples again in a scene that has changed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
import voxels
from torch import Tensor
from voxels import DARK, LAMP, STONE

from gbufrt import Camera
from gbufrt.frame import Frame
from post.shading.composite_op import specular_albedo
from tracer.frames import render, unlit
from tracer.gbuffers import gbuffer
from tracer.paths.one_sample import brightest_a_stratum, one_a_stratum, sample_light
from tracer.paths.sampled import sampled, sampled_with_cache
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Haze, Instance, Scene, Sky, Sun
from tracer.scene.world import World
from tracer.truth.path_tracer import path_trace
from tracer.truth.truth import light_truth

COLOR = (0.5, 0.6, 0.7)
EVEN = Sky(zenith=COLOR, horizon=COLOR, ground=COLOR)
NAMES = ("direct", "indirect", "specular", "distance", "shadow")


def camera(*, size: tuple[int, int] = (10, 13)) -> Camera:
    return Camera.look_at((8.0, 9.0, 24.0), (8.0, 2.0, 6.0), size=size, far=100.0)


def room(*, lamp: bool = True) -> Scene:
    """A lamp on a floor beside a wall, and a block that moves along it, in the dark."""
    table = MaterialTable.of(
        [
            Material(name="stone", albedo=(0.7, 0.6, 0.5), roughness=0.4),
            *(Material(name=name) for name in ("glass", "water")),
            Material(name="lamp", emission=(4.0, 3.0, 2.0) if lamp else (0.0, 0.0, 0.0)),
        ]
    )
    boxes = ((STONE, (0, 0, 0), (16, 2, 16)), (STONE, (0, 2, 0), (16, 9, 1)), (LAMP, (7, 5, 3), (9, 7, 5)))
    block = voxels.world((3, 3, 3), (STONE, (0, 0, 0), (3, 3, 3)))
    mover = Instance(model=replace(block, materials=table), pose=lambda t: voxels.pose((2.0 + t, 2.0, 6.0), yaw=t))
    world = replace(voxels.world((16, 12, 16), *boxes), materials=table)
    return Scene(world=world, instances=(mover,), sun=None, sky=DARK)


def frame(scene: Scene, index: int, time: float = 0.0) -> Frame:
    return render(scene, camera(), time=time, index=index, light_samples=1)


def floor(sun: Sun | None) -> Scene:
    table = MaterialTable.of([Material(name="floor", albedo=(0.5, 0.3, 0.1), variation=0.0)])
    flat = torch.zeros(48, 2, 48, dtype=torch.int16)
    flat[:, 0] = 1
    return Scene(world=World.from_dense(flat, table), sun=sun, sky=EVEN)


def test_an_open_floor_gets_all_of_the_sun():
    scene = floor(Sun(direction=(0.3, 0.8, 0.2), irradiance=(3.0, 2.0, 1.0)))
    light = sample_light(scene, gbuffer(scene, voxels.above()))
    cosine = 0.8 / math.hypot(0.3, 0.8, 0.2)
    want = torch.tensor([3.0, 2.0, 1.0]).view(1, 3, 1, 1) * cosine / math.pi
    torch.testing.assert_close(light.direct, want.expand_as(light.direct), rtol=0.01, atol=0)
    assert bool((light.shadow == torch.tensor([1.0, 0.0]).view(1, 2, 1, 1)).all())


def test_rough_surfaces_reflect_the_sun():
    table = MaterialTable.of([Material(name="coal", albedo=(0.0, 0.0, 0.0), roughness=0.5, variation=0.0)])
    lit = floor(Sun(direction=(0.3, 0.8, 0.2), irradiance=(3.0, 2.0, 1.0)))
    scene = replace(lit, world=replace(lit.world, materials=table), sky=DARK)
    light = light_truth(scene, gbuffer(scene, voxels.above()), samples=128)
    want = path_trace(scene, voxels.above(), samples=128, antialias=False).values["radiance"]
    assert float(want.mean()) > 0.01
    torch.testing.assert_close(light.specular.mean(), want.mean(), rtol=0.01, atol=0)


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_all_light_after_any_bounce_is_that_of_the_path_tracer(metallic: float):
    """In a gallery most of what a mirror shows has bounced before."""
    scene, inside = voxels.gallery(metallic)
    g = gbuffer(scene, inside)
    light = light_truth(scene, g, bounces=3, samples=64)
    want = path_trace(scene, inside, bounces=3, samples=64, antialias=False).values["radiance"]
    assert g.albedo is not None
    assert g.emission is not None
    got = g.emission + g.albedo * (1 - specular_albedo(g)) * light.diffuse + light.specular
    matt = g.hit & (g.emission.sum(1, keepdim=True) == 0)
    torch.testing.assert_close((got * matt).mean((0, 2, 3)), (want * matt).mean((0, 2, 3)), rtol=0.02, atol=0)


def test_an_open_floor_gets_all_of_an_even_sky():
    scene = floor(None)
    light = sample_light(scene, gbuffer(scene, voxels.above()))
    torch.testing.assert_close(light.diffuse, torch.tensor(COLOR).view(1, 3, 1, 1).expand_as(light.diffuse))
    assert not bool(light.direct.any())
    assert set(light.distance.unique().tolist()) == {0.0, voxels.above().far}


def test_its_mean_is_the_truth_and_its_noise_that_of_index_and_seed():
    scene = room()
    g, poses = gbuffer(scene, camera()), scene.poses([0.0])
    light = [sample_light(scene, g, poses=poses, index=i % 32, seed=i // 32).direct for i in range(64)]
    truth = light_truth(scene, g, poses=poses, samples=64, seed=9)
    assert float((sum(light) / 64 - truth.direct).abs().mean() / truth.direct.mean()) < 0.08
    again = sample_light(scene, g, poses=poses, index=3)
    assert torch.equal(again.direct, light[3])
    assert not torch.equal(light[3], light[4])
    assert not torch.equal(light[3], light[35])
    shadowed, bright = (again.shadow[:, 1] == 0) & g.hit[:, 0], again.direct.sum(1) > 0
    assert torch.equal(shadowed, g.hit[:, 0] & ~bright)


@pytest.mark.parametrize("size", [(9, 12), (10, 13), (1, 2)])
def test_one_pixel_of_every_square_is_chosen_and_each_once_in_nine_frames(size):
    everywhere = torch.ones(2, 1, *size, dtype=torch.bool)
    chosen = torch.stack([one_a_stratum(everywhere, index=index) for index in range(9)]).int()
    assert int(chosen.sum(dim=(2, 3, 4)).amin()) >= (size[0] // 3) * (size[1] // 3)
    assert int(chosen.sum(dim=0).amin()) >= 1
    if min(size) >= 9:
        assert int(chosen.sum(dim=0).amax()) == 1
    assert not bool(one_a_stratum(~everywhere).any())


@pytest.mark.parametrize("size", [(9, 12), (10, 13), (1, 2)])
def test_the_brightest_pixel_of_every_square_is_chosen(size):
    light = torch.rand(2, 1, *size, generator=torch.Generator().manual_seed(4))
    hit = torch.rand(2, 1, *size, generator=torch.Generator().manual_seed(5)) < 0.7
    chosen = brightest_a_stratum(hit, light)
    for picture in range(2):
        for row in range(0, size[0], 3):
            for column in range(0, size[1], 3):
                square = picture, 0, slice(row, row + 3), slice(column, column + 3)
                seen = torch.where(hit[square], light[square], -1.0)
                assert torch.equal(chosen[square], (seen == seen.max()) & hit[square])
    assert int(brightest_a_stratum(hit, 0 * light).sum()) <= math.ceil(size[0] / 3) * math.ceil(size[1] / 3) * 2


def test_the_brightest_samples_of_the_frame_before_are_replayed():
    scene = room()
    before = sampled(scene, frame(scene, 4))
    chosen = sampled(scene, frame(scene, 5), before=before).read("replayed") > 0
    light = (before.read("diffuse") * before.read("albedo") + before.read("specular")).sum(1, keepdim=True)
    assert float(light[chosen].mean()) > 1.5 * float(light[before.gbuffer.hit].mean())
    in_turn = one_a_stratum(before.gbuffer.hit, index=4)
    assert torch.equal(sampled(scene, frame(scene, 5), before=frame(scene, 4)).read("replayed") > 0, in_turn)
    after, _ = sampled_with_cache(scene, frame(scene, 5), before=before)
    assert torch.equal(after.read("replayed") > 0, in_turn), "the others may have read the cache"


def test_samples_of_a_scene_that_stays_are_the_same_again():
    scene = room()
    before, after = frame(scene, 4), frame(scene, 5)
    result = sampled(scene, after, before=before)
    first, chosen = sampled(scene, before), result.read("replayed") > 0
    assert first.replayed is None
    result.validate()
    for name in ("diffuse", "specular"):
        again, then = result.read(f"replayed_{name}"), first.read(name)
        assert bool(then.any())
        assert torch.equal(again, torch.where(chosen, then, 0.0))
    assert not torch.equal(result.read("diffuse"), first.read("diffuse"))


def test_a_lamp_that_goes_out_leaves_replayed_samples_dark():
    before = frame(room(), 4)
    dark = sampled(room(lamp=False), frame(room(lamp=False), 5), before=before)
    assert bool(sampled(room(), before).read("diffuse").any())
    assert not bool(dark.read("replayed_diffuse").any())
    assert not bool(dark.read("replayed_specular").any())


def test_samples_are_carried_along_with_their_instance():
    """A corner alone in the light of the sun, which is the same everywhere, sends the same light wherever it is."""
    model = voxels.world((3, 3, 3), (STONE, (0, 0, 0), (3, 1, 3)), (STONE, (0, 1, 0), (1, 3, 3)))
    mover = Instance(model=model, pose=lambda t: voxels.pose((7.0 + 3 * t, 2.0, 6.0 - 2 * t), yaw=0.4))
    scene = Scene(world=replace(model, bricks=torch.zeros_like(model.bricks)), instances=(mover,), sky=DARK)
    g = gbuffer(scene, Camera.look_at((12.0, 6.0, 12.0), (9.0, 3.0, 7.0), size=(10, 13)))
    still = sample_light(scene, g, poses=scene.poses([0.0]), index=6)
    moved = sample_light(scene, g, poses=scene.poses([1.0]), poses_then=scene.poses([0.0]), index=6)
    left = sample_light(scene, g, poses=scene.poses([1.0]), index=6)
    assert bool(still.indirect.any())
    same(moved.diffuse, still.diffuse)
    assert not torch.allclose(left.diffuse, still.diffuse, rtol=1e-3)


def same(a: Tensor, b: Tensor) -> None:
    torch.testing.assert_close(a, b, rtol=1e-3, atol=1e-4)


def test_batch_equals_loop():
    scene, poses = room(), room().poses([0.0, 1.0])
    both = Camera.look_at(torch.tensor([(8.0, 9.0, 24.0), (3.0, 7.0, 20.0)]), (8.0, 2.0, 6.0), size=(9, 8))
    g = gbuffer(scene, both, time=[0.0, 1.0])
    together = sample_light(scene, g, poses=poses, index=1)
    for b in range(2):
        one = Camera.look_at(((8.0, 9.0, 24.0), (3.0, 7.0, 20.0))[b], (8.0, 2.0, 6.0), size=(9, 8))
        alone = sample_light(scene, gbuffer(scene, one, time=float(b)), poses=poses[b], index=1)
        for name in NAMES:
            torch.testing.assert_close(getattr(together, name)[b : b + 1], getattr(alone, name))


def test_bad_values_are_told():
    scene = room()
    g = gbuffer(scene, camera())
    with pytest.raises(ValueError, match="bounces must be at least 1, got 0"):
        sample_light(scene, g, poses=scene.poses([0.0]), bounces=0)
    with pytest.raises(ValueError, match="albedo"):
        sample_light(scene, g.replace(albedo=None), poses=scene.poses([0.0]))


def test_the_frame_before_needs_no_light():
    scene = room()
    now, before = frame(scene, 5), frame(scene, 4)
    want = sampled(scene, now, before=before)
    got = sampled(scene, now, before=unlit(scene, camera(), index=4))
    for name in ("replayed", "replayed_diffuse", "replayed_specular"):
        assert torch.equal(got.read(name), want.read(name))


def test_mirrors_show_haze_before_what_is_far():
    """A mirror before a black wall: what it shows of the wall is as grey as a wall as far away would be."""
    table = MaterialTable.of(
        [
            Material(name="mirror", albedo=(1.0, 1.0, 1.0), roughness=0.0, metallic=1.0, variation=0.0),
            Material(name="coal", albedo=(0.0, 0.0, 0.0), roughness=0.0, metallic=1.0, variation=0.0),
        ]
    )
    boxes = ((1, (0, 0, 0), (60, 2, 60)), (2, (0, 2, 0), (60, 40, 1)))
    world = replace(voxels.world((60, 40, 60), *boxes), materials=table)
    haze = Haze(begin=30.0, end=70.0)  # behind all of the floor that is seen
    scene = Scene(world=world, sun=None, sky=EVEN, haze=haze)
    eye = Camera.look_at((30.0, 6.0, 50.0), (30.0, 2.0, 36.0), size=(10, 13), fov_y=10.0, far=200.0)
    seen = gbuffer(scene, eye)
    light = sample_light(scene, seen)
    ways = eye.rays()[1].movedim(-1, 1)
    x = (49.0 * ways[:, ::2].norm(dim=1, keepdim=True) / -ways[:, 2:3] - haze.begin) / (haze.end - haze.begin)
    want = (x * x * (3 - 2 * x)) * torch.tensor(COLOR).view(1, 3, 1, 1)
    assert float(want.min()) > 0.1
    torch.testing.assert_close(light.specular, want, rtol=0, atol=2e-3)
    assert float(sample_light(replace(scene, haze=None), seen).specular.max()) < 1e-4
