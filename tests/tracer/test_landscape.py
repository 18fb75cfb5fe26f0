"""Views over land from files, and the sun by the hour."""

from __future__ import annotations

import os
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from blocks import cubes_of

import tracer
from tracer.formats.minecraft.build import instance_of
from tracer.lights.sky import sky_radiance
from tracer.scene.cells import world_of_cells
from tracer.scene.daylight import at_hour
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene
from tracer.scene.world import World
from tracer.worlds.regions.landscape import landscape

DATA = os.environ.get("GBUFRT_TEST_DATA")
REAL = ("1.12.2/r.0.-1.mca", "1.18.2/r.0.0.mca", "1.21.1/r.0.0.mca", "synthetic_1.21/r.0.0.mca")


def hills(side: int = 96) -> World:
    """Rolling ground with trees of one voxel's width, partly below zero."""
    x, z = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    height = (6 * np.sin(x / 9.0) + 5 * np.cos(z / 13.0)).round().astype(int)
    depth = np.arange(-14, 36)
    y = np.broadcast_to(depth, (side, side, len(depth)))
    solid = y <= height[..., None]
    tree = ((x % 11 == 3) & (z % 13 == 5))[..., None] & (y > height[..., None]) & (y < 12)
    cells = np.stack([x[..., None] + 0 * y, y, z[..., None] + 0 * y], axis=-1)
    table = MaterialTable.of([Material(name="earth"), Material(name="grass"), Material(name="wood")])
    ids = np.where(tree, 3, np.where(y == height[..., None], 2, 1))
    pillar = ((x % 26 < 4) & (z % 26 < 4))[..., None] & (y > height[..., None])
    kept = solid | tree | pillar
    return world_of_cells(cells[kept] - (40, 0, 200), ids[kept].astype(np.int16), table)


@cache
def scene() -> Scene:
    return landscape(hills())


def looks_free(scene: Scene, name: str, time: float, near: float) -> float:
    """The share of rays that hit something, once it is clear that nothing is before the lens."""
    camera = scene.views[name].camera(time, size=(18, 32))
    assert not scene.world.at(camera.position[0].floor().long()).any(), f"{name} at {time} s is in a block"
    hits = tracer.trace(scene, *camera.rays(), poses=scene.poses([time]))
    close = (hits.t < near) & hits.hit
    assert close.float().mean() < 0.03, f"{name} at {time} s is against something"
    return float(hits.hit.float().mean())


def test_little_in_a_void_is_framed_rather_than_looked_past():
    cells = np.argwhere(np.ones((5, 3, 4))) - (-200, -70, 30)
    alone = landscape(world_of_cells(cells, np.ones(len(cells), np.int16), MaterialTable.of([Material(name="stone")])))
    assert looks_free(alone, "landscape", 0.0, 2.0) > 0.15


@pytest.mark.parametrize("name", ["landscape", "orbit", "flight"])
def test_views_look_at_the_land_with_nothing_before_the_lens(name: str):
    shares = [
        looks_free(scene(), name, time, near=9.0 if name == "landscape" else 4.0) for time in (0.0, 7.0, 19.0, 31.0)
    ]
    assert min(shares) > 0.25
    if name == "landscape":
        assert 0.4 < shares[0] < 0.95


@pytest.mark.parametrize("name", REAL)
def test_views_of_real_regions_are_free(name: str):
    if DATA is None:
        pytest.skip("GBUFRT_TEST_DATA is not set")
    pytest.importorskip("nbtlib")
    found = tracer.load(Path(DATA) / "mca" / name)
    assert 0.4 < looks_free(found, "landscape", 0.0, near=5.0) < 0.95
    for time in np.linspace(0, 48, 9)[:-1]:
        looks_free(found, "flight", float(time), near=4.0)


def test_a_tower_is_not_looked_at_from_under_its_wall():
    """Though its many materials are what there is to see."""
    ground = np.stack(np.meshgrid(np.arange(64), [0], np.arange(64), indexing="ij"), axis=-1).reshape(-1, 3)
    tower = np.stack(np.meshgrid(np.arange(12, 52), np.arange(1, 40), [31, 32], indexing="ij"), axis=-1).reshape(-1, 3)
    ids = np.concatenate([np.ones(len(ground)), 2 + tower[:, 0] % 12]).astype(np.int16)
    table = MaterialTable.of([Material(name=f"m{n}") for n in range(14)])
    found = landscape(world_of_cells(np.concatenate([ground, tower]), ids, table))
    assert looks_free(found, "landscape", 0.0, near=14.0) > 0.3


def island(*, gap: bool = False, land: int = 0) -> World:
    """Three by three chunks of sea, 20 deep, less one at a corner; a hill of earth.

    With a ``gap`` one column at an end has no water. With ``land`` there is water before z = 16 alone, from so far on.
    """
    table = MaterialTable.of([Material(name="earth"), Material(name="water plains", opacity=0.5)])
    cells = np.indices((48, 40, 48))
    x, y, z = cells
    earth = (y < 4) | ((x - 24) ** 2 + (z - 24) ** 2 < (34 - y) ** 2 / 4) & (y < 34)
    earth |= (land > 0) & ((x < land) | (z >= 16)) & (y < 30)
    kept = (earth | (y < 24)) & ~((x < 16) & (z < 16)) & ~(gap & (x == 0) & (z == 20) & (y >= 4))
    return world_of_cells(cells[:, kept].T, np.where(earth, 1, 2)[kept].astype(np.int16), table)


def test_land_in_the_sea_goes_on_as_sea():
    world = island()
    found = landscape(world).world
    inside = torch.stack(torch.meshgrid(torch.arange(16, 48), *[torch.arange(48)] * 2, indexing="ij"), dim=-1)
    assert torch.equal(found.at(inside), world.at(inside))
    for place in ((8, 8), (-700, 300), (24, 1000)):
        column = [int(found.at(torch.tensor([place[0], y, place[1]]))) for y in (3, 4, 23, 24)]
        assert column == [1, 2, 2, 0]
    looks_free(landscape(world), "landscape", 0.0, near=5.0)
    assert landscape(island(gap=True)).world.bounds() == world.bounds(), "the sea would stand in the gap as a wall"


@pytest.mark.parametrize(("land", "coast"), [(16, True), (32, False)])
def test_land_with_a_coast_goes_on_as_sea(land: int, coast: bool):
    """A third of the border is water, or a sixth of it."""
    world = island(land=land)
    scene = landscape(world)
    assert (scene.world.bounds() != world.bounds()) == coast
    assert scene.sky.plain is not None
    assert (scene.sky.plain.water == 1) == coast
    beyond = [int(scene.world.at(torch.tensor([60, y, 40]))) for y in (3, 4, 23, 24, 29)]
    assert beyond == ([1, 2, 2, 0, 0] if coast else [0] * 5), "water before the cliff"


def upland(*, side: int = 160, shift: int = 0) -> World:
    """Hills, whose heights depend on x and z in ways that no mirror image repeats, over a deep cellar of rock."""
    x, y, z = np.indices((side, 70, side))
    height = (52 + 5 * np.sin(x / 31.0) + 4 * np.cos(z / 23.0) + x / 40).round()
    table = MaterialTable.of([Material(name="stone"), Material(name="grass")])
    kept = y <= height
    cells = np.stack([x - 32 + shift, y - 8, z + 48], axis=-1)
    return world_of_cells(cells[kept], np.where(y == height, 2, 1)[kept].astype(np.int16), table)


def tops(world: World, x: range, z: range) -> torch.Tensor:
    """``(X, Z)`` heights of columns."""
    y = torch.arange(-8, 70)
    cells = torch.stack(torch.meshgrid(torch.tensor(x), y, torch.tensor(z), indexing="ij"), dim=-1)
    return ((world.at(cells) > 0) * (y[:, None] + 1)).amax(dim=1)


def test_land_without_a_coast_goes_on_as_its_mirror_image():
    world, scene = upland(), landscape(upland())
    whole = tops(scene.world, range(-532, 638), range(-452, 718))
    assert whole.min() > 30, "it goes on without a gap"
    assert max(int(whole.diff(dim=axis).abs().max()) for axis in (0, 1)) <= 1, "and without a step"
    own = tops(world, range(-32, 128), range(48, 208))
    assert torch.equal(whole[500:660, 500:660], own)
    assert torch.equal(whole[660:820, 500:660], own.flip(0))
    assert torch.equal(whole[340:500, 660:820], own.flip(0, 1))
    assert torch.equal(whole[820:980, 180:340], own), "the image of an image is turned back"
    assert scene.haze is not None
    assert scene.haze.end < 512
    assert scene.world.index.unique().tolist() == list(range(len(scene.world.bricks))), "no brick is kept in vain"
    assert int(scene.world.at(torch.tensor([200, -8, 60]))) == 0 < int(scene.world.at(torch.tensor([20, -8, 60])))
    for name in scene.views:
        looks_free(scene, name, 11.0, near=4.0)


def test_the_eye_goes_round_over_hills_that_stand_in_its_way():
    """Where land goes on, the way round lies over it."""
    x, y, z = np.indices((256, 200, 256))
    kept = y < np.where((x - 128) ** 2 + (z - 20) ** 2 < 30**2, 190, 8)
    table = MaterialTable.of([Material(name="stone")])
    cells = np.stack([x, y, z], axis=-1)[kept]
    found = landscape(world_of_cells(cells, np.ones(len(cells), np.int16), table))
    assert found.haze is not None
    for time in np.linspace(0, 36, 37):
        looks_free(found, "orbit", float(time), near=4.0)


@pytest.mark.parametrize("kept", ["beyond", "small", "ragged", "shifted"])
def test_some_land_ends_where_its_file_does(kept: str):
    """Where that is wanted, and where a mirror image would be seen for what it is, or not meet it."""
    world = upland(side=112 if kept == "small" else 160, shift=3 if kept == "shifted" else 0)
    if kept == "ragged":
        index = world.index.clone()
        index[::2, :, ::2] = 0
        world = replace(world, index=index)
    scene = landscape(world, beyond=kept != "beyond")
    assert scene.world.bounds() == world.bounds()
    assert scene.haze is None


def test_leaves_go_on_as_cubes_and_plants_do_not():
    """They are no voxels of the world, but an instance of finer ones."""
    world, table = upland(), upland().materials
    places = np.array([[20, 62, 60], [40, 62, 60]])
    fine = np.concatenate(
        [8 * places[0] + np.argwhere(np.ones((8, 8, 8))), 8 * places[1] + np.argwhere(np.eye(8)[..., None])]
    )
    shapes = instance_of(world_of_cells(fine, np.ones(len(fine), np.int16), table))
    far = landscape(world, (shapes,)).world
    mirrored = [int(far.at(torch.tensor([255 - x, y, z]))) for x, y, z in places]
    assert mirrored == [1, 0]
    assert [int(far.at(torch.tensor(place))) for place in places] == [0, 0], "they are what they were where they are"


def test_a_long_piece_of_land_is_flown_over_along_its_length():
    x, y, z = np.indices((240, 6, 48))
    strip = world_of_cells(
        np.stack([x, y, z], axis=-1).reshape(-1, 3), np.ones(x.size, np.int16), hills(side=96).materials
    )
    flight = landscape(strip).views["flight"]
    eyes = np.array([flight.eye(time) for time in np.linspace(0, 48, 97)])
    assert 0 < eyes[:, 2].min() < 14 < 34 < eyes[:, 2].max() < 48
    assert np.ptp(eyes[:, 0]) > 140


def test_below_the_horizon_lies_what_the_border_shows():
    sea, mixed = (landscape(island(gap=gap)) for gap in (False, True))
    earth = sea.world.materials.albedo[1].tolist()
    assert sea.sky.plain is not None
    assert sea.sky.plain.water == 1
    assert mixed.sky.plain is not None
    assert 0.9 < mixed.sky.plain.water < 1
    assert mixed.sky.plain.albedo == pytest.approx(earth)
    sky = {scene: at_hour(scene, 12.0).sky for scene in (sea, mixed)}
    assert sky[mixed].plain == mixed.sky.plain
    down = [float(found.picture[..., -1, :].mean()) for found in sky.values() if found.picture is not None]
    assert down[1] > 1.02 * down[0], "land among the water is brighter"
    night = at_hour(sea, 0.0, day=14.765).sky.picture
    assert night is not None
    assert float(night[..., -1, :].mean()) < 0.1 * float(night[..., 0, :].mean()), "and does not glow by itself"


def roofed(*, lid: str) -> World:
    """Ground with pillars in a closed hall of which the highest parts are 29 voxels high."""
    x, y, z = np.indices((96, 48, 96))
    floor = 8 + 4 * np.sin(x / 9.0) + 3 * np.cos(z / 7.0)
    inside = (y > floor) & (y < 40 + 3 * np.sin(z / 8.0)) & ~((x % 24 < 4) & (z % 20 < 4))
    ids = np.where(y == 47, 3, np.where(y < 3, 2, 1))
    names = ("netherrack", "lava", lid)
    cells = np.stack([x + 16, y, z - 40], axis=-1)[~inside]
    return world_of_cells(cells, ids[~inside].astype(np.int16), MaterialTable.of([Material(name=n) for n in names]))


def test_under_a_roof_of_bedrock_the_eye_is_between_floor_and_roof():
    found = landscape(roofed(lid="bedrock"))
    assert found.sun is None
    assert found.haze is not None
    for name, time in (("landscape", 0.0), ("panorama", 9.0), ("panorama", 20.0)):
        assert 3 < found.views[name].eye(time)[1] < 44
        assert looks_free(found, name, time, near=1.0) > 0.1  # it ends where the file does
    ahead, around = (found.views["panorama"].target(time) for time in (0.0, 18.0))
    assert np.allclose(np.add(ahead, around)[[0, 2]], 2 * np.array(found.views["landscape"].eye(0.0))[[0, 2]])
    assert looks_free(found, "landscape", 0.0, near=9.0) > 0.5
    outside = landscape(roofed(lid="granite"))
    assert outside.views["landscape"].eye(0.0)[1] > 48
    assert outside.sun is not None
    solid = world_of_cells(np.array([[0, 0, 0]]), np.array([1], np.int16), MaterialTable.of([Material(name="bedrock")]))
    assert "orbit" in landscape(solid).views, "there is nothing below it"


@pytest.mark.parametrize("stone", ["end_stone", "granite"])
def test_the_end_has_a_dark_sky_that_lights_from_overhead(stone: str):
    x, z = np.indices((64, 64)).reshape(2, -1)
    cells = np.stack([x, 8 + (3 * np.sin(x / 9.0)).astype(int), z], axis=-1)
    found = landscape(world_of_cells(cells, np.ones(len(x), np.int16), MaterialTable.of([Material(name=stone)])))
    assert {*found.views} == {"landscape", "orbit", "flight"}
    up = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.2, 0.98]]).T[None]
    overhead, ahead = sky_radiance(found, up)[0].mean(dim=0).tolist()
    assert (overhead > 10 * ahead > 0) == (found.sun is None) == (stone == "end_stone")


@pytest.mark.parametrize("state", ["oak_slab[type=top]", "oak_slab[type=bottom]", "poppy"])
def test_land_without_a_cube_has_views(state: str):
    built = cubes_of(f"minecraft:{state}").build()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = landscape(built.world, built.instances)
        assert looks_free(found, next(iter(found.views)), 0.0, near=0.0) > 0


def test_a_single_voxel_has_views():
    table = MaterialTable.of([Material(name="stone")])
    found = landscape(world_of_cells(np.array([[5, -3, 7]]), np.array([1], np.int16), table))
    for view in found.views.values():
        assert np.isfinite([*view.eye(1.0), *view.target(1.0)]).all()
