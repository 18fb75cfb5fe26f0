"""Compiled direct light against the torch reference, ray for ray."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
import torch
import torch.nn.functional as F
from voxels import DARK, LAMP, STONE, polished_scene, world

from gbufrt import Camera
from gbufrt.noise.noise import blue_noise
from tracer.direct import choice_reference, drivers, lighting, reference
from tracer.direct.pixel_kernel import LEVEL
from tracer.gbuffers import gbuffer
from tracer.lights.emitters import lamps_of
from tracer.lights.shadows import ALL, FIRST, QUARTER, Surface
from tracer.scene.scene import Scene, Sun

SEEDS = (1, 2)
SIZE = (40, 48)
TIME = 0.3


@pytest.fixture(autouse=True)
def every_lamp_is_a_candidate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then both forms draw the same lamps; and no pixels share a list."""
    monkeypatch.setattr(drivers, "FEW", 1 << 20)
    monkeypatch.setattr(drivers, "MANY", 1 << 20)


def lamps_over_ground() -> Scene:
    """300 lamps, and pillars between them."""
    g = torch.Generator().manual_seed(0)
    spots = torch.stack([torch.randint(0, n, (400,), generator=g) for n in (125, 8, 125)], dim=1).tolist()
    pillars = [(STONE, (x, 2, z), (x + 2, 4 + y, z + 2)) for x, y, z in spots[300:]]
    lamps = [(LAMP, (x, 3 + y, z), (x + 1, 4 + y, z + 1)) for x, y, z in spots[:300]]
    ground = (STONE, (0, 0, 0), (128, 2, 128))
    return Scene(world=world((128, 12, 128), ground, *pillars, *lamps, origin=(-64, 0, -64)), sun=None, sky=DARK)


def forms(
    scene: Scene, *, tints: bool = False, **surface_fields: torch.Tensor
) -> tuple[reference.Direct, drivers.Direct]:
    """The reference and the compiled form over one picture; ``tints`` give every lamp a colour of its own."""
    poses = scene.poses([TIME])
    buffer = gbuffer(scene, Camera.look_at((14, 16, 19), (0, 2, 0), size=SIZE), time=TIME)
    surface = Surface(
        points=lighting.lifted(buffer)[0].flatten(1).float(),
        normals=buffer.normal[0].flatten(1).float(),
        lit=buffer.hit.flatten(),
        size=SIZE,
        **surface_fields,
    )
    lamps = lamps_of(scene, poses[0])
    if tints:
        some = torch.rand(lamps.radiance.shape, generator=torch.Generator().manual_seed(1))
        lamps = replace(lamps, radiance=lamps.radiance * some)
    given = {"scene": scene, "poses": poses[0], "surface": surface, "lamps": lamps}
    return reference.Direct(**given), drivers.Direct(**given)


def assert_alike(scene: Scene, samples: int, seed: int, **fields: Any) -> torch.Tensor:
    """All but a few pixels, whose rays graze an edge, get the same light; that of the reference."""
    noise = blue_noise(*SIZE, index=seed, dims=3, seed=seed)
    wanted, found = (form.arriving(noise, samples) for form in forms(scene, **fields))
    off = (found - wanted).abs() > 1e-4 + 2e-3 * wanted
    assert off.any(0).float().mean() <= 0.004
    assert wanted.mean() > 0.01
    return wanted


@pytest.mark.parametrize(("samples", "seed"), [(1, 1), (6, 2), (16, 1)])
def test_sun_and_lamps_send_the_same_light(samples: int, seed: int):
    assert_alike(polished_scene(seed), samples, seed)


def test_what_is_seen_less_and_lit_besides_gets_the_same_light():
    height, width = SIZE
    seen = (torch.arange(height * width) // width % 4 / 3).square()
    besides = torch.arange(height * width) % width / width
    light = assert_alike(polished_scene(1), 16, 1, seen=seen, besides=besides)
    assert light[:, ::4].abs().max() == 0, "nothing of these rows is seen"


def test_lamps_alone_send_the_same_light():
    scene = replace(polished_scene(2), sun=None)
    assert len(forms(scene)[0].lamps) > 4
    assert_alike(scene, 8, 2, tints=True)


def test_a_soft_sun_alone_casts_the_same_penumbrae():
    scene = polished_scene(1)
    dark = replace(scene.world.materials, emission=torch.zeros_like(scene.world.materials.emission))
    scene = replace(
        scene,
        world=replace(scene.world, materials=dark),
        instances=(),
        sun=Sun(direction=(0.4, 0.5, 0.3), angular_radius=4.0),
    )
    assert not len(forms(scene)[0].lamps)
    soft = assert_alike(scene, 16, 1)
    hard = assert_alike(replace(scene, sun=Sun(direction=(0.4, 0.5, 0.3), angular_radius=0.0)), 16, 1)
    assert ((soft - hard).abs() > 0.1).float().mean() > 0.02


@pytest.mark.parametrize(("seed", "samples"), [(1, 16), (2, 16), (2, 1), (2, 64)])
def test_the_same_lamps_matter(seed: int, samples: int):
    plain, compiled = forms(polished_scene(seed))
    dice, known = torch.rand(2, plain.surface.lit.numel(), generator=torch.Generator().manual_seed(seed))
    want, which, ratio = plain.choices(known * 0.1, dice, samples)
    lists, counts, (chosen, scale) = compiled.lists(known * 0.1, dice, 0, plain.surface.lit.numel(), samples)
    levels = torch.zeros_like(want)
    for pixel, count in enumerate(counts.tolist()):
        for entry in lists[pixel, :count].tolist():
            levels[entry >> LEVEL, pixel] = entry & ALL
    assert (levels != want).float().mean() < 1e-3
    assert ((want > 0).sum(0).max() > 12) == (samples > 1)
    assert set(want.unique().tolist()) == {0, FIRST, QUARTER, ALL}
    drawn = ratio > 0
    assert int(drawn.sum()) > 50
    assert len(which) == chosen.shape[1] == (32 if samples == 64 else 8)
    chosen, scale = chosen.T, scale.T
    agree = chosen[drawn] == which[drawn]
    assert agree.float().mean() > 0.99
    torch.testing.assert_close(scale[drawn][agree], ratio[drawn][agree], rtol=1e-2, atol=1e-3)


@pytest.mark.parametrize("known", [0.0, 50.0, 1e4])
def test_draws_give_in_the_mean_what_all_of_the_rest_would(known: float):
    """At one point, over all dice: with many draws, with one, and with one in so many pixels."""
    count = 1 << 10
    dice = (torch.arange(count) + 0.5) / count
    plain, compiled = forms(lamps_over_ground())
    for form in (plain, compiled):
        rows = {name: getattr(form.surface, name)[:, 1000:1001].repeat(1, count) for name in ("points", "normals")}
        surface = Surface(**rows, lit=torch.ones(count, dtype=torch.bool), size=(32, 32))
        levels, chosen, scale = replace(plain, surface=surface).choices(torch.full((count,), known), dice, 1)
        if form is compiled:
            drawn = replace(compiled, surface=surface).lists(torch.full((count,), known), dice, 0, count, 1)[2]
            chosen, scale = (x.T for x in drawn)
        faces = [choice_reference.faces_of(form.lamps, lamp) for lamp in range(len(form.lamps))]
        at = rows["points"][:, :1], rows["normals"][:, :1]
        power = torch.cat([choice_reference.importance(form.lamps, n, face, *at) for n, face in enumerate(faces)])
        rest = power[levels[:, 0] == 0].sum()
        drawn = (scale * power[chosen.long()]).sum(0)
        assert (drawn == 0).any() == (known == 1e4)
        assert drawn.mean().item() == pytest.approx(rest.item(), rel=0.02)


def tiles_of(picture: torch.Tensor) -> list[torch.Tensor]:
    """``(..., 8, 8)`` each."""
    return [tile for row in picture.split(8, dim=-2) for tile in row.split(8, dim=-1)]


def test_pixels_of_a_tile_that_face_another_side_or_know_more_light_are_apart():
    g = torch.Generator().manual_seed(7)
    height, width = SIZE
    normals, lit = F.normalize(torch.randn(3, height * width, generator=g), dim=0), torch.rand(SIZE, generator=g) < 0.5
    known = torch.full(SIZE, 0.1) + 5 * (torch.rand(SIZE, generator=g) < 0.3)
    known[8:16, :24], lit[:8, :8] = 1.0, False
    compiled = forms(polished_scene(1))[1]
    surface = Surface(points=torch.zeros_like(normals), normals=normals, lit=lit.flatten(), size=SIZE)
    for top in (0, 8):
        rows = slice(top * width, height * width)
        groups = replace(compiled, surface=surface).groups(known.flatten(), rows).view(-1, width)
        assert torch.equal(groups >= 0, lit[top:])
        pictures = groups, known[top:], normals.view(3, *SIZE)[:, top:]
        for tile, light, toward in zip(*map(tiles_of, pictures), strict=True):
            for group in tile[tile >= 0].unique():
                mine = tile == group
                faced = torch.where(toward.abs() >= toward.abs().amax(0), toward.sign(), 0)[:, mine]
                assert faced.unique(dim=1).shape == (3, 1)
                assert light[mine].max() <= 2 * light[mine].min()
    assert set(groups[:8, :24].unique().tolist()) <= {-1, *range(6)}, "none knows more than another"
    assert len(groups[8:].unique()) == 13


def test_bands_leave_no_seam(monkeypatch: pytest.MonkeyPatch):
    compiled = forms(polished_scene(2))[1]
    noise = blue_noise(*SIZE, index=0, dims=3, seed=0)
    whole = compiled.arriving(noise, 16)
    monkeypatch.setattr(drivers, "BAND", 5 * SIZE[1])
    assert torch.equal(compiled.arriving(noise, 16), whole)


def test_long_lists_make_low_bands():
    compiled = forms(polished_scene(1))[1]
    compiled = replace(compiled, surface=replace(compiled.surface, size=(1080, 1920)))
    tall = [max(rows[1] - rows[0] for _, rows, _ in compiled._bands(longest)) for longest in (1, 32, 127)]
    assert tall == [68, 68, 17]


def test_lamps_that_a_tile_leaves_out_are_drawn_without_bias(monkeypatch: pytest.MonkeyPatch):
    compiled = forms(lamps_over_ground())[1]
    everything = torch.ones(compiled.surface.lit.numel()), torch.rand(compiled.surface.lit.numel())

    def pictures(few: int) -> torch.Tensor:
        monkeypatch.setattr(drivers, "FEW", few)
        monkeypatch.setattr(drivers, "MANY", few)
        return torch.stack([compiled.arriving(blue_noise(*SIZE, index=i, dims=3, seed=5), 4) for i in range(32)])

    looked_at, left_out = pictures(1 << 20), pictures(0)
    assert (compiled.lists(*everything, 0, len(everything[0]), 4)[2][1] > 0).sum() > 2000
    assert left_out.mean().item() == pytest.approx(looked_at.mean().item(), rel=2e-3)
    noise = (looked_at.var(0) + left_out.var(0)).sqrt() / math.sqrt(32)
    off = (left_out.mean(0) - looked_at.mean(0)).abs() > 5 * noise + 1e-2 * looked_at.mean(0)
    assert off.any(0).float().mean() < 0.01
    assert left_out.var(0).mean() < 2.5 * looked_at.var(0).mean()


def test_no_pixel_under_an_awning_misses_the_lamp_that_hangs_from_it():
    """Of the lamp's faces one touches the awning: a first ray to that one has no weight."""
    awning, lamp = (STONE, (0, 6, 0), (24, 8, 24)), (LAMP, (12, 5, 12), (13, 6, 13))
    scene = Scene(world=world((24, 8, 24), awning, lamp), sun=None, sky=DARK)
    buffer = gbuffer(scene, Camera.look_at((12.5, -6, 2), (12.5, 6, 12), size=SIZE))
    points, below = lighting.lifted(buffer)[0], buffer.hit & (buffer.normal[:, 1:2] < -0.9) & (buffer.material_id == 1)
    surface = Surface(
        points=points.flatten(1).float(),
        normals=buffer.normal[0].flatten(1).float(),
        lit=buffer.hit.flatten(),
        size=SIZE,
    )
    poses = scene.poses([0.0])[0]
    given = {"scene": scene, "poses": poses, "surface": surface, "lamps": lamps_of(scene, poses)}
    for form in (reference.Direct(**given), drivers.Direct(**given)):
        for index in range(3):
            light = form.arriving(blue_noise(*SIZE, index=index, dims=3), 16).mean(0).view(1, 1, *SIZE)
            around = F.avg_pool2d(F.pad(light, (1,) * 4, mode="replicate"), 3, 1)
            assert not bool((below & (light < 0.3 * around)).any())
