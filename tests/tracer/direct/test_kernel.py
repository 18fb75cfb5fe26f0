"""Compiled direct light against the torch reference, ray for ray."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from voxels import DARK, LAMP, STONE, polished_scene, world

from gbufrt import Camera
from gbufrt.noise.noise import blue_noise
from tracer.direct import choice_kernel, choice_reference, drivers, lighting, reference
from tracer.direct.kernel import Sources
from tracer.direct.pixel_kernel import LEVEL
from tracer.direct.sources import sources_of
from tracer.gbuffers import gbuffer
from tracer.lights.emitters import Lamps, lamps_of, lamps_of_world
from tracer.lights.shadows import ALL, FIRST, QUARTER, Surface
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene, Sun
from tracer.scene.world import World

SEEDS = (1, 2)
SIZE = (40, 48)
TIME = 0.3


@pytest.fixture(autouse=True)
def every_lamp_is_a_candidate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then both forms draw the same lamps."""
    monkeypatch.setattr(drivers, "FEW", 1 << 20)


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


@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_lamps_matter(seed: int):
    plain, compiled = forms(polished_scene(seed))
    dice, known = torch.rand(2, plain.surface.lit.numel(), generator=torch.Generator().manual_seed(seed))
    want, which, ratio = plain.choices(known * 0.1, dice)
    lists, counts, (chosen, scale) = (t for t in compiled.lists(known * 0.1, dice, 0, plain.surface.lit.numel()))
    levels = torch.zeros_like(want)
    for pixel, count in enumerate(counts.tolist()):
        for entry in lists[pixel, :count].tolist():
            levels[entry >> LEVEL, pixel] = entry & ALL
    assert (levels != want).float().mean() < 1e-3
    assert set(want.unique().tolist()) == {0, FIRST, QUARTER, ALL}
    drawn = ratio > 0
    assert int(drawn.sum()) > 50
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
        levels, chosen, scale = replace(plain, surface=surface).choices(torch.full((count,), known), dice)
        if form is compiled:
            drawn = replace(compiled, surface=surface).lists(torch.full((count,), known), dice, 0, count)[2]
            chosen, scale = (x.T for x in drawn)
        faces = [choice_reference.faces_of(form.lamps, lamp) for lamp in range(len(form.lamps))]
        at = rows["points"][:, :1], rows["normals"][:, :1]
        power = torch.cat([choice_reference.importance(form.lamps, n, face, *at) for n, face in enumerate(faces)])
        rest = power[levels[:, 0] == 0].sum()
        drawn = (scale * power[chosen.long()]).sum(0)
        assert (drawn == 0).any() == (known == 1e4)
        assert drawn.mean().item() == pytest.approx(rest.item(), rel=0.02)


def test_bands_leave_no_seam(monkeypatch: pytest.MonkeyPatch):
    compiled = forms(polished_scene(2))[1]
    noise = blue_noise(*SIZE, index=0, dims=3, seed=0)
    whole = compiled.arriving(noise, 16)
    monkeypatch.setattr(drivers, "BAND", 5 * SIZE[1])
    assert torch.equal(compiled.arriving(noise, 16), whole)


def test_a_list_holds_no_more_lamps_than_it_has_room_for(monkeypatch: pytest.MonkeyPatch):
    """Of 128 lamps that are alike, rounding lets each give more than a 128th of the light."""
    monkeypatch.setattr(choice_kernel, "SHARE_ALONE", 1 / 128)
    sources = sources_of(forms(polished_scene(1))[0].lamps, None)
    point, toward = (0.0, 40.0, 0.0), (0.0, -1.0, 0.0)
    number = next(n for n in range(128) if choice_kernel.importance(sources, n, point, toward) > 0)
    sources.lamps[number, choice_kernel.MEAN] = 0.1 / choice_kernel.importance(sources, number, point, toward)
    sent, row = choice_kernel.importance(sources, number, point, toward), np.full(128, -1, np.int32)

    def listed(room: np.ndarray) -> tuple[int, float]:
        power = np.full(128, sent)
        count, rest, _ = choice_kernel.list_lamps(np.full(128, number, np.int32), 0.0, 1.0, 0.0, power, room)
        assert rest == power.sum()
        return count, rest

    assert listed(row)[0] == 128, "rounding has to matter for what follows"
    count, rest = listed(row[:127])
    assert count == 127
    assert rest == sent > 0, "it may still be drawn"


def test_a_tile_is_known_by_the_lit_pixel_nearest_its_centre():
    width, seen, zeros = 12, np.zeros(120, np.float32), np.zeros((120, 3))
    tile, surface, ranges = (1, 9, 2, 10), (zeros, zeros, seen), (np.empty(6), np.empty(6))
    known = np.arange(120, 0, -1).astype(np.float32)
    assert choice_kernel.extent(surface, known, 0, width, tile, 0, *ranges)[0] == -1
    least = np.inf
    for y, x in ((8, 2), (2, 9), (4, 8), (5, 6)):  # each nearer (5, 6), whence eyes meet; later ones hide none before
        seen[y * width + x] = 1 / (y + 1)
        least = min(least, known[y * width + x])
        assert choice_kernel.extent(surface, known, 0, width, tile, 0, *ranges) == (y * width + x, seen.max(), least)


def test_pixels_of_a_tile_that_face_another_side_are_apart():
    normals = F.normalize(torch.randn(64, 3, generator=torch.Generator().manual_seed(7)), dim=1).double().numpy()
    points, seen, known = np.arange(192.0).reshape(64, 3), np.ones(64, np.float32), np.arange(64.0)
    axes = np.abs(normals).argmax(1)
    sides = 2 * axes + (np.take_along_axis(normals, axes[:, None], 1)[:, 0] > 0)
    low, high = np.empty(6), np.empty(6)
    for side in range(6):
        mine = np.flatnonzero(sides == side)
        middle, _, least = choice_kernel.extent((points, normals, seen), known, 0, 8, (0, 8, 0, 8), side, low, high)
        assert middle in mine
        assert least == mine[0]
        np.testing.assert_array_equal(low, np.concatenate([points[mine].min(0), normals[mine].min(0)]))
        np.testing.assert_array_equal(high, np.concatenate([points[mine].max(0), normals[mine].max(0)]))
        assert {choice_kernel.side_of(normals, i) for i in mine} == {side}


def test_long_lists_make_low_bands():
    compiled = forms(polished_scene(1))[1]
    compiled = replace(compiled, surface=replace(compiled.surface, size=(1080, 1920)))
    tall = [max(rows[1] - rows[0] for _, rows, _ in compiled._bands(longest)) for longest in (1, 32, 127)]
    assert tall == [68, 68, 17]


def crowd() -> Lamps:
    """Lamps of many rectangles each: a third of a block of voxels shines."""
    shines = torch.rand(8, 8, 8, generator=torch.Generator().manual_seed(3)) < 0.3
    lamp = MaterialTable.of([Material(name="lamp", emission=(4.0, 3.0, 2.0))])
    return lamps_of_world(World.from_dense(shines.to(torch.int16), lamp, origin=(-4, -4, -4)))


def weighed(
    sources: Sources, place: tuple[Any, Any], around: tuple[Any, Any, Any, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """What `choice_kernel.weigh` finds at a place and around a centre."""
    here, most = np.empty((2, len(sources.lamps)))
    choice_kernel.weigh(sources, *place, *around, here, most)
    return here, most


@pytest.mark.parametrize("crowded", [False, True])
def test_no_lamp_sends_more_than_its_bound(crowded: bool):
    g = torch.Generator().manual_seed(4)
    sources = sources_of(crowd() if crowded else forms(polished_scene(1))[0].lamps, None)
    assert not crowded or np.diff(sources.first).min() > len(sources.faces), "faces are sums"
    tight = behind = 0
    for case in range(25, 55) if crowded else range(120):
        center, reach = (torch.rand(3, generator=g) * 24 - 12).double().numpy(), float(torch.rand((), generator=g)) * 4
        facing = F.normalize(torch.randn(1, 3, generator=g) + 0.4 * torch.randn(20, 3, generator=g), dim=1).double()
        if case >= 40:  # near a lamp, on a surface that faces away from it
            way = F.normalize(torch.randn(1, 3, generator=g), dim=1).double()
            lamp = sources.lamps[case % len(sources.lamps)]
            away = lamp[choice_kernel.RADIUS] * (0.6 + reach / 4)
            center, reach = lamp[:3] + way[0].numpy() * away, float(away) * 0.5
            facing = F.normalize(way + 0.01 * torch.randn(20, 3, generator=g).double(), dim=1)
        low, high = tuple(facing.amin(0).tolist()), tuple(facing.amax(0).tolist())
        offsets = F.normalize(torch.randn(20, 3, generator=g), dim=1).double().numpy() * reach
        bounds = weighed(sources, (center, (0.0, 1.0, 0.0)), (center, reach, low, high))[1]
        for number, most in enumerate(bounds.tolist()):
            sent = [
                choice_kernel.importance(sources, number, tuple(center + offset), tuple(normal))
                for offset, normal in zip(offsets, facing.tolist(), strict=True)
            ]
            assert max(sent) <= most * (1 + 1e-9)
            tight += max(sent) > 0.2 * most > 0
            behind += case >= 40 and max(sent) > 0.2 * most > 0
    assert tight - behind > (10 if crowded else 100)
    assert crowded or behind > 100  # there bounds are wider


def test_what_many_rectangles_send_is_nearly_what_each_of_them_sends():
    sources = sources_of(crowd(), None)
    g = torch.Generator().manual_seed(5)
    for far, least in ((3.0, 0.0), (12.0, 0.5), (200.0, 0.98)):
        for _ in range(20):
            way = F.normalize(torch.randn(3, generator=g), dim=0).double()
            point, normal = tuple((far * way).tolist()), tuple((-way).tolist())
            roughly, most = weighed(sources, (point, normal), (point, 0.0, normal, normal))
            sent = [choice_kernel.importance(sources, number, point, normal) for number in range(len(sources.lamps))]
            assert (least * np.array(sent) <= roughly).all()
            assert (roughly <= np.array(sent) * (1 + 1e-9)).all()
            assert (sent <= most * (1 + 1e-9)).all()


def test_a_lamp_that_one_pixel_does_not_get_may_still_be_drawn_for_its_tile():
    sources = sources_of(forms(polished_scene(1))[0].lamps, None)
    lamps = len(sources.lamps)
    candidates, others = np.empty(lamps, np.int32), (np.empty(lamps, np.int32), np.empty(lamps))
    point, away = (0.0, 40.0, 0.0), (0.0, 1.0, 0.0)  # above everything, and turned from it
    low, high = np.array([*point, -1.0, -1.0, -1.0]), np.array([*point, 1.0, 1.0, 1.0])
    bright = 1e9  # nothing is worth rays of its own
    tile = 1.0, low, high, candidates, others, np.empty(lamps)
    found, count, sent = choice_kernel.find_candidates(sources, 0, point, away, bright, *tile)
    assert (found, sent) == (0, 0.0)
    reached = [n for n in range(lamps) if choice_kernel.importance(sources, n, point, (0.0, -1.0, 0.0)) > 0]
    assert len(reached) > 4
    assert set(reached) <= set(others[0][:count].tolist())
    assert (np.diff(others[1][:count], prepend=0.0) > 0).all()


def test_lamps_that_a_tile_leaves_out_are_drawn_without_bias(monkeypatch: pytest.MonkeyPatch):
    compiled = forms(lamps_over_ground())[1]
    everything = torch.ones(compiled.surface.lit.numel()), torch.rand(compiled.surface.lit.numel())

    def pictures(few: int) -> torch.Tensor:
        monkeypatch.setattr(drivers, "FEW", few)
        return torch.stack([compiled.arriving(blue_noise(*SIZE, index=i, dims=3, seed=5), 4) for i in range(32)])

    looked_at, left_out = pictures(1 << 20), pictures(0)
    rest = compiled.lists(*everything, 0, len(everything[0]))[2][1]
    assert (rest > 0).sum() > 2000
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
