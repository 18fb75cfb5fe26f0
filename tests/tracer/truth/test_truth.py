"""Truth by rays: occlusion, indirect light and what the picture shows of it, against closed forms."""

from __future__ import annotations

import inspect
import math
from typing import Any

import pytest
import torch
import torch.nn.functional as F
from voxels import EVEN_SKY, GLASS, STONE, points_of, pose, random_world, world
from walls import WALL, WHITE, above, albedo_of, corner

from gbufrt import Camera
from tracer.gbuffers import gbuffer
from tracer.scene.scene import Instance, Scene
from tracer.scene.world import World
from tracer.traversal.rays import transmission
from tracer.truth.truth import ambient_occlusion, indirect_diffuse, path_trace, reflection


def rmse(a: torch.Tensor, b: torch.Tensor) -> float:
    return float((a - b).square().mean().sqrt())


def test_a_floor_beside_a_wall_is_occluded_as_the_closed_form_says():
    scene = corner()
    g = gbuffer(scene, above(WALL - 2.0, 48.0))
    found = ambient_occlusion(scene, g, radius=2.0, samples=256)
    # the wall within reach cuts a segment off the unit disc that the cosine-weighted hemisphere projects to
    c = ((WALL - points_of(g)[:, :1]) / 2.0).clamp(0, 1)
    want = 1 - (c.acos() - c * (1 - c * c).sqrt()) / math.pi
    assert want.min() < 0.61
    assert rmse(found["ao"], want) < 0.008
    assert (found["ao"] - want).mean().abs() < 0.001


def test_an_endless_wall_hides_half_the_sky_and_bends_the_normal_away():
    scene = corner(height=240)
    g = gbuffer(scene, above(WALL - 1.0, 48.0, size=(3, 9), span=0.5, height=100.0))
    found = ambient_occlusion(scene, g, radius=math.inf, samples=256)
    assert (found["ao"] - 0.5).abs().mean() < 0.02
    want = F.normalize(torch.tensor([-4 / (3 * math.pi), 2 / 3, 0.0]), dim=0)
    assert (found["bent_normal"] * want[:, None, None]).sum(1).min() > 0.998


def test_the_bottom_of_an_open_box_sees_the_sky_through_its_mouth():
    boxes = [(STONE, (0, 0, 0), (12, 1, 12))]
    boxes += [(STONE, (0, 1, 0), (1, 7, 12)), (STONE, (11, 1, 0), (12, 7, 12))]
    boxes += [(STONE, (1, 1, 0), (11, 7, 1)), (STONE, (1, 1, 11), (11, 7, 12))]
    scene = Scene(world=world((12, 7, 12), *boxes), sun=None, sky=EVEN_SKY)
    g = gbuffer(scene, above(6.0, 6.0, size=(9, 9), span=9.0))
    p = points_of(g)
    want = torch.zeros_like(g.depth)
    for a in (p[:, 0:1] - 1, 11 - p[:, 0:1]):
        for b in (p[:, 2:3] - 1, 11 - p[:, 2:3]):
            a6, b6 = a / 6, b / 6
            sa, sb = (1 + a6 * a6).sqrt(), (1 + b6 * b6).sqrt()
            want = want + (a6 / sa * (b6 / sa).atan() + b6 / sb * (a6 / sb).atan()) / (2 * math.pi)
    found = ambient_occlusion(scene, g, radius=math.inf, samples=256)
    light = indirect_diffuse(scene, g, samples=256, seed=1)
    for got in (found["ao"], light["sky_visibility"]):
        assert rmse(got, want) < 0.012
        assert (got - want).mean().abs() < 0.002
    sky = albedo_of(g) * torch.tensor(EVEN_SKY.zenith).view(1, 3, 1, 1) * light["sky_visibility"]
    assert torch.allclose(light["sky"], sky, rtol=1e-4)


def test_an_open_plane_is_open_and_a_closed_box_is_not():
    floor = Scene(world=world((48, 2, 48), (STONE, (0, 0, 0), (48, 1, 48))), sun=None)
    g = gbuffer(floor, above(24.0, 24.0))
    found = ambient_occlusion(floor, g, radius=math.inf, samples=8)
    assert found["ao"].min() == 1
    assert (found["bent_normal"] - g.normal).abs().max() < 0.4
    shell = torch.ones(8, 8, 8, dtype=torch.int16)
    shell[1:-1, 1:-1, 1:-1] = 0
    room = Scene(world=World.from_dense(shell, WHITE))
    inside = gbuffer(room, Camera.look_at((2, 4, 4), (6, 3.3, 4), size=(7, 9)))
    closed = ambient_occlusion(room, inside, radius=math.inf, samples=8)
    assert closed["ao"].max() == 0
    assert torch.equal(closed["bent_normal"], inside.normal)
    light = indirect_diffuse(room, inside, samples=8, bounces=2)
    assert all(light[name].max() == 0 for name in ("gi", "gi_onscreen", "sky", "sky_visibility"))


def test_glass_blocks_the_light_that_it_stops():
    plate = (GLASS, (0, 3, 0), (48, 4, 48))
    scene = Scene(world=world((48, 5, 48), (STONE, (0, 0, 0), (48, 1, 48)), plate), sun=None, sky=EVEN_SKY)
    camera = Camera.look_at((24, 2.5, 24), (24, 1, 25), size=(8, 8), fov_y=60.0)
    g = gbuffer(scene, camera)
    light = indirect_diffuse(scene, g, samples=256)
    u = torch.rand(2, 20000, generator=torch.Generator().manual_seed(1))
    way = torch.stack(
        [u[0].sqrt() * (2 * math.pi * u[1]).cos(), (1 - u[0]).sqrt(), u[0].sqrt() * (2 * math.pi * u[1]).sin()], 1
    )
    through = transmission(scene, torch.tensor([[24.0, 1.01, 24.0]]).expand_as(way), way).mean(dim=0)
    assert float(through.mean()) < 0.7
    got = (light["sky"] / albedo_of(g) / torch.tensor(EVEN_SKY.zenith).view(1, 3, 1, 1))[:, :, 4:].mean(dim=(0, 2, 3))
    assert torch.allclose(got, through, rtol=0.02)


def test_moving_things_block_where_they_are():
    scene = Scene(
        world=world((48, 2, 48), (STONE, (0, 0, 0), (48, 1, 48))),
        instances=(
            Instance(model=world((8, 2, 8), (STONE, (0, 0, 0), (8, 2, 8))), pose=lambda t: pose((20.0 + t, 3.0, 20.0))),
        ),
        sun=None,
    )
    camera = Camera.look_at((24, 2.5, 28.5), (24, 1, 26), size=(6, 9), fov_y=30.0)
    g = gbuffer(scene, camera)
    under = ambient_occlusion(scene, g, poses=scene.poses([0.0]), radius=math.inf, samples=32)["ao"]
    away = ambient_occlusion(scene, g, poses=scene.poses([500.0]), radius=math.inf, samples=32)["ao"]
    assert under.mean() < 0.6
    assert away.min() == 1
    with pytest.raises(ValueError, match="poses must be"):
        ambient_occlusion(scene, g)


@pytest.mark.parametrize("call", [ambient_occlusion, indirect_diffuse])
def test_pictures_of_a_batch_do_not_influence_each_other(call):
    scene = Scene(world=random_world(5))
    cameras = Camera.look_at([(60, 40, 50), (-20, 30, 5)], (18, 8, 20), size=(9, 7), fov_y=40.0)
    both = call(scene, gbuffer(scene, cameras), samples=3)
    for b in range(2):
        one = Camera.look_at([(60, 40, 50), (-20, 30, 5)][b], (18, 8, 20), size=(9, 7), fov_y=40.0)
        alone = call(scene, gbuffer(scene, one), samples=3)
        for name, value in alone.values.items():
            assert torch.equal(both[name][b : b + 1], value)


@pytest.mark.parametrize("call", [ambient_occlusion, indirect_diffuse])
def test_pictures_of_sky_alone_and_of_one_pixel(call):
    scene = Scene(world=random_world(5))
    for size, target in (((4, 6), (0, 500, 1)), ((1, 1), (18, 8, 20)), ((73, 127), (18, 8, 20))):
        g = gbuffer(scene, Camera.look_at((60, 40, 50), target, size=size))
        found = call(scene, g, samples=2)
        for name, value in found.values.items():
            assert value.isfinite().all()
            clear = 1.0 if name in ("ao", "ao_onscreen", "sky_visibility") else 0.0
            assert (value[~g.hit.expand_as(value)] == clear).all()


def test_it_stops_at_a_noise_level_and_tells_how_far_it_is():
    scene, told = corner(), []
    g = gbuffer(scene, above(WALL - 2.0, 48.0))

    def progress(done: int, of: int) -> None:
        told.append((done, of))

    whole = ambient_occlusion(scene, g, samples=256, progress=progress)
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    assert told[-1] == (256, 256) == (whole.samples, told[0][1])
    level = 2 * float(whole.error["ao"][g.hit].mean())
    early = ambient_occlusion(scene, g, samples=256, noise=level)
    assert 16 <= early.samples < whole.samples
    assert float(early.error["ao"][g.hit].mean()) <= level
    assert rmse(early["ao"], whole["ao"]) < 3 * level
    assert ambient_occlusion(scene, g, samples=256, noise=level / 100).samples == 256


def test_wrong_arguments_are_named():
    scene = corner()
    g = gbuffer(scene, above(WALL - 2.0, 48.0))
    with pytest.raises(ValueError, match="radius must be positive"):
        ambient_occlusion(scene, g, radius=0.0)
    with pytest.raises(ValueError, match="bounces must be at least 1"):
        indirect_diffuse(scene, g, bounces=0)
    with pytest.raises(ValueError, match="samples must be at least 1"):
        ambient_occlusion(scene, g, samples=0)
    with pytest.raises(ValueError, match="noise must be"):
        ambient_occlusion(scene, g, noise=-1.0)
    with pytest.raises(ValueError, match="must have albedo"):
        indirect_diffuse(scene, g.replace(albedo=None))


@pytest.mark.parametrize("function", [ambient_occlusion, indirect_diffuse, reflection, path_trace])
def test_docstrings_name_what_a_truth_holds(function: Any):
    scene, camera = corner(), above(20.0, 48.0, size=(2, 3))
    found = function(scene, camera if function is path_trace else gbuffer(scene, camera), samples=2)
    doc = " ".join(str(inspect.getdoc(function)).split())
    assert not [name for name in found.values if f'["{name}"]' not in doc]
