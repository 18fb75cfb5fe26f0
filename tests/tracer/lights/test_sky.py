from __future__ import annotations

import math

import torch
import torch.nn.functional as F

from gbufrt.environment import environment_directions, environment_solid_angles, lookup_environment
from tracer.lights.sky import environment, sky_irradiance, sky_radiance, sun_radiance
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene, Sky, Sun
from tracer.scene.world import World

EMPTY = World.from_dense(torch.zeros(1, 1, 1, dtype=torch.int16), MaterialTable.of([Material(name="stone")]))
GREY = Sky(zenith=(0.7, 0.7, 0.7), horizon=(0.7, 0.7, 0.7), ground=(0.7, 0.7, 0.7))


def directions(count: int) -> torch.Tensor:
    return F.normalize(torch.randn(1, 3, 1, count, generator=torch.Generator().manual_seed(0)), dim=1)


def test_a_uniform_sky_without_sun_is_uniform_and_sends_pi_times_its_radiance():
    scene = Scene(world=EMPTY, sun=None, sky=GREY)
    way = directions(200)
    assert torch.allclose(sky_radiance(scene, way), torch.full_like(way, 0.7))
    assert torch.allclose(sky_irradiance(scene, way), torch.full_like(way, 0.7 * math.pi), rtol=1e-5)


def test_irradiance_matches_brute_force():
    scene, normals, size = Scene(world=EMPTY), directions(64), (256, 512)
    way = environment_directions(size)
    power = sky_radiance(scene, way) * environment_solid_angles(size)
    cosine = (normals[0, :, 0].T @ way.flatten(2)[0]).clamp_min(0)
    truth = (power.flatten(2)[0] @ cosine.T).view(1, 3, 1, -1)
    assert ((sky_irradiance(scene, normals) - truth) / truth).abs().max() < 0.005


def test_elevation_decides_the_colour_and_the_sun_glows():
    sky = Sky(zenith=(0.0, 0.0, 1.0), horizon=(0.0, 1.0, 0.0), ground=(1.0, 0.0, 0.0))
    scene = Scene(world=EMPTY, sun=None, sky=sky)
    axes = torch.tensor([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]).T.view(1, 3, 1, 3)
    assert torch.allclose(sky_radiance(scene, axes)[0, :, 0], torch.eye(3).flip(0), atol=1e-6)
    sun = Sun(direction=(1.0, 1.0, 0.0))
    near, far = (F.normalize(torch.tensor(d), dim=0).view(1, 3, 1, 1) for d in ((1.0, 0.8, 0.0), (-1.0, 0.8, 0.0)))
    lit = Scene(world=EMPTY, sun=sun, sky=sky)
    assert sky_radiance(lit, near).mean() > 1.2 * sky_radiance(lit, far).mean()


def test_no_step_anywhere_along_a_meridian_through_the_sun():
    scene = Scene(world=EMPTY, sun=Sun(direction=(0.0, 0.4, -1.0)))
    polar = torch.linspace(0.0, math.pi, 4001)
    way = torch.stack([torch.zeros_like(polar), polar.cos(), -polar.sin()])[None, :, None]
    step = sky_radiance(scene, way).diff(dim=3).abs().amax()
    assert step < 0.01


def test_the_disc_adds_up_to_the_suns_irradiance():
    sun = Sun(direction=(0.3, 0.5, -0.8), angular_radius=2.0)
    toward = F.normalize(torch.tensor(sun.direction), dim=0)
    spread = torch.linspace(-0.05, 0.05, 801)
    across = F.normalize(torch.linalg.cross(toward, torch.tensor([0.0, 1.0, 0.0])), dim=0)
    up = torch.linalg.cross(across, toward)
    x, y = torch.meshgrid(spread, spread, indexing="ij")
    height = (1 - x * x - y * y).sqrt()
    way = toward[:, None, None] * height + across[:, None, None] * x + up[:, None, None] * y
    cell = (spread[1] - spread[0]) ** 2  # projected on the plane that faces the sun: the cosine is in it
    total = (sun_radiance(sun, way[None]) * cell).sum(dim=(2, 3))[0]
    assert torch.allclose(total, torch.tensor(sun.irradiance), rtol=0.01)
    assert sun_radiance(sun, -way[None]).abs().max() == 0


def test_the_environment_shows_the_sky_without_the_disc():
    sun = Sun(direction=(0.2, 0.5, -1.0), irradiance=(30.0, 30.0, 30.0))
    scene = Scene(world=EMPTY, sun=sun)
    picture = environment(scene)
    assert picture.shape == (1, 3, 64, 128)
    way = directions(500)
    way = way[..., (way[0, 1, 0].abs() > 0.15)]
    assert torch.allclose(lookup_environment(picture, way), sky_radiance(scene, way), rtol=0.03, atol=0.01)
    brightest = int(picture[0].mean(0).argmax())
    toward = F.normalize(torch.tensor(sun.direction), dim=0)
    visible = environment_directions((64, 128)).flatten(2)[0, :, brightest]
    assert visible @ toward > math.cos(math.radians(3.0))
    assert picture.max() < sun_radiance(sun, toward.view(1, 3, 1, 1)).max() / 100
