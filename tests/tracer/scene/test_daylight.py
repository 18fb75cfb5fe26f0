"""Day and night: where sun, moon and stars stand, and how much they light."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import torch

import tracer
from gbufrt import Camera
from post import exposure
from tracer.scene.cells import world_of_cells
from tracer.scene.daylight import SunPath, at_hour
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene
from tracer.scene.view import View
from tracer.worlds.regions.landscape import landscape


@cache
def scene() -> Scene:
    """A small floor under the sky."""
    cells = np.argwhere(np.ones((8, 1, 8)))
    return landscape(world_of_cells(cells, np.ones(len(cells), np.int16), MaterialTable.of([Material(name="stone")])))


def test_the_sun_goes_from_east_to_west_and_the_moon_has_the_night():
    base = scene()
    light = {hour: at_hour(base, hour) for hour in (0, 6.5, 8, 12, 16, 17.5, 20, 24)}
    for hour, x in ((8, 1), (12, 0), (16, -1)):
        sun = light[hour].sun
        assert sun is not None
        assert x * sun.direction[0] > 0.5 or (x == 0 and abs(sun.direction[0]) < 0.2)
        assert sun.direction[1] > 0
    moon, morning = light[20].sun, light[8].sun
    assert moon is not None
    assert morning is not None
    assert moon.direction == pytest.approx(morning.direction, abs=1e-9)  # full, so where the sun was at 8
    strength = {hour: sum(found.sun.irradiance) for hour, found in light.items() if found.sun is not None}
    assert strength[12] == pytest.approx(sum(base.sun.irradiance), rel=1e-3) if base.sun else False
    assert strength[0] == pytest.approx(strength[24])
    assert strength[0] < 0.01 * strength[12]
    assert shown(light[0]) < 0.05 * shown(light[12])
    low = light[17.5].sun
    assert low is not None
    assert low.irradiance[2] / low.irradiance[0] < 0.5  # red
    assert torch.equal(light[8].world.index, base.world.index)


def shown(found: Scene) -> float:
    assert found.sky.picture is not None
    return float(found.sky.picture[:, :, :128].mean())


def displayed(found: Scene) -> float:
    """The sky after exposure, which has adapted to it."""
    assert found.sky.picture is not None
    sky = found.sky.picture[:, :, :128]
    return float((sky * exposure(sky)[0]).mean())


def test_nothing_jumps_where_the_moon_takes_over_from_the_sun():
    hours = [at_hour(scene(), hour) for hour in (18.0, 18.04, 18.08)]
    strength = [sum(found.sun.irradiance) for found in hours if found.sun is not None]
    assert len({found.sun.direction[0] > 0 for found in hours if found.sun is not None}) == 2, "it has taken over"
    assert max(abs(a - b) for a, b in pairwise(strength)) < 0.6
    assert all(a > b > 0.6 * a for a, b in pairwise(map(shown, hours)))


def test_a_new_moon_leaves_the_stars():
    full, new = (at_hour(scene(), 23, day=day) for day in (0.0, 14.765))
    assert full.sun is not None
    assert new.sun is not None
    assert sum(new.sun.irradiance) < 1e-3 * sum(full.sun.irradiance)
    assert 0 < displayed(new) < 0.65 * displayed(full), "eyes adapt, and still see it darker"
    camera = Camera.look_at((0, 400, 0), (0, 500, 100), size=(108, 192))
    starless = replace(new, sky=replace(new.sky, stars=None))
    clear, dark = (tracer.render(found, camera, light_samples=1).radiance for found in (new, starless))
    assert clear is not None
    assert dark is not None
    assert bool((clear >= dark).all())
    assert 0.0003 < float((clear > dark + 1e-4).float().mean()) < 0.02, "points, not a glow"
    flat = Camera.look_at((0, 400, 0), (30, 480, 90), size=(6, 8), orthographic_height=0.05)
    even, bare = (tracer.render(found, flat, light_samples=1).radiance for found in (new, starless))
    assert even is not None
    assert bare is not None
    assert torch.equal(even, bare), "one star would fill the picture"


def test_the_sun_is_never_overhead_and_what_is_drawn_on_the_sky_turns_with_it():
    path = SunPath()
    assert max(path.sun(h / 10)[1] for h in range(241)) < math.cos(math.radians(25))
    assert path.turned(path.turned((0.3, -0.4, 0.5)), inverse=True) == pytest.approx((0.3, -0.4, 0.5))
    assert path.sun(12) == pytest.approx(path.turned((0, 1, 0)))
    stars = [at_hour(scene(), hour).sky.stars for hour in (1.0, 3.0)]
    for hour, turned in zip((1.0, 3.0), stars, strict=True):
        assert turned is not None
        sun = turned @ torch.tensor(path.sun(hour))
        assert torch.allclose(sun, torch.tensor([0.0, -1.0, 0.0]), atol=1e-5), "it stands still among the stars"
    for wrong in ({"zenith": 91.0}, {"azimuth": math.nan}):
        with pytest.raises(ValueError, match="degrees"):
            SunPath(**wrong)


@pytest.mark.parametrize("hour", [-0.1, 24.1, math.nan])
def test_hours_that_no_day_has_are_refused(hour: float):
    with pytest.raises(ValueError, match=r"hour must lie in 0\.\.24"):
        at_hour(scene(), hour)


def test_days_must_be_finite():
    with pytest.raises(ValueError, match="day must be finite"):
        at_hour(scene(), 12, day=math.inf)


def test_views_that_need_the_day_come_last_by_night():
    """Under water the picture would be black, and the first view is the default."""
    still = View(eye=lambda _: (0, 1, 0), target=lambda _: (1, 1, 0))
    base = replace(scene(), views={"sea": replace(still, by_day=True), "land": still})
    first = {hour: next(iter(at_hour(base, hour).views)) for hour in (7.0, 12.0, 17.0, 18.5, 24.0)}
    assert first == {7.0: "sea", 12.0: "sea", 17.0: "sea", 18.5: "land", 24.0: "land"}
