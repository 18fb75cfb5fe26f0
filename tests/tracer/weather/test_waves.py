"""Waves of water against a dense search of the same height field, and against reprojection."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F
import voxels
from torch import Tensor

from gbufrt import Camera, GBuffer
from tracer import Scene, Waves
from tracer.frames import render
from tracer.gbuffers import layers
from tracer.paths.one_sample import sample_light
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Sun
from tracer.scene.world import World
from tracer.weather import drivers, reference
from tracer.weather.water import OCTAVES, Water

WAVES = Waves(amplitude=0.3, frequency=0.4, speed=1.0)
TOP, TIME, BEFORE = 4, 1.7, 1.6
NEAR = Camera.look_at((5.0, 9.0, 40.0), (24.0, 4.0, 20.0), size=(45, 80), fov_y=50.0)


def lake(*, waves: Waves | None = WAVES) -> Scene:
    """A lake whose water reaches up to 4, with a bank one higher and stone beneath it."""
    world = voxels.world(
        (48, 8, 48),
        (voxels.STONE, (0, 0, 0), (48, 5, 48)),
        (voxels.WATER, (2, 2, 2), (46, 4, 46)),
        (0, (2, 4, 2), (46, 8, 46)),
    )
    return Scene(world=world, waves=waves)


def seen(camera: Camera = NEAR, scene: Scene | None = None, **kw: object) -> tuple[GBuffer, GBuffer]:
    first, second = layers(scene or lake(), camera, **{"time": TIME, "previous_time": BEFORE, **kw})
    assert second is not None
    return first, second


def points_of(found: GBuffer) -> Tensor:
    """``(H, W, 3)`` world."""
    return found.camera.to_world(found.points_view())[0].permute(1, 2, 0)


def waved(found: GBuffer) -> Tensor:
    assert found.material_id is not None
    return found.material_id[0, 0] == voxels.WATER


def water(camera: Camera, time: float = TIME) -> Water:
    return Water.of(WAVES, time, camera.position[0])


def dense(camera: Camera, t_end: Tensor, steps: int = 20000) -> Tensor:
    """``(H, W)`` where rays first go under the height field after the face of still water, by tiny steps."""
    origins, directions = (x[0].double() for x in camera.rays())
    begin = (TOP - origins[..., 1]) / directions[..., 1]
    field = Water.of(WAVES, TIME, camera.position[0].double())
    found, size = torch.full_like(begin, math.inf), 2 * WAVES.amplitude / -directions[..., 1] / steps
    for k in range(steps, -1, -40):
        at = begin + size * torch.arange(k, max(k - 40, -1), -1).view(-1, 1, 1)
        points = origins + directions * at[..., None]
        under = points[..., 1] <= TOP - WAVES.amplitude + field.height(points[..., [0, 2]])
        first = torch.where(under, at, math.inf).amin(dim=0)
        found = torch.minimum(found, first)
    return torch.where(found < t_end, found, t_end)


def test_depth_is_where_rays_first_meet_the_height_field():
    camera = Camera.look_at((9.0, 6.5, 38.0), (24.0, 3.7, 20.0), size=(12, 16), fov_y=40.0)
    first, second = seen(camera)
    flat, behind = seen(camera, lake(waves=None))
    along = (camera.rays()[1] * camera.forward[:, None, None, :]).sum(-1)[0]
    here = waved(flat)
    truth = dense(camera, behind.depth[0, 0].double() / along)
    found = first.depth[0, 0] / along
    assert float(here.float().mean()) > 0.5
    off = (found - truth)[here].abs()
    assert float(off.max()) < 0.02  # where a ray grazes a crest; the height there is right, see below
    assert float(off.quantile(0.9)) < 1e-3
    assert float((found - flat.depth[0, 0] / along)[here].mean()) > 0.3
    points = points_of(first)[waved(first)]
    gap = points[:, 1] - TOP + WAVES.amplitude - water(camera).height(points[:, [0, 2]])
    assert float(gap.abs().max()) < 1e-3
    assert float((second.depth - behind.depth)[0, 0][waved(first)].abs().max()) < 1e-4


def test_where_the_bank_comes_before_the_wave_it_is_seen_with_nothing_behind():
    first, second = seen()
    flat, _ = seen(NEAR, lake(waves=None))
    bank = waved(flat) & ~waved(first)
    assert int(bank.sum()) > 10
    assert bool((first.normal[0, 1][bank] == 0).all())  # its sides
    assert not bool(second.hit[0, 0][bank].any())
    assert bool(second.hit[0, 0][waved(first)].all())


def test_waves_cross_from_the_water_of_one_biome_into_that_of_another():
    swamp = Material(name="water of a swamp", opacity=0.5, tint=(0.4, 0.8, 0.9))
    table = MaterialTable.joined([voxels.TABLE, MaterialTable.of([swamp])], [*voxels.TABLE.names, swamp.name])
    one, two = lake(), len(voxels.TABLE)
    cells = torch.stack(torch.meshgrid(*(torch.arange(n) for n in (48, 8, 48)), indexing="ij"), dim=-1)
    dense = one.world.at(cells)
    dense[(dense == voxels.WATER) & ((cells[..., 0] // 3 + cells[..., 2] // 3) % 2 == 0)] = two
    mixed = replace(one, world=World.from_dense(dense, table))
    (first, second), (wanted, behind) = seen(scene=mixed), seen(scene=one)
    assert first.material_id is not None
    assert int((first.material_id == two).sum()) > 100
    assert float((first.depth - wanted.depth).abs().max()) < 1e-4
    assert float((first.normal - wanted.normal).abs().max()) < 1e-4
    assert float((second.depth - behind.depth).abs().max()) > 1.0  # where the first water ends, another begins behind
    places = points_of(first)[..., [0, 2]].floor().long()[first.material_id[0, 0] == two]
    assert float(((places // 3).sum(1) % 2 == 0).float().mean()) > 0.98


def test_the_kernel_meets_what_its_reference_meets():
    origins, directions = (x[0].flatten(0, 1) for x in NEAR.rays())
    t = (TOP - origins[:, 1]) / directions[:, 1]
    keep = t > 0
    rays = [x[keep] for x in (origins, directions, t, t + torch.rand(t.shape) * 4)]
    far = replace(water(NEAR), eye=NEAR.position[0] + 45.0)
    for field in (water(NEAR), far):
        found, wanted = (form.meet(field, *rays) for form in (drivers, reference))
        assert float((found - wanted).abs().quantile(0.99)) < 2e-3
        assert 0.1 < float((found == rays[3]).float().mean()) < 0.9
        assert float((found - rays[2]).min()) >= 0


def test_normals_are_those_of_the_field():
    first, _ = seen()
    points, here = points_of(first).double(), waved(first)
    field, step = Water.of(WAVES, TIME, NEAR.position[0].double()), 1e-4
    x, z = (points.new_tensor(d) * step for d in ((1.0, 0.0), (0.0, 1.0)))
    at = points[..., [0, 2]]
    slopes = [(field.height(at + d) - field.height(at - d)) / (2 * step) for d in (x, z)]
    wanted = F.normalize(torch.stack([-slopes[0], torch.ones_like(slopes[0]), -slopes[1]], dim=-1), dim=-1)
    steep = (wanted * NEAR.rays()[1][0]).sum(dim=-1) < -0.06  # others are kept from turning away
    off = (first.normal[0].permute(1, 2, 0) - wanted)[here & steep].norm(dim=-1)
    fades = field.away(at)[here & steep].sub(32.0).abs() < 2  # which slopes leave out
    assert float(off.max()) < 0.02
    assert float(off[~fades].max()) < 1e-4
    assert float(steep[here].float().mean()) > 0.9
    assert float(wanted[here][:, 1].min()) < 0.97
    first.validate()


@pytest.mark.parametrize("moves", [False, True])
def test_motion_is_that_of_the_water_at_its_place(moves: bool):
    before = Camera.look_at((6.0, 9.4, 40.0), (23.0, 4.0, 20.5), size=NEAR.size, fov_y=50.0) if moves else NEAR
    first, _ = seen(NEAR, previous_camera=before)
    assert first.motion is not None
    assert first.motion_z is not None
    points, here = points_of(first).double(), waved(first)
    places = points[..., [0, 2]]
    points[..., 1] += water(NEAR, BEFORE).height(places) - water(NEAR).height(places)
    earlier = before.to_view(points.permute(2, 0, 1)[None])
    wanted = before.project(earlier) - NEAR.pixel_centers(dtype=torch.float64)
    assert float((first.motion - wanted)[0][:, here].abs().max()) < 2e-3
    assert float((first.motion_z + first.depth - earlier[:, 2:])[0, 0][here].abs().max()) < 1e-4
    still, _ = NEAR.static_motion(before, first.depth, first.hit)
    assert float((first.motion - still)[0][:, here].abs().max()) > 0.2
    torch.testing.assert_close(first.motion[0][:, ~here], still[0][:, ~here])


def test_octaves_end_at_34_and_68_units_and_keep_their_mean():
    assert [(weight, end) for _, weight, _, end in OCTAVES] == [(1.0, math.inf), (0.5, 68.0), (0.25, 34.0)]
    g = torch.Generator().manual_seed(0)
    field, angle = Water.of(WAVES, TIME, torch.zeros(3)), torch.rand(20000, generator=g) * 2 * math.pi
    ring = torch.stack([angle.cos(), angle.sin()], dim=-1)
    spread = []
    for distance in (20.0, 50.0, 120.0):
        heights = field.height(ring * distance)
        assert float(heights.abs().max()) <= WAVES.amplitude
        assert abs(float(heights.mean())) < 0.1 * WAVES.amplitude
        spread.append(float(field.slopes(ring * distance).norm(dim=-1).mean()))
    assert spread[0] > 1.1 * spread[1] > 1.2 * spread[2] > 0.1
    for end in (34.0, 68.0):
        across = torch.stack([torch.linspace(end - 0.001, end + 0.001, 3), torch.zeros(3)], dim=-1)
        assert float(field.height(across).diff().abs().max()) < 1e-3
    steep = field.steepest(torch.tensor([20.0, 50.0, 120.0]))
    for distance, x, z in zip((20.0, 50.0, 120.0), *steep, strict=True):
        slopes = field.slopes(ring * distance).abs().amax(dim=0)
        assert bool((slopes <= torch.stack([x, z])).all())


def test_waves_go_on_and_still_ones_stand():
    moving, _ = seen(NEAR, time=2.0)
    earlier, _ = seen(NEAR, time=1.0)
    assert not torch.equal(moving.depth, earlier.depth)
    stands = lake(waves=replace(WAVES, speed=0.0))
    assert torch.equal(seen(NEAR, stands, time=2.0)[0].depth, seen(NEAR, stands, time=1.0)[0].depth)
    calm, flat = (seen(NEAR, lake(waves=waves))[0] for waves in (replace(WAVES, amplitude=0.0), None))
    torch.testing.assert_close(calm.depth, flat.depth)
    torch.testing.assert_close(calm.normal, flat.normal)


def test_a_batch_is_its_cameras_one_by_one():
    both = Camera.from_intrinsics(
        NEAR.intrinsics.repeat(2, 1, 1), NEAR.world_from_view.repeat(2, 1, 1), size=NEAR.size, far=NEAR.far
    )
    together, _ = seen(both, time=[1.0, 2.0], previous_time=[0.5, 2.0])
    for b, (time, before) in enumerate(((1.0, 0.5), (2.0, 2.0))):
        alone, _ = seen(NEAR, time=time, previous_time=before)
        for name in ("depth", "normal", "motion", "transmittance"):
            torch.testing.assert_close(getattr(together, name)[b : b + 1], getattr(alone, name), msg=name)


def test_direct_light_reaches_the_troughs():
    """A wave lies inside the voxel of still water, which must not shade it."""
    scene = replace(lake(), sun=Sun(direction=(0.0, 1.0, 0.0), irradiance=(3.0, 3.0, 3.0)), sky=voxels.DARK)
    frame = render(scene, NEAR, time=TIME)
    here = waved(frame.gbuffer)
    assert frame.radiance is not None
    assert frame.gbuffer.albedo is not None
    normal, albedo = frame.gbuffer.normal[0, 1], frame.gbuffer.albedo[0]
    wanted = albedo * 0.5 / math.pi * 3 * normal
    torch.testing.assert_close(frame.radiance[0][:, here], wanted[:, here], rtol=0.01, atol=0)


def test_paths_start_above_the_face_of_still_water():
    """Half of what waves reflect would else be the inside of that face, less than a world unit away."""
    scene = replace(lake(), sun=None)
    found, _ = seen(scene=scene)
    light = sample_light(scene, found, index=3)
    points = points_of(found)
    inner = waved(found) & (points[..., 0] > 6) & (points[..., 0] < 42) & (points[..., 2] > 6) & (points[..., 2] < 42)
    assert inner.sum() > 500
    away = light.distance[0, 0][inner & (light.distance[0, 0] > 0)]
    assert float((away < 2).float().mean()) < 0.1  # what goes down again from a steep wave


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"amplitude": 0.6}, r"amplitude of waves must lie in 0\.\.0\.45, got 0\.6"),
        ({"frequency": -1.0}, r"frequency of waves must lie in 0\.\.10"),
        ({"speed": math.nan}, "speed of waves must lie in"),
    ],
)
def test_bad_values_get_one_line(values: dict[str, float], message: str):
    with pytest.raises(ValueError, match=message):
        Waves(**values)
