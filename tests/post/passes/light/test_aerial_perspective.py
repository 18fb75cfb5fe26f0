"""Aerial perspective: what air adds and takes is known where it is even, and the rest is the sky's own integral."""

from __future__ import annotations

import boxes
import pytest
import torch
import torch.nn.functional as F

from gbufrt import Camera
from gbufrt.atmosphere import Atmosphere, air_before
from gbufrt.atmosphere.rays import gathered
from gbufrt.atmosphere.scattering import tables_of
from gbufrt.atmosphere.tables import DTYPE
from post.passes.light.aerial_perspective import AerialPerspective, aerial_perspective

SUN = (0.3, 0.5, -0.8)


def view(size: tuple[int, int] = (40, 64)) -> tuple[Camera, torch.Tensor]:
    camera = Camera.look_at((0, 0, 0), (0, 0.2, -1), size=size, fov_y=50.0)
    return camera, camera.rays()[1].permute(0, 3, 1, 2)


def test_even_air_takes_what_beer_and_lambert_say():
    even = Atmosphere(rayleigh=(0.1, 0.2, 0.4), rayleigh_height=1e9, mie=0.0, mie_absorption=0.0, ozone=(0.0, 0.0, 0.0))
    _, ways = view()
    distance = torch.linspace(0, 7, 64).expand(1, 1, 40, 64)
    light, clear = air_before(even, SUN, ways, distance)
    for channel, lost in enumerate(even.rayleigh):
        assert torch.allclose(clear[:, channel], torch.exp(-lost * distance[:, 0]), atol=4e-3)
    assert bool((light.diff(dim=3) >= -1e-4).all()), "more air, more light"


def test_all_the_air_is_the_sky():
    """Where a ray ends at the end of the air, the light before it is what the sky sends."""
    air = Atmosphere()
    ways = Camera.look_at((0, 0, 0), (0, 2, -1), size=(40, 64), fov_y=20.0).rays()[1].permute(0, 3, 1, 2)
    up = ways[:, 1].to(DTYPE)
    height = torch.full_like(up, 0.05)
    end = air.ends(height, up)[0]
    sun = F.normalize(torch.tensor(SUN, dtype=DTYPE), dim=0)
    between = torch.einsum("i,bihw->bhw", sun, ways.to(DTYPE))
    sky = gathered(tables_of(air), height, up, sun[1].expand_as(up), between)[0].permute(0, 3, 1, 2)
    light, _ = air_before(air, SUN, ways, end[:, None].float())
    assert float(((light - sky).abs() / sky).max()) < 0.02


def test_the_module_is_the_function_and_leaves_the_sky():
    frame = boxes.frame(boxes.camera((24, 32)))
    frame = frame.replace(color=frame.radiance)
    g = frame.gbuffer
    got = AerialPerspective(unit=0.5, sun=SUN)(frame).read("color")
    want = aerial_perspective(frame.read("color"), g.depth, g.hit, g.camera, unit=0.5, sun=SUN)
    assert torch.equal(got, want)
    assert torch.equal(got[~g.hit.expand_as(got)], frame.read("color")[~g.hit.expand_as(got)])
    hit = g.hit.expand_as(got)
    assert float((got - frame.read("color")).abs()[hit].mean()) > 0.004
    near = aerial_perspective(frame.read("color"), g.depth, g.hit, g.camera, unit=0.0)
    assert torch.allclose(near, frame.read("color"), atol=1e-6)


def test_slices_stay_where_they_are_while_the_farthest_surface_moves():
    _, ways = view()
    near = torch.full((1, 1, 40, 64), 3.0)
    far = near.clone()
    far[..., 5, 5] = 3.9
    found = [air_before(Atmosphere(), SUN, ways, distance)[0] for distance in (near, far)]
    same = torch.ones(40, 64, dtype=torch.bool)
    same[5, 5] = False
    assert torch.equal(found[0][..., same], found[1][..., same])


def test_impossible_numbers_are_refused():
    frame = boxes.frame(boxes.camera((4, 4)))
    g = frame.gbuffer
    for wrong, words in (
        ({"unit": -0.1}, "unit must be at least 0 kilometres, got -0.1"),
        ({"height": 101.0}, "height must lie in 0..100 kilometres, got 101.0"),
        ({"sun": (0.0, 0.0, 0.0)}, "direction must be finite and have a length"),
    ):
        with pytest.raises(ValueError, match=words):
            aerial_perspective(torch.zeros(1, 3, 4, 4), g.depth, g.hit, g.camera, **wrong)  # type: ignore[arg-type]
