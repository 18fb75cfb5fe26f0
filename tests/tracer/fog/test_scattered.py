"""Fog where its light is known in closed form, and against brute force."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

import tracer
from gbufrt import Camera
from gbufrt.compute import resident
from gbufrt.compute.dispatch import Form
from gbufrt.noise.noise import blue_noise
from tracer.direct.fog import segments_of
from tracer.fog import drivers, reference
from tracer.fog.along import LampsAlong
from tracer.fog.scattered import NEIGHBOURS, _uneven, scattered
from tracer.fog.segments import Segments, passes, phase
from tracer.lights.emitters import Lamps
from tracer.lights.lamp_table import LampTable


def scene(sun=None, level=0.0, lamp=False, **fog) -> tracer.Scene:
    """One voxel at the origin, which may be a lamp, a sky of one colour, and fog."""
    table = tracer.MaterialTable.of(
        [tracer.Material(name="body", emission=(40.0, 30.0, 20.0) if lamp else (0.0, 0.0, 0.0))]
    )
    voxels = torch.zeros(3, 3, 3, dtype=torch.int16)
    voxels[1, 1, 1] = 1
    world = tracer.World.from_dense(voxels, table, origin=(-1, -1, -1))
    sky = tracer.Sky(picture=torch.full((1, 3, 4, 8), level))
    return tracer.Scene(world=world, sun=sun, sky=sky, fog=tracer.Fog(**{"extinction": 0.05, **fog}))


def rays(count=64, y=5.0, z=0.5, end=20.0) -> Segments:
    """Rays over the voxel along x, with a little slope."""
    angle = torch.linspace(-0.3, 0.3, count)
    ways = torch.stack([angle.cos(), angle.sin(), torch.zeros(count)], dim=1)
    starts = torch.tensor([[-8.0, y, z]]).expand(count, 3)
    return Segments(origins=starts, directions=ways, begin=torch.ones(count), end=torch.full((count,), end))


def light_of(made: tracer.Scene, given: Segments, frames=1):
    noise = blue_noise(8, len(given.begin) // 8, dims=10)
    none = torch.zeros(0, 4, 4)
    return torch.stack([scattered(made, given, noise, poses=none, index=i) for i in range(frames)]).mean(0)


@pytest.mark.parametrize("falloff", [0.0, 0.2])
def test_depth_and_distance_are_inverse(falloff):
    fog, given = tracer.Fog(extinction=0.05, falloff=falloff, base=4.0), rays()
    height, rise = given.entry()
    depth = fog.depth(height, rise, given.length())
    steps = (torch.arange(4000) + 0.5)[:, None] / 4000 * given.length()
    summed = (fog.density(height + rise * steps) * given.length() / 4000).sum(0)
    torch.testing.assert_close(depth, summed, rtol=1e-4, atol=0)
    torch.testing.assert_close(fog.distance(height, rise, depth), given.length(), rtol=1e-4, atol=0)


def test_unblocked_sun_is_its_phase():
    sun = tracer.Sun(direction=(0.3, 1.0, 0.2), irradiance=(3.0, 2.0, 1.0), angular_radius=0.27)
    made, given = scene(sun=sun, albedo=(0.9, 0.8, 0.7), anisotropy=0.5), rays(y=9.0)
    toward = torch.nn.functional.normalize(torch.tensor(sun.direction), dim=0)
    cosine = given.directions @ toward
    known = (1 - 0.25) / (4 * math.pi * (1.25 - cosine) ** 1.5)
    assert made.fog is not None
    torch.testing.assert_close(phase(made.fog, cosine), known)
    wanted = known[:, None] * torch.tensor([2.7, 1.6, 0.7])
    torch.testing.assert_close(light_of(made, given), wanted, rtol=1e-4, atol=0)


@pytest.mark.parametrize("anisotropy", [0.0, 0.8, -0.4])
def test_even_sky_is_the_albedo(anisotropy):
    made = scene(level=2.0, albedo=(1.0, 0.5, 0.0), anisotropy=anisotropy)
    mean = light_of(made, rays(y=9.0), frames=4).mean(0)
    torch.testing.assert_close(mean, torch.tensor([2.0, 1.0, 0.0]), rtol=0.02, atol=1e-6)


@pytest.mark.parametrize("falloff", [0.0, 0.3])
def test_sun_sky_and_lamp_against_brute_force(falloff):
    sun = tracer.Sun(direction=(0.0, 1.0, 0.0), irradiance=(3.0, 3.0, 3.0), angular_radius=0.5)
    made = scene(sun=sun, level=0.3, lamp=True, falloff=falloff)
    gbuffer = tracer.gbuffer(made, Camera.look_at((-8.0, -0.6, 2.0), (0.0, -0.6, 0.5), size=(4, 16), far=14.0))
    given = segments_of(gbuffer, 0)
    assert made.fog is not None
    found = light_of(made, given, frames=32) * (1 - passes(made.fog, given))[:, None]
    wanted = tracer.fog_truth(made, gbuffer, steps=256)["fog"][0].flatten(1).T
    error = (found - wanted).square().mean().sqrt() / wanted.mean()
    assert float((found.mean(0) / wanted.mean(0) - 1).abs().max()) < 0.01
    assert float(error) < 0.05


@pytest.mark.parametrize("few", [512, 0])
@pytest.mark.parametrize("anisotropy", [0.6, 0.0])
def test_the_compiled_steps_are_the_reference_s(few: int, anisotropy: float, monkeypatch: pytest.MonkeyPatch):
    for form in (reference, drivers):
        monkeypatch.setattr(form, "FEW", few)
    sun = tracer.Sun(direction=(0.3, 1.0, 0.2), irradiance=(3.0, 2.0, 1.0), angular_radius=5.0)
    made = scene(sun=sun, level=0.3, lamp=True, falloff=0.2, anisotropy=anisotropy)
    odd = (torch.arange(27).view(3, 3, 3) % 2 == 0).short()  # voxels that touch at edges alone: 84 rectangles
    made = replace(made, world=tracer.World.from_dense(odd, made.world.materials, origin=(-1, -1, -1)))
    found = light_of(made, rays(y=0.0))
    monkeypatch.setattr("tracer.fog.scattered.form_of", lambda *inputs, cuda: Form.REFERENCE)
    wanted = light_of(made, rays(y=0.0))
    assert wanted.std() > 0.1 * wanted.mean()
    off = (found - wanted).abs() > 1e-4 * wanted.mean() + 1e-3 * wanted
    assert off.any(dim=1).float().mean() < 0.05  # few shadow rays graze an edge


def test_no_fog_no_light():
    made = scene(level=1.0)
    assert made.fog is not None
    given = replace(rays(), end=torch.zeros(64))
    assert float(light_of(made, given).abs().max()) == 0
    assert float(passes(made.fog, given).min()) == 1


@pytest.mark.parametrize(
    "wrong", [{"extinction": -1.0}, {"albedo": (2.0, 0, 0)}, {"anisotropy": 1.0}, {"falloff": math.nan}]
)
def test_bad_values_are_named(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        tracer.Fog(**{"extinction": 0.1, **wrong})


def test_most_steps_are_taken_by_what_lies_around_a_pixel_and_not_by_itself():
    light, taken = torch.zeros(12, 16), torch.ones(12, 16)
    light[5, 6], taken[5, 7] = 1.0, 0.0
    chosen = {(int(k) // 16, int(k) % 16) for k in _uneven(light, taken)[0]}
    near = {(y, x) for y in range(12) for x in range(16) if max(abs(y - 5), abs(x - 6)) <= NEIGHBOURS // 2}
    assert chosen
    assert chosen < near - {(5, 6), (5, 7)}
    assert not any(x.any() for x in _uneven(torch.zeros(12, 16), taken))


def shaded(**lamp: bool) -> tuple[tracer.Scene, Segments]:
    """Rays through the shadow of the voxel, and under the sky."""
    sun = tracer.Sun(direction=(0.0, 1.0, 0.0), irradiance=(3.0, 3.0, 3.0), angular_radius=0.5)
    return scene(sun=sun, level=0.3, **lamp), rays(y=-1.0)


def test_mean_is_that_of_most_steps_everywhere(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tracer.fog.scattered.UNEVEN", 0.2)
    found = light_of(*shaded(), frames=48)
    monkeypatch.setattr("tracer.fog.scattered.UNEVEN", 1.0)
    wanted = light_of(*shaded(), frames=16)
    torch.testing.assert_close(found.mean(0), wanted.mean(0), rtol=0.002, atol=0)
    torch.testing.assert_close(found, wanted, rtol=0.03, atol=0)


def test_steps_at_once_are_steps_one_by_one(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tracer.fog.scattered.SHARED", 1)  # a square of pixels may lie in two parts
    found = light_of(*shaded(lamp=True))
    monkeypatch.setattr("tracer.fog.scattered.WIDE", 16)
    torch.testing.assert_close(found, light_of(*shaded(lamp=True)), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("on_gpu", [False, True])
def test_rays_behind_all_lamps_get_nothing_and_no_rectangle_that_is_none(on_gpu: bool, monkeypatch: pytest.MonkeyPatch):
    """The first lamp has one rectangle and the second two; all face up, and one ray runs below them."""
    monkeypatch.setattr(resident, "waits", lambda tensor: on_gpu)
    used = torch.tensor([[1.0, 0.0], [1.0, 1.0]])[..., None]
    place = torch.tensor([[[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]], [[3.0, 1.0, 0.0], [5.0, 1.0, 0.0]]])
    across, along = torch.tensor([0.0, 0.0, 1.0]), torch.tensor([1.0, 0.0, 0.0])
    lamps = Lamps(
        corner=place, edge_u=used * across, edge_v=used * along, side=torch.full((2, 2), 3),
        radiance=torch.ones(2, 3), center=place[:, 0], radius=torch.ones(2),
    )  # fmt: skip
    table = LampTable.of(lamps, (0, 0, 0), (1, 1, 1))
    assert len(table) == (4 if on_gpu else 3)
    starts = torch.tensor([[-8.0, 4.0, 0.5], [-8.0, -1.0, 0.5]])
    given = Segments(origins=starts, directions=along.expand(2, 3), begin=torch.ones(2), end=torch.full((2,), 20.0))
    drawn = LampsAlong.of(table, given, tracer.Fog(extinction=0.1)).draw(torch.rand(4, 200))
    light = drawn.light.view(-1, 2, 3)
    assert (light[:, 0] > 0).all()
    assert (light[:, 1] == 0).all()
    assert drawn.away.isfinite().all()
