"""Importance sampling of the sky: directions follow their stated density, and most come from where it is bright."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from voxels import world

from gbufrt.environment import environment_directions, environment_solid_angles
from tracer.lights.sky import sky_radiance
from tracer.lights.sky_table import SkyTable
from tracer.scene.scene import Scene, Sky, Sun

SCENE = Scene(world=world((4, 4, 4)), sun=Sun(direction=(0.4, 0.5, -0.7)))


@pytest.fixture
def table() -> SkyTable:
    found = SkyTable.of(SCENE)
    assert found is not None
    return found


def numbers(count: int) -> torch.Tensor:
    return torch.rand(2, count, generator=torch.Generator().manual_seed(0))


def test_densities_add_up_to_one(table: SkyTable) -> None:
    size = (256, 512)
    way = environment_directions(size).flatten(2)[0].T
    angles = environment_solid_angles(size).expand(1, 1, *size).flatten()
    assert abs(float((table.density_of(way) * angles).sum()) - 1) < 1e-3


def test_samples_have_the_density_that_they_tell(table: SkyTable) -> None:
    way, density = table.sample(numbers(50000))
    assert torch.allclose(way.norm(dim=1), torch.ones(50000), atol=1e-5)
    same = torch.isclose(table.density_of(way), density)
    assert same.float().mean() > 0.998  # but for those that rounding moves over the border of a cell
    assert abs(float((1 / density).mean()) / (4 * math.pi) - 1) < 0.02  # the whole sphere


def test_samples_measure_the_sky_with_little_noise(table: SkyTable) -> None:
    way, density = table.sample(numbers(20000))
    light = sky_radiance(SCENE, way.T[None])[0].mean(dim=0) / density
    size = (256, 512)
    sky = sky_radiance(SCENE, environment_directions(size)).mean(dim=1, keepdim=True)
    want = float((sky * environment_solid_angles(size)).sum())
    assert abs(float(light.mean()) / want - 1) < 0.001
    assert float(light.std()) < 0.15 * want
    assert (way @ torch.nn.functional.normalize(torch.tensor([0.4, 0.5, -0.7]), dim=0)).mean() > 0.1


def test_no_sample_comes_from_where_the_sky_is_black() -> None:
    picture = torch.zeros(1, 3, 32, 64)
    picture[..., 10:12, 5:40] = torch.linspace(0.1, 1.0, 35)  # with black before, between and behind
    picture[..., 10, 20] = 0.0
    scene = replace(SCENE, sun=None, sky=Sky(picture=picture))
    found = SkyTable.of(scene)
    assert found is not None
    ends = torch.tensor([0.0, 1.0])
    steps = found.upto / found.upto[-1]
    u = torch.cat([ends, steps.nextafter(torch.tensor(0.0)), steps, steps.nextafter(torch.tensor(2.0))])
    _, density = found.sample(torch.stack([u.clamp(0, 1 - 2.0**-24), torch.full_like(u, 0.5)]))
    assert float(density.min()) > 0


def test_a_black_sky_is_no_light() -> None:
    black = Sky(zenith=(0.0, 0.0, 0.0), horizon=(0.0, 0.0, 0.0), ground=(0.0, 0.0, 0.0))
    assert SkyTable.of(replace(SCENE, sun=None, sky=black)) is None
