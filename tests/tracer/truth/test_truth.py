from __future__ import annotations

import inspect
import math
from typing import Any

import pytest
import torch
import torch.nn.functional as F
from voxels import GLASS, STONE, pose, random_world, world

from gbufrt import Camera, GBuffer
from tracer.gbuffers import gbuffer
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Scene, Sky, Sun
from tracer.scene.world import World
from tracer.traversal.rays import transmission
from tracer.truth.truth import ambient_occlusion, indirect_diffuse, path_trace, reflection

WHITE = MaterialTable.of([Material(name="white", albedo=(1.0, 1.0, 1.0), variation=0.0)])
EVEN = Sky(zenith=(0.5, 0.6, 0.7), horizon=(0.5, 0.6, 0.7), ground=(0.5, 0.6, 0.7))
DARK = Sky(zenith=(0.0, 0.0, 0.0), horizon=(0.0, 0.0, 0.0), ground=(0.0, 0.0, 0.0))
WALL = 32  # x of the face of the wall beside the floor of `corner`


def above(x: float, z: float, *, size: tuple[int, int] = (9, 11), span: float = 3.0, height: float = 30.0) -> Camera:
    """Looks straight down; picture right is +x."""
    return Camera.look_at((x, height, z), (x, 0.0, z), size=size, up=(0.0, 0.0, -1.0), orthographic_height=span)


def corner(*, height: int = 24, **kw) -> Scene:
    """A floor whose top is at y = 1, and a wall on its +x side."""
    floor, wall = (STONE, (0, 0, 0), (WALL, 1, 96)), (STONE, (WALL, 0, 0), (WALL + 1, 1 + height, 96))
    return Scene(world=world((WALL + 1, 1 + height, 96), floor, wall), sun=None, **kw)


def points_of(g: GBuffer) -> torch.Tensor:
    return g.camera.to_world(g.points_view())


def albedo_of(g: GBuffer) -> torch.Tensor:
    assert g.albedo is not None
    return g.albedo


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
    scene = Scene(world=world((12, 7, 12), *boxes), sun=None, sky=EVEN)
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
    sky = albedo_of(g) * torch.tensor(EVEN.zenith).view(1, 3, 1, 1) * light["sky_visibility"]
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


def test_a_white_furnace_stays_as_bright_as_its_sky():
    voxels = torch.rand(20, 12, 20, generator=torch.Generator().manual_seed(3)) < 0.04
    scene = Scene(world=World.from_dense(voxels.short(), WHITE), sun=None, sky=EVEN)
    g = gbuffer(scene, Camera.look_at((40, 20, 30), (10, 6, 10), size=(16, 16), fov_y=20.0))
    light = indirect_diffuse(scene, g, bounces=12, samples=64)
    got = (light["gi"] + light["sky"]) / torch.tensor(EVEN.zenith).view(1, 3, 1, 1)
    assert g.hit.float().mean() > 0.4
    assert light["sky_visibility"][g.hit].mean() < 0.9
    assert (got[g.hit.expand_as(got)] - 1).abs().mean() < 0.001


def test_light_in_a_closed_room_of_lamps_adds_up_to_the_geometric_series():
    share, emission = 0.5, 2.0
    lamp = Material(name="lamp", albedo=(share, share, share), emission=(emission, emission, emission), variation=0.0)
    shell = torch.ones(8, 6, 7, dtype=torch.int16)
    shell[1:-1, 1:-1, 1:-1] = 0
    scene = Scene(world=World.from_dense(shell, MaterialTable.of([lamp])))
    g = gbuffer(scene, Camera.look_at((2, 4, 3), (6, 2, 4.2), size=(24, 24)))
    for bounces in (1, 3):
        gi = indirect_diffuse(scene, g, bounces=bounces, samples=64)["gi"].mean()
        want = emission * sum(share**k for k in range(2, bounces + 2))
        assert abs(float(gi) - want) < 0.02 * want


def test_sunlight_reflected_by_a_wall_is_energy_that_arrived_there(monkeypatch):
    monkeypatch.setattr("tracer.lights.sky.GLOW", ())
    scene = corner(height=24, sky=DARK)
    scene = Scene(world=scene.world, sky=DARK, sun=Sun(direction=(-1.0, 0.0, 0.0), irradiance=(2.0, 3.0, 4.0)))
    g = gbuffer(scene, above(WALL - 3.0, 48.0))
    light = indirect_diffuse(scene, g, samples=256)
    x = WALL - points_of(g)[:, :1]
    visible = 0.5 * (1 - x / (x * x + 24.0**2).sqrt())  # form factor of a long wall 24 high
    want = albedo_of(g) * visible * 0.8 / math.pi * torch.tensor([2.0, 3.0, 4.0]).view(1, 3, 1, 1)
    assert light["sky"].max() == 0
    assert (light["gi"] / want - 1).mean().abs() < 0.02


def test_seen_is_what_the_picture_shows():
    scene = Scene(world=corner(height=6).world, sun=Sun(direction=(-1.0, 1.0, 0.1)))
    whole = gbuffer(scene, Camera.look_at((20, 12, 48), (30, 2, 48), size=(64, 64), fov_y=70.0))
    near = whole.hit & (WALL - points_of(whole)[:, :1] < 2) & (points_of(whole)[:, 1:2] < 1.01)
    ao, light = ambient_occlusion(scene, whole, samples=32), indirect_diffuse(scene, whole, samples=32)
    assert near.sum() > 50
    assert ao["ao"][near].mean() < 0.8
    assert (ao["ao_onscreen"] - ao["ao"])[near].mean() < 0.01
    assert (light["gi_onscreen"] / light["gi"])[near.expand(-1, 3, -1, -1)].mean() > 0.9
    floor = gbuffer(scene, above(WALL - 1.5, 48.0, span=1.5))
    ao, light = ambient_occlusion(scene, floor, samples=32), indirect_diffuse(scene, floor, samples=32)
    assert ao["ao"].min() < 0.8
    assert ao["ao_onscreen"].min() == 1
    assert light["gi"].min() > 0
    assert light["gi_onscreen"].max() == 0


def test_the_back_of_what_the_picture_shows_is_not_seen():
    slab = (STONE, (20, 2, 0), (24, 3, 48))
    scene = Scene(world=world((48, 4, 48), (STONE, (0, 0, 0), (48, 1, 48)), slab), sun=None)
    g = gbuffer(scene, above(19.0, 24.0, span=1.0))
    found = ambient_occlusion(scene, g, radius=8.0, samples=64)
    assert found["ao"].mean() < 0.9
    assert found["ao_onscreen"].min() == 1  # the slab's underside and side do not face the camera


def test_glass_blocks_the_light_that_it_stops():
    plate = (GLASS, (0, 3, 0), (48, 4, 48))
    scene = Scene(world=world((48, 5, 48), (STONE, (0, 0, 0), (48, 1, 48)), plate), sun=None, sky=EVEN)
    camera = Camera.look_at((24, 2.5, 24), (24, 1, 25), size=(8, 8), fov_y=60.0)
    g = gbuffer(scene, camera)
    light = indirect_diffuse(scene, g, samples=256)
    u = torch.rand(2, 20000, generator=torch.Generator().manual_seed(1))
    way = torch.stack(
        [u[0].sqrt() * (2 * math.pi * u[1]).cos(), (1 - u[0]).sqrt(), u[0].sqrt() * (2 * math.pi * u[1]).sin()], 1
    )
    through = transmission(scene, torch.tensor([[24.0, 1.01, 24.0]]).expand_as(way), way).mean(dim=0)
    assert float(through.mean()) < 0.7
    got = (light["sky"] / albedo_of(g) / torch.tensor(EVEN.zenith).view(1, 3, 1, 1))[:, :, 4:].mean(dim=(0, 2, 3))
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
