"""The atmosphere: what is known in closed form, and what everybody has seen."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
import torch

from gbufrt.atmosphere import Atmosphere, sky_picture, sun_transmittance
from gbufrt.atmosphere.medium import mie_phase, rayleigh_phase
from gbufrt.atmosphere.rays import gathered, marched
from gbufrt.atmosphere.scales import rise_at
from gbufrt.atmosphere.scattering import AGAIN, CPU, WAYS, Sides, tables_of
from gbufrt.atmosphere.tables import DTYPE, Tables
from gbufrt.environment import environment_directions

EARTH = Atmosphere()
SIZE = (64, 128)
LINE = torch.linspace(-1, 1, 20001, dtype=DTYPE)  # cosines


def toward(elevation: float, azimuth: float = 0.0) -> tuple[float, float, float]:
    """A direction; azimuth 0 is -z, 90 degrees +x."""
    e, a = math.radians(elevation), math.radians(azimuth)
    return math.cos(e) * math.sin(a), math.sin(e), -math.cos(e) * math.cos(a)


def sky(elevation: float, azimuth: float = 0.0, air: Atmosphere = EARTH, height: float = 0.05) -> torch.Tensor:
    return sky_picture(air, toward(elevation, azimuth), size=SIZE, height=height)[0]


def test_what_comes_straight_down_has_the_depth_of_a_column():
    column = torch.tensor(EARTH.rayleigh) * EARTH.rayleigh_height
    column += (EARTH.mie + EARTH.mie_absorption) * EARTH.mie_height + torch.tensor(EARTH.ozone) * EARTH.ozone_width
    got = sun_transmittance(EARTH, (0.0, 2.0, 0.0), height=0.0)
    assert torch.allclose(got, torch.exp(-column), rtol=2e-3)
    higher = sun_transmittance(EARTH, (0.0, 1.0, 0.0), height=8.0)
    assert bool((higher > got).all())
    assert torch.allclose(sun_transmittance(EARTH, (0.0, 1.0, 0.0), height=100.0), torch.ones(3), atol=1e-3)


def test_the_sun_reddens_and_sets():
    low, set_ = (sun_transmittance(EARTH, toward(e)) for e in (3.0, -1.5))
    assert low[0] > 3 * low[2] > 0
    assert float(set_.abs().max()) == 0


def test_day_is_blue_dusk_red_at_the_sun_and_night_black():
    noon, dusk, night = sky(60), sky(1), sky(-18)
    zenith = noon[:, 0].mean(dim=1)
    assert zenith[2] > 2 * zenith[0]
    horizon = dusk[:, 31, 64]  # under the sun
    assert horizon[0] > 2 * horizon[2]
    assert float(night.max()) < 1e-4 * float(noon.mean())


def test_the_sky_is_alike_on_both_sides_of_the_sun_wherever_it_stands():
    ahead, right = sky(20, 0), sky(20, 90)
    assert torch.allclose(ahead, ahead.flip(2), rtol=1e-4, atol=1e-6)
    assert torch.allclose(ahead.roll(SIZE[1] // 4, dims=2), right, rtol=1e-3, atol=1e-5)
    brightest = int(right[:, : SIZE[0] // 2].mean(0).amax(0).argmax())
    assert abs(brightest - 96) <= 1, "+x lies a quarter of the width right of the middle"


def test_light_from_all_sides_is_scattered_as_phases_say():
    """What a phase function does to harmonics of light is known: it keeps a share of each order.

    The poles are left out: round them light is gathered from wide cells.
    """
    sides = Sides(EARTH, CPU)
    up, out = sides.up.repeat_interleave(WAYS[1]), rise_at(torch.linspace(0, 1, AGAIN[2], dtype=DTYPE))
    kept = lambda phase, harmonic: 2 * math.pi * torch.trapezoid(phase * harmonic, LINE)
    phases = rayleigh_phase(LINE), mie_phase(LINE, EARTH.mie_asymmetry)
    for harmonic in (torch.ones_like, lambda x: x, lambda x: 1.5 * x * x - 0.5):
        for phase, share in zip(sides.phase, (kept(p, harmonic(LINE)) for p in phases), strict=True):
            sent = (phase @ harmonic(up)).view(AGAIN[2:])[1:-1]
            assert torch.allclose(sent, (share * harmonic(out[1:-1]))[:, None].expand_as(sent), atol=0.01)


def test_the_kernel_gathers_what_its_reference_gathers():
    tables = tables_of(EARTH)
    up, sun, turn = torch.rand(3, 500, dtype=DTYPE, generator=torch.Generator().manual_seed(0)) * 2 - 1
    height = torch.linspace(0, 1, 500, dtype=DTYPE) ** 3 * EARTH.thickness
    between = up * sun + ((1 - up * up) * (1 - sun * sun)).sqrt() * turn
    for air in (tables, Tables(EARTH, tables.transmittance)):
        ours, reference = (gathered(air, height, up, sun, between, steps=9, compiled=c) for c in (True, False))
        for got, want in zip(ours, reference, strict=True):
            assert torch.allclose(got, want, rtol=1e-4, atol=1e-10)
    stop = torch.full_like(up, 20.0).minimum(EARTH.ends(height, up)[0])
    parts = [marched(tables, height, up, sun, between, stop, 6, slices=4, compiled=c) for c in (True, False)]
    for got, want in zip(*parts, strict=True):
        assert got.shape == (500, 4, 3)
        assert torch.allclose(got, want, rtol=1e-4, atol=1e-10)


def test_no_air_no_light():
    black = (0.0, 0.0, 0.0)
    none = Atmosphere(rayleigh=black, mie=0.0, mie_absorption=0.0, ozone=black, ground_albedo=0.0)
    assert float(sky(40, air=none).abs().max()) == 0
    assert torch.allclose(sun_transmittance(none, toward(5)), torch.ones(3))
    white = replace(none, ground_albedo=0.5)
    below = sky(90, air=white)[:, -1].mean(dim=1)
    assert torch.allclose(below, torch.full((3,), 0.5 / math.pi), rtol=1e-3), "the ground alone, lit by the sun"


def test_nothing_jumps_from_dawn_to_noon():
    means = torch.stack([sky(e).mean(dim=(1, 2)) for e in torch.arange(-12, 12, 3.0).tolist()])
    ratio = means[1:] / means[:-1]
    assert bool((ratio > 1).all())
    assert float(ratio.max()) < 60


def test_neighbouring_pixels_differ_by_no_visible_step():
    shown = sky(4).sqrt()
    shown = shown / shown.max()
    steps = shown[:, :30].diff(dim=1).abs()  # above the horizon
    bend = steps.diff(dim=1).abs()
    assert float(bend.max()) < 0.05


def test_the_planet_is_seen_from_space():
    picture = sky(70, height=800.0)
    down, edge = picture[:, -1].mean(dim=1), math.acos(6460 / 7160)  # the air's edge under the horizontal, radians
    rows = environment_directions(SIZE)[0, 1, :, 0].asin()
    outside = rows > -edge + 0.06
    assert float(picture[:, outside].abs().max()) == 0
    assert down[2] > 0.01


def test_ground_has_its_colour_and_calm_water_mirrors_the_horizon():
    sun, below = toward(40), slice(SIZE[0] // 2, None)
    grounds: list[dict[str, Any]] = [{}, {"ground": (0.3, 0.3, 0.3)}, {"ground": (0.0, 0.3, 0.0)}, {"water": 1.0}]
    plain, same, green, sea = (sky_picture(EARTH, sun, size=SIZE, **ground)[0] for ground in grounds)
    assert torch.allclose(same[:, below], plain[:, below], rtol=0.02)
    for other in (same, green, sea):
        assert torch.equal(other[:, : below.start], plain[:, : below.start])
    down = green[:, -1].mean(dim=1)
    assert down[1] > 3 * down[0]
    assert down[1] == pytest.approx(float(plain[1, -1].mean()), rel=0.02)
    over, under = sea[:, below.start - 1], sea[:, below.start]
    assert torch.allclose(under, over, rtol=0.15)
    assert not torch.allclose(plain[:, below.start], over, rtol=0.15)
    assert float(sea[:, -1].mean()) < 0.3 * float(plain[:, -1].mean()), "straight down water is dark"


def test_impossible_air_and_suns_are_refused():
    cases: list[tuple[dict[str, Any], str]] = [
        ({"mie": -1.0}, "mie must be finite and not negative"),
        ({"rayleigh": (0.1, math.nan, 0.1)}, "rayleigh must be finite"),
        ({"thickness": 0.0}, "thickness must be above 0"),
        ({"ground_albedo": 1.5}, "ground_albedo must lie in 0..1"),
    ]
    for wrong, words in cases:
        with pytest.raises(ValueError, match=words):
            Atmosphere(**wrong)
    with pytest.raises(ValueError, match="direction must be finite and have a length"):
        sky_picture(EARTH, (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="height must be at least 0"):
        sky_picture(EARTH, (0.0, 1.0, 0.0), height=-1.0)
    with pytest.raises(ValueError, match=r"water must lie in 0\.\.1"):
        sky_picture(EARTH, (0.0, 1.0, 0.0), water=1.5)
    with pytest.raises(ValueError, match="from below 100"):
        sky_picture(EARTH, (0.0, 1.0, 0.0), height=200.0, water=0.5)
