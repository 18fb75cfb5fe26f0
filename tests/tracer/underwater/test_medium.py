"""Water round the eye against numerical integrals, and against the light that it takes."""

from __future__ import annotations

import math

import pytest
import torch
import voxels
from torch import Tensor

from tracer import Scene
from tracer.scene.scene import Sun
from tracer.underwater.medium import Medium

NO_POSES = torch.zeros(1, 0, 4, 4)
LEVEL = 20


def sea(*, sky: voxels.Sky = voxels.EVEN_SKY, sun: Sun | None = None, roof: bool = False) -> Scene:
    """Water from 1 up to 20 over stone, 48 wide, under an even sky."""
    boxes = [(voxels.STONE, (0, 0, 0), (48, 1, 48)), (voxels.WATER, (0, 1, 0), (48, LEVEL, 48))]
    if roof:
        boxes.append((voxels.STONE, (0, 22, 0), (48, 23, 48)))
    return Scene(world=voxels.world((48, 24, 48), *boxes), sky=sky, sun=sun)


def medium(height: float = 15.0, scene: Scene | None = None) -> Medium:
    found = Medium.of(scene or sea(), torch.tensor([[24.0, height, 24.0]]), NO_POSES)
    assert found is not None
    return found


def integral(water: Medium, rise: float, distance: float, steps: int = 20000) -> Tensor:
    """Light that is scattered once, step by step: what arrives at each depth, times what is left on the way."""
    t = (torch.arange(steps, dtype=torch.float64) + 0.5) * (distance / steps)
    lost, depth = water.extinction[0].double()[:, None], LEVEL - (water.height.double() + rise * t)
    source = (water.light * water.albedo)[0].double()[:, None] * (-lost * depth).exp() / (4 * math.pi)
    return (source * lost * (-lost * t).exp()).sum(dim=1) * (distance / steps)


@pytest.mark.parametrize("rise", [-1.0, -0.4, 0.0, 0.3, 0.7, 1.0])
def test_scattered_light_is_the_integral_along_the_ray(rise: float):
    water = medium()
    for distance in (0.01, 1.0, min(30.0, 4.9 / max(rise, 1e-6))):
        found = water.scattered(torch.tensor([rise]), torch.tensor([distance]))[0]
        torch.testing.assert_close(found.double(), integral(water, rise, distance), rtol=2e-4, atol=1e-9)


def test_nothing_is_scattered_above_the_surface():
    water = medium()
    up, far = torch.tensor([0.5]), torch.tensor([math.inf])
    torch.testing.assert_close(water.scattered(up, far), water.scattered(up, torch.tensor([10.0])))


def test_light_left_is_that_of_the_material_over_the_distance():
    tint = voxels.TABLE.tint[voxels.WATER]
    torch.testing.assert_close(medium().clear(torch.tensor([2.5]))[0], tint**2.5)
    assert torch.equal(medium().clear(torch.tensor([0.0])), torch.ones(1, 3))


def test_deep_water_sends_up_what_its_surface_shows_from_above():
    """Opacity x albedo of what enters, so that water has one colour from both sides."""
    water = medium(LEVEL - 1e-4)
    up = water.scattered(torch.tensor([-1.0]), torch.tensor([math.inf]))[0]
    shown = voxels.TABLE.albedo[voxels.WATER] * voxels.TABLE.opacity[voxels.WATER]
    albedo = (8 * shown).clamp_max(1.0) / 8
    torch.testing.assert_close(math.pi * up / water.light[0], albedo, rtol=1e-3, atol=0)


def test_water_never_adds_more_than_it_takes():
    """Under light from all sides of the surface's brightest radiance, along any ray."""
    water = medium()
    rises = torch.linspace(-1, 1, 21)[None]
    for distance in (0.1, 1.0, 10.0):
        far = torch.full_like(rises, distance)
        taken = (1 - water.clear(far)) * (water.light / math.pi)[..., None]
        assert (water.scattered(rises, far) <= taken).all()


def test_light_that_enters_is_that_of_sky_and_sun():
    even, lets = torch.tensor(voxels.EVEN), 0.934 * (1 - 0.5)
    torch.testing.assert_close(medium().light[0], math.pi * even * lets, rtol=5e-3, atol=0)
    overhead = Sun(direction=(0.0, 1.0, 0.0), irradiance=(1.0, 2.0, 3.0))
    lit = medium(scene=sea(sky=voxels.Sky(picture=torch.zeros(1, 3, 8, 16)), sun=overhead)).light[0]
    torch.testing.assert_close(lit, torch.tensor([1.0, 2.0, 3.0]) * 0.96 * 0.5, rtol=5e-3, atol=1e-6)
    assert medium(scene=sea(roof=True, sun=overhead)).light.max() < 0.1 * lit.max(), "a pool in a cave is dark"


def test_eyes_in_the_air_have_no_water():
    outside = torch.tensor([[24.0, 21.0, 24.0], [24.0, 90.0, 24.0], [0.5, 0.5, 0.5]])
    assert Medium.of(sea(), outside, NO_POSES.expand(3, -1, -1, -1)) is None
    both = torch.tensor([[24.0, 21.0, 24.0], [24.0, 15.0, 24.0]])
    water = Medium.of(sea(), both, NO_POSES.expand(2, -1, -1, -1))
    assert water is not None
    assert water.wet.tolist() == [False, True]
    far = torch.full((2,), 7.0)
    assert torch.equal(water.clear(far)[0], torch.ones(3))
    assert not water.scattered(far * 0, far)[0].any()
    assert torch.isinf(water.reach[0])
    assert water.level[1] == LEVEL
