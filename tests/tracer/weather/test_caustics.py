"""Sunlight that waves reflect, against photons that are reflected by the same waves one by one."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F
import voxels
from torch import Tensor

from gbufrt import Camera
from gbufrt.commands.ablation.world import caustics as light
from gbufrt.specular import DIELECTRIC_F0, schlick
from tracer import Scene, Sun, Waves
from tracer.frames import render
from tracer.weather import drivers, reference
from tracer.weather.caustics import caustics
from tracer.weather.water import Water

WAVES = Waves(amplitude=0.1)
TOP, TIME, EYE = 4, 2.0, torch.tensor([24.0, 8.0, 30.0])
SUN = Sun(direction=(0.25, 0.6, 0.75), irradiance=(3.0, 3.0, 3.0))
TOWARD = F.normalize(torch.tensor(SUN.direction), dim=0)
LOW, HIGH, FRONT = (18.0, 4.6), (28.0, 9.6), 8.0  # of the part of the wall that is measured: x, y; and its z


def pool(**kw: object) -> Scene:
    """A wall along x at the end of a pool, both under the sun, which shines on neither from behind."""
    world = voxels.world(
        (48, 24, 40),
        (voxels.STONE, (0, 0, 0), (48, 2, 40)),
        (voxels.WATER, (0, 2, 8), (48, TOP, 40)),
        (voxels.STONE, (0, 0, 0), (48, 14, 8)),
    )
    return Scene(**{"world": world, "sun": SUN, "waves": WAVES, "sky": voxels.DARK, **kw})


def wall(count: int) -> tuple[Tensor, Tensor]:
    """``(count * 2 count, 3)`` points on the wall, and their normals."""
    y = LOW[1] + (torch.arange(count) + 0.5) * (HIGH[1] - LOW[1]) / count
    x = LOW[0] + (torch.arange(2 * count) + 0.5) * (HIGH[0] - LOW[0]) / (2 * count)
    grid = torch.stack(torch.meshgrid(y, x, indexing="ij"), dim=-1).view(-1, 2)
    points = torch.stack([grid[:, 1], grid[:, 0], torch.full_like(grid[:, 0], FRONT + 1e-3)], dim=-1)
    return points, torch.tensor([[0.0, 0.0, 1.0]]).expand_as(points)


def arrived(points: Tensor, normals: Tensor, scene: Scene | None = None, time: float = TIME) -> Tensor:
    lit = torch.ones(len(points), dtype=torch.bool)
    poses = torch.zeros(0, 4, 4)
    return caustics(scene or pool(), points, normals, lit, poses=poses, time=time, eye=EYE)[:, 0]


def test_energy_and_structure_are_those_of_light_tracing():
    truth, found = light.photons("high sun"), light.arrived(*light.pool("high sun"))
    energy = float(found.mean() / truth.mean())
    both = torch.stack([found.flatten(), truth.flatten()])
    alike = float(torch.corrcoef(both)[0, 1])
    contrast = [float(x.std() / x.mean()) for x in (found, truth)]
    assert abs(energy - 1) < 0.1
    assert alike > 0.82
    assert contrast[1] > 0.25
    assert abs(contrast[0] / contrast[1] - 1) < 0.2


def test_still_water_mirrors_the_sun_evenly():
    points, normals = wall(6)
    calm = pool(waves=replace(WAVES, amplitude=0.0))
    wanted = 3.0 * float(schlick(TOWARD[1], DIELECTRIC_F0)) * float(TOWARD[2])
    torch.testing.assert_close(arrived(points, normals, calm), torch.full((72,), wanted), rtol=0.01, atol=0)


def test_the_kernel_is_its_reference():
    points, normals = wall(4)
    levels = torch.full((len(points),), TOP - WAVES.amplitude)
    for sun, eye in ((TOWARD, EYE), (torch.tensor([0.0, 1.0, 0.0]), EYE + 32.0)):
        water = Water.of(WAVES, TIME, eye)
        slanted = normals if sun[1] < 1 else -normals.flip(1)  # what faces straight down
        found, wanted = (f.focused(water, points, slanted, levels, sun) for f in (drivers, reference))
        assert float((found - wanted).abs().quantile(0.95)) < 1e-3 * float(wanted.mean())
        assert float(wanted.mean()) > 0


def test_no_sun_no_water_no_waves_and_far_off_give_none():
    points, normals = wall(4)
    assert float(arrived(points, normals).min()) >= 0
    assert float(arrived(points, normals).mean()) > 0
    assert not bool(arrived(points, -normals).any())  # the other side of the wall
    covered = voxels.world(
        (48, 24, 40),
        (voxels.WATER, (0, 2, 8), (48, TOP, 40)),
        (voxels.STONE, (0, 20, 0), (48, 21, 40)),
        (voxels.STONE, (0, 4, 39), (48, 24, 40)),
    )
    for scene in (
        pool(sun=None),
        pool(waves=None),
        pool(sun=replace(SUN, direction=(0.2, -0.5, 0.7))),
        pool(world=covered),
        pool(waves=replace(WAVES, caustics=0.0)),
        pool(waves=replace(WAVES, caustics=0.5)),
        pool(world=voxels.world((48, 24, 40), (voxels.STONE, (0, 0, 0), (48, TOP, 40)))),
    ):
        assert not bool(arrived(points, normals, scene).any())


def test_coloured_glass_before_the_sun_tints_them():
    points, normals = wall(4)
    lit = torch.ones(len(points), dtype=torch.bool)
    pane = voxels.world(
        (48, 30, 60),
        (voxels.WATER, (0, 2, 8), (48, TOP, 40)),
        (voxels.GLASS, (0, 16, 0), (48, 17, 60)),
    )
    given = {"poses": torch.zeros(0, 4, 4), "time": TIME, "eye": EYE}
    through = caustics(pool(world=pane), points, normals, lit, **given).mean(dim=0)
    plain = caustics(pool(), points, normals, lit, **given).mean(dim=0)
    ratio = through / plain
    way = 1 / float(TOWARD[1])
    wanted = torch.tensor([0.9, 0.7, 0.5]) ** way * 0.75 * float(1 - schlick(TOWARD[1], DIELECTRIC_F0))
    torch.testing.assert_close(ratio, wanted, rtol=0.02, atol=0)


def test_they_are_part_of_direct_light_and_move():
    camera = Camera.look_at((23.0, 7.0, 20.0), (23.0, 7.0, 8.0), size=(24, 32), fov_y=30.0)
    still = render(pool(waves=None), camera, time=1.0).read("radiance")
    frames = [render(pool(), camera, time=time) for time in (1.0, 1.5)]
    gained = [frame.read("radiance") - still for frame in frames]
    facing = frames[0].gbuffer.normal[0, 2] == 1
    assert float(facing.float().mean()) > 0.8
    assert float(gained[0][0, 0][facing].mean()) > 0
    assert not torch.equal(gained[0], gained[1])
    points = frames[0].gbuffer.camera.to_world(frames[0].gbuffer.points_view())[0].flatten(1).T
    normals = torch.tensor([[0.0, 0.0, 1.0]]).expand_as(points)
    lit = torch.ones(len(points), dtype=torch.bool)
    eye = camera.position[0]  # of which the octaves depend
    wanted = caustics(pool(), points + normals * 1e-3, normals, lit, poses=torch.zeros(0, 4, 4), time=1.0, eye=eye)
    albedo = frames[0].gbuffer.albedo
    assert albedo is not None
    wanted = albedo[0] / math.pi * wanted.T.view(3, *camera.size)
    off = (gained[0][0] - wanted)[:, facing].abs()
    assert float(off.median()) < 0.05 * float(wanted[:, facing].mean())


@pytest.mark.parametrize("far", [-1.0, math.inf])
def test_bad_distances_get_one_line(far: float):
    with pytest.raises(ValueError, match="caustics of waves must lie in"):
        Waves(caustics=far)
