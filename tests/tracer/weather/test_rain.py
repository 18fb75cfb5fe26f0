"""A sky of cloud, and scenes and streams in the rain."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
import voxels

import tracer
from gbufrt.environment import environment_directions
from tracer.lights.sky import sky_irradiance
from tracer.scene.scene import Haze, Scene
from tracer.weather.rain import DULL, overcast

UP = torch.tensor([0.0, 1.0, 0.0]).view(1, 3, 1, 1)


def scene() -> Scene:
    return Scene(world=voxels.world((4, 4, 4), (voxels.STONE, (0, 0, 0), (4, 1, 4))))


def test_an_overcast_sky_sends_what_it_is_asked_to_and_is_three_times_as_bright_overhead():
    way = environment_directions((256, 512))
    sky = overcast(way, torch.tensor(2.0))
    found = sky_irradiance(replace(scene(), sun=None, sky=tracer.Sky(picture=sky)), UP).mean()
    assert abs(float(found) - 2.0) < 0.03
    ends = overcast(torch.stack([UP, UP.new_tensor([1.0, 1e-6, 0.0]).view(1, 3, 1, 1)], dim=-1)[..., 0, :], found)
    assert abs(float(ends[0, 1, 0, 0] / ends[0, 1, 0, 1]) - 3) < 1e-3


def test_rain_greys_the_sky_dims_the_sun_and_brings_haze():
    clear = tracer.at_hour(scene(), 14.0)
    assert tracer.raining(clear, 0.0) is clear
    found = [tracer.raining(clear, level) for level in (0.3, 0.7, 1.0)]
    assert [s.rain and s.rain.level for s in found] == [0.3, 0.7, 1.0]
    suns = [sum(s.sun.irradiance) for s in (clear, *found) if s.sun]
    assert suns == sorted(suns, reverse=True)
    assert suns[-1] == 0
    ends = [s.haze.end for s in found if s.haze]
    assert ends == sorted(ends, reverse=True)
    assert all(s.haze and 0 < s.haze.begin < s.haze.end for s in found)
    blue = [float(sky_irradiance(s, UP)[0, 2] / sky_irradiance(s, UP)[0, 0]) for s in (clear, *found)]
    assert blue == sorted(blue, reverse=True)
    assert clear.sun
    whole = sky_irradiance(clear, UP).mean() + sum(clear.sun.irradiance) / 3 * clear.sun.direction[1]
    assert abs(float(sky_irradiance(found[-1], UP).mean() / whole) - DULL) < 0.01


def test_a_wet_night_is_dark_and_haze_that_is_there_stays():
    night = tracer.at_hour(scene(), 0.0, day=14.8)
    light = [float(sky_irradiance(s, UP).mean()) for s in (tracer.at_hour(scene(), 12.0), night)]
    wet = float(sky_irradiance(tracer.raining(night, 1.0), UP).mean())
    assert 0 < wet < 0.01 * light[0]
    near = tracer.raining(replace(scene(), haze=Haze(begin=1.0, end=20.0)), 0.5).haze
    assert near
    assert (near.begin, near.end) == (1.0, 20.0)


def test_what_a_view_looks_to_from_afar_does_not_drown_in_haze():
    def ends(far: float) -> tuple[float, float]:
        view = tracer.View(eye=lambda _: (0.0, 0.0, 0.0), target=lambda _: (0.6 * far, 0.0, 0.8 * far))
        haze = tracer.raining(replace(scene(), views={"front": view}), 0.6).haze
        assert haze
        return haze.begin, haze.end

    alone = tracer.raining(scene(), 0.6).haze
    assert alone
    assert ends(20.0) == ends(100.0) == (alone.begin, alone.end)
    assert ends(1000.0) == pytest.approx((ends(500.0)[0] * 2, ends(500.0)[1] * 2))
    assert ends(500.0)[1] > 2.5 * 500.0


@pytest.mark.parametrize("level", [-0.5, 2.0, math.nan])
def test_bad_levels_get_one_line(level: float):
    with pytest.raises(ValueError, match=r"level of rain must lie in 0\.\.1"):
        tracer.raining(scene(), level)
