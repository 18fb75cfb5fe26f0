"""G-buffers of small scenes: every channel against what geometry says."""

from __future__ import annotations

import pytest
import torch
import voxels
from torch import Tensor
from voxels import GLASS, LAMP, STONE, WATER

from gbufrt import Camera, GBuffer
from gbufrt.gbuffer import CHANNELS
from tracer.gbuffers import gbuffer, layers
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import MASK_ALL, MASK_PRIMARY, Instance, Scene
from tracer.scene.world import World
from tracer.traversal.rays import trace

SIZE = (36, 48)


def room(*more, instances: tuple[Instance, ...] = ()) -> Scene:
    """A floor of stone with its top at y = 0 and a wall with its face at z = -10; boxes more, moved by (16, 4, 16)."""
    boxes = ((STONE, (0, 0, 0), (32, 4, 32)), (STONE, (0, 4, 0), (32, 24, 6)), *more)
    return Scene(world=voxels.world((32, 24, 32), *boxes, origin=(-16, -4, -16)), instances=instances)


def look(dx: float = 0.0, *, orthographic: bool = False, size: tuple[int, int] = SIZE) -> Camera:
    height = 9.0 if orthographic else None
    return Camera.look_at((2.3 + dx, 5.1, 9.2), (0.4 + dx, 2.0, -3.0), size=size, far=80.0, orthographic_height=height)


def mover(speed: float = 1.0) -> Instance:
    model = voxels.world((3, 3, 3), (LAMP, (0, 0, 0), (3, 3, 3)), origin=(-1, -1, -1))
    place = lambda t: voxels.pose((speed * t, 2.0, 1.0), yaw=0.3 + 0.8 * speed * t, pitch=0.2)
    return Instance(model=model, pose=place, scale=0.8)


def only(b: int, g: GBuffer) -> dict[str, Tensor]:
    return {name: getattr(g, name)[b : b + 1] for name in g.present}


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("jitter", [None, (0.31, -0.27)])
def test_every_channel_is_there_and_valid(orthographic: bool, jitter: tuple[float, float] | None) -> None:
    scene = room((WATER, (4, 4, 12), (28, 5, 30)), (GLASS, (10, 4, 14), (13, 8, 15)), instances=(mover(),))
    cameras = [look(dx, orthographic=orthographic).with_jitter(jitter) for dx in (0.0, -0.2)]
    first, second = layers(scene, cameras[0], previous_camera=cameras[1], time=0.5, previous_time=0.4)
    assert second is not None
    for g in (first, second):
        g.validate()
        assert g.present == tuple(CHANNELS)
        for name, row in CHANNELS.items():
            missing = getattr(g, name)[(~g.hit).expand_as(getattr(g, name))]
            if name not in ("depth", "motion", "motion_z"):
                assert (missing == row.clear).all(), name
    assert first.material_id is not None
    assert first.object_id is not None
    assert set(first.material_id.unique().tolist()) >= {STONE, GLASS, WATER, LAMP}
    assert set(first.object_id.unique().tolist()) == {0, 1}


@pytest.mark.parametrize("jitter", [None, (0.4, 0.2)])
def test_depth_of_a_wall(jitter: tuple[float, float] | None) -> None:
    camera = Camera.look_at((0.5, 6.5, 5.0), (0.5, 6.5, 0.0), size=(9, 11), fov_y=40.0).with_jitter(jitter)
    g = gbuffer(room(), camera)
    torch.testing.assert_close(g.depth, torch.full_like(g.depth, 15.0))
    torch.testing.assert_close(g.normal, torch.tensor([0.0, 0.0, 1.0])[None, :, None, None].expand_as(g.normal))
    points = camera.to_world(g.points_view())
    torch.testing.assert_close(points[:, 2], torch.full_like(points[:, 2], -10.0))


def test_right_and_up_in_the_world_are_right_and_up_in_the_picture() -> None:
    scene = room((LAMP, (20, 8, 8), (22, 10, 10)), (GLASS, (10, 14, 8), (12, 16, 10)))
    g = gbuffer(scene, Camera.look_at((0.0, 6.0, 9.0), (0.0, 6.0, 0.0), size=SIZE))
    assert g.material_id is not None
    rows, columns = (g.material_id[0, 0] == LAMP).nonzero().float().mean(0)
    assert columns > SIZE[1] / 2
    assert rows > SIZE[0] / 2
    rows, columns = (g.material_id[0, 0] == GLASS).nonzero().float().mean(0)
    assert columns < SIZE[1] / 2
    assert rows < SIZE[0] / 2


@pytest.mark.parametrize("orthographic", [False, True])
def test_motion_of_an_instance_is_that_of_its_points(orthographic: bool) -> None:
    scene = room(instances=(mover(),))
    now, before = look(orthographic=orthographic), look(0.5, orthographic=orthographic)
    g = gbuffer(scene, now, previous_camera=before, time=0.3, previous_time=0.1)
    assert g.motion is not None
    assert g.motion_z is not None
    on = (g.object_id == 1)[0, 0]
    assert on.sum() > 50
    here, there = (scene.world_from_model(scene.poses([t])[0])[0].double() for t in (0.3, 0.1))
    px = now.pixel_centers()[0, :, on].double()
    visible = now.to_world(g.points_view().double())[0, :, on]
    model = torch.linalg.inv(here) @ torch.cat([visible, torch.ones_like(visible[:1])])
    was = before.to_view((there @ model)[None, :3])
    torch.testing.assert_close(g.motion[0, :, on].double(), before.project(was)[0] - px, atol=1e-3, rtol=0)
    torch.testing.assert_close(g.motion_z[0, 0, on].double(), was[0, 2] - g.depth[0, 0, on], atol=1e-4, rtol=0)
    corner = torch.tensor([[2.0, 2.0, 2.0, 1.0]], dtype=torch.float64).T
    ends = [c.project(c.to_view((m @ corner)[None, :3]))[0, :, 0] for c, m in ((now, here), (before, there))]
    near = (px - ends[0][:, None]).norm(dim=0).argmin()  # the pixel nearest to a corner moves as the corner does
    torch.testing.assert_close(g.motion[0, :, on][:, near].double(), ends[1] - ends[0], atol=0.35, rtol=0)
    assert (ends[1] - ends[0]).norm() > 2


def test_nothing_moves_without_a_previous_frame() -> None:
    scene = room(instances=(mover(),))
    g = gbuffer(scene, look(), time=0.7)
    assert g.motion is not None
    assert g.motion.abs().max() < 2e-3
    g = gbuffer(scene, look(), time=0.7, previous_time=0.6)
    assert g.motion is not None
    assert g.motion[(g.object_id == 1).expand(-1, 2, -1, -1)].abs().max() > 0.5
    assert g.motion[(g.object_id == 0).expand(-1, 2, -1, -1)].abs().max() < 2e-3


def test_thickness_against_brute_force() -> None:
    scene = room((GLASS, (6, 4, 14), (12, 9, 18)), (LAMP, (12, 4, 15), (14, 9, 17)), instances=(mover(),))
    camera = look(size=(12, 16))
    g = gbuffer(scene, camera, time=0.2)
    assert g.thickness is not None
    origins, directions = camera.rays()
    hits = trace(scene, origins, directions, poses=scene.poses([0.2]))
    steps = torch.arange(0.002, 20.0, 0.005)
    matrix = torch.linalg.inv(scene.world_from_model(scene.poses([0.2])[0])[0])
    expected = torch.zeros(12, 16)
    for y, x in hits.hit[0].nonzero().tolist():
        points = origins[0, y, x] + directions[0, y, x] * (hits.t[0, y, x] + steps)[:, None]
        grid = scene.world
        if int(hits.instance[0, y, x]):
            points, grid = points @ matrix[:3, :3].T + matrix[:3, 3], scene.instances[0].model
        air = grid.at(points.floor().int()) == 0
        expected[y, x] = steps[int(air.float().argmax())] if air.any() else 20.0
    torch.testing.assert_close(g.thickness[0, 0].clamp_max(20.0), expected, atol=0.02, rtol=0)
    assert 0 < float(g.thickness[g.object_id == 1].max()) < 0.8 * 3 * 3**0.5 + 1e-3


def test_behind_glass_is_what_is_there_without_it() -> None:
    pane = (GLASS, (4, 4, 14), (28, 20, 15))
    with_glass, without = room(pane), room()
    camera = look()
    first, second = layers(with_glass, camera)
    bare = gbuffer(without, camera)
    assert second is not None
    glass = first.material_id == GLASS
    assert glass.float().mean() > 0.5
    assert torch.equal(second.hit, glass & bare.hit)
    for name in ("depth", "normal", "albedo", "motion", "material_id", "thickness"):
        visible, expected = getattr(second, name), getattr(bare, name)
        share = ((visible - expected).abs() > 1e-4).any(1, keepdim=True)[second.hit].float().mean()
        assert share < 0.01, name  # of pixels that hit the floor inside the pane's foot
    row = voxels.TABLE.id("glass")
    slant = camera.rays()[1][..., 2].abs()[:, None]
    expected = (1 - voxels.TABLE.opacity[row]) * voxels.TABLE.tint[row].view(1, 3, 1, 1) ** (1 / slant)
    through = (glass & (first.normal[:, 2:] > 0.5)).expand_as(expected)
    whole = through & (second.depth - first.depth > 2.0)
    assert first.transmittance is not None
    torch.testing.assert_close(first.transmittance[whole], expected[whole])
    assert (first.transmittance[(~glass).expand_as(expected)] == 0).all()
    assert layers(Scene(world=_opaque()), camera)[1] is None


def _opaque() -> World:
    return World.from_dense(torch.ones(4, 4, 4, dtype=torch.int16), MaterialTable.of([Material(name="a")]))


def test_a_body_in_water_is_seen_behind_its_surface_and_ends_the_water() -> None:
    fish = Instance(
        model=voxels.world((4, 1, 4), (LAMP, (0, 0, 0), (4, 1, 4))), pose=lambda t: voxels.pose((-2.0, 1.0, -2.0))
    )
    scene = room((WATER, (0, 4, 6), (32, 8, 32)), instances=(fish,))
    camera = Camera.look_at((0.0, 12.0, 0.0), (0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0), size=(5, 5), fov_y=5.0)
    first, second = layers(scene, camera)
    assert second is not None
    assert first.transmittance is not None
    assert (first.material_id == WATER).all()
    assert (second.object_id == 1).all()
    torch.testing.assert_close(second.depth, torch.full_like(second.depth, 10.0))
    row = voxels.TABLE.id("water")
    expected = (1 - voxels.TABLE.opacity[row]) * voxels.TABLE.tint[row] ** 2.0
    torch.testing.assert_close(first.transmittance[0, :, 2, 2], expected, atol=1e-4, rtol=0)


def test_a_camera_in_a_block_sees_out_and_one_in_water_sees_its_surface_from_beneath() -> None:
    inside = Camera.look_at((0.5, -2.0, 0.5), (0.5, 4.0, -6.0), size=(8, 8), fov_y=30.0)
    g = gbuffer(room(), inside)
    g.validate()
    assert g.hit.any()
    assert (inside.to_world(g.points_view())[:, 1:2][g.hit] > 0).all()
    scene = room((WATER, (0, 4, 6), (32, 8, 32)))
    under = Camera.look_at((0.5, 2.0, 0.5), (0.5, 9.0, -6.0), size=(8, 8), fov_y=20.0)
    first, second = layers(scene, under)
    first.validate()
    assert second is not None
    surface = first.material_id == WATER
    assert surface.all()
    torch.testing.assert_close(first.normal[:, 1], -torch.ones(1, 8, 8))
    assert not second.hit.any(), "what lies straight behind is not what refraction shows"


def test_batch_equals_loop() -> None:
    scene = room((WATER, (4, 4, 12), (28, 5, 30)), instances=(mover(), mover(-2.0)))
    single = [look(0.0), look(1.5)]
    batch = Camera.from_intrinsics(
        torch.cat([c.intrinsics for c in single]),
        torch.cat([c.world_from_view for c in single]),
        size=SIZE,
        far=80.0,
    ).with_jitter(torch.tensor([[0.1, 0.2], [-0.3, 0.4]]))
    times, before = [0.2, 0.6], [0.1, 0.5]
    together = layers(scene, batch, time=times, previous_time=before)
    for b, jitter in enumerate([(0.1, 0.2), (-0.3, 0.4)]):
        alone = layers(scene, single[b].with_jitter(jitter), time=times[b], previous_time=before[b])
        for many, one in zip(together, alone, strict=True):
            assert many is not None
            assert one is not None
            for name, tensor in only(b, many).items():
                assert torch.equal(tensor, getattr(one, name)), name


def test_primary_mask_hides_an_instance_from_the_camera() -> None:
    ghost = Instance(model=mover().model, pose=mover().pose, mask=MASK_ALL & ~MASK_PRIMARY)
    assert (gbuffer(room(instances=(ghost,)), look()).object_id == 0).all()


def test_sky_alone_odd_sizes_and_far() -> None:
    up = Camera.look_at((0.0, 3.0, 0.0), (0.0, 9.0, 1.0), size=(7, 1))
    g = gbuffer(room(), up, previous_camera=up)
    g.validate()
    assert not g.hit.any()
    assert (g.depth == up.far).all()
    near = Camera.look_at((0.5, 6.5, 5.0), (0.5, 6.5, 0.0), size=(1, 5), far=14.9)
    assert not gbuffer(room(), near).hit.any()


@pytest.mark.filterwarnings("error")
def test_errors_name_what_is_wrong() -> None:
    nothing = Scene(world=World.from_dense(torch.zeros(4, 4, 4, dtype=torch.int16), voxels.TABLE))
    with pytest.raises(ValueError, match="the world has no voxels"):
        gbuffer(nothing, look())
    with pytest.raises(ValueError, match="time must be one number or one for each of the 1 cameras, got 2"):
        gbuffer(room(), look(), time=[0.0, 1.0])
    with pytest.raises(ValueError, match="previous_time must be one number"):
        gbuffer(room(), look(), previous_time=[0.0, 1.0])
