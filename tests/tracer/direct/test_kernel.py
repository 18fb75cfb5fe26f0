"""Compiled direct light against the torch reference, number for number."""

from __future__ import annotations

import pytest
import torch
from voxels import polished_scene

from gbufrt import Camera
from gbufrt.compute.dispatch import Form
from tracer.direct import drivers as direct_drivers
from tracer.direct import lighting
from tracer.direct import reference as direct
from tracer.gbuffers import gbuffer
from tracer.lights.emitters import lamps_of
from tracer.lights.shadows import LEAST, MOST, UNBLOCKED, WEIGHT, Surface
from tracer.scene.scene import Sun

SEEDS = (1, 2)


def forms(seed: int) -> tuple[direct.Direct, direct_drivers.Direct, torch.Tensor, torch.Tensor]:
    """The reference and the compiled form over one picture, its lit pixels, and two numbers of each."""
    scene = polished_scene(seed)
    poses = scene.poses([0.3])
    buffer = gbuffer(scene, Camera.look_at((14, 16, 19), (0, 2, 0), size=(40, 48)), time=0.3)
    surface = Surface(
        points=lighting.lifted(buffer)[0].flatten(1).float(),
        normals=buffer.normal[0].flatten(1).float(),
        lit=buffer.hit.flatten(),
        size=(40, 48),
    )
    given = {"scene": scene, "poses": poses[0], "surface": surface, "lamps": lamps_of(scene, poses[0])}
    pixels = surface.lit.nonzero()[:, 0]
    turned = torch.rand(2, len(pixels), generator=torch.Generator().manual_seed(seed))
    return direct.Direct(**given), direct_drivers.Direct(**given), pixels, turned


def same(a: torch.Tensor, b: torch.Tensor, share: float = 0.004) -> None:
    """All but a ``share`` of pixels, whose rays graze an edge, find the same."""
    off = (a - b).abs() > 1e-4 + 2e-3 * b.abs()
    assert off.any(0).float().mean() <= share
    assert b[UNBLOCKED].max() > 0
    assert (b[MOST] - b[LEAST]).unique().numel() > 1


@pytest.mark.parametrize("seed", SEEDS)
def test_the_sun_finds_the_same_shadows(seed: int):
    reference, compiled, pixels, turned = forms(seed)
    sun = Sun(direction=(0.4, 0.5, 0.3), angular_radius=4.0)
    wanted = reference.sun(sun)(pixels, turned, range(3, 9))
    same(compiled.sun(sun)(pixels, turned, range(3, 9)), wanted)
    assert (wanted[WEIGHT] > 0).any()


@pytest.mark.parametrize("seed", SEEDS)
def test_every_lamp_sends_the_same(seed: int):
    reference, compiled, pixels, turned = forms(seed)
    count = len(reference.lamps)
    assert count > 4
    numbers = torch.arange(reference.surface.points.shape[1]) * 7 % count
    given = pixels, turned, range(2, 7)
    same(compiled.lamp_of_each(numbers)(*given), reference.lamp_of_each(numbers)(*given))
    brightest = int(reference.lamps.radius.argmax())
    same(compiled.lamp(brightest)(*given), reference.lamp(brightest)(*given))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_lamps_matter(seed: int):
    reference, compiled, pixels, _ = forms(seed)
    dice, known = torch.rand(2, reference.surface.points.shape[1], generator=torch.Generator().manual_seed(seed))
    (levels, chosen, scale), (want, which, ratio) = (form.choices(known * 0.1, dice) for form in (compiled, reference))
    assert (levels != want).float().mean() < 1e-3
    assert set(want.unique().tolist()) == {0, 1, 2}
    drawn = pixels[ratio[pixels] > 0]
    assert len(drawn) > 50
    assert (chosen[drawn] != which[drawn]).float().mean() < 0.01
    agree = chosen == which
    assert torch.allclose(scale[agree], ratio[agree], rtol=1e-2, atol=1e-3)


def test_a_whole_picture_is_lit_the_same(monkeypatch: pytest.MonkeyPatch):
    scene = polished_scene(3)
    buffer = gbuffer(scene, Camera.look_at((14, 16, 19), (0, 2, 0), size=(40, 48)), time=0.3)
    found = lighting.light(scene, buffer, poses=scene.poses([0.3]), samples=8)[0]
    monkeypatch.setattr(lighting, "form_of", lambda _: Form.REFERENCE)
    wanted = lighting.light(scene, buffer, poses=scene.poses([0.3]), samples=8)[0]
    off = (found - wanted).abs() > 1e-3 + 1e-2 * wanted
    assert off.any(1).float().mean() < 0.01
    assert wanted[buffer.hit.expand_as(wanted)].mean() > 0.05
