"""Where a file of land ends: the sea to the horizon, or the land's mirror image in haze."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from traversals import looks_free

from tracer.formats.minecraft.build import instance_of
from tracer.scene.cells import world_of_cells
from tracer.scene.daylight import at_hour
from tracer.scene.material import Material, MaterialTable
from tracer.scene.world import World
from tracer.worlds.regions.landscape import landscape


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


def test_the_floor_of_the_sea_beyond_shows_no_copies():
    """It is even, and as deep as the deepest place of the border."""
    world = island()
    cells = torch.stack(torch.meshgrid(torch.arange(48), torch.arange(24), torch.arange(48), indexing="ij"), dim=-1)
    ids = world.at(cells)
    ids[::2, 4] = ids[::2, 4].clamp_max(1)
    ids[1, 2:4, 47] = 2
    kept = ids > 0
    uneven = world_of_cells(cells[kept].numpy(), ids[kept].numpy(), world.materials)
    found = landscape(uneven).world
    at = torch.stack(torch.meshgrid(torch.arange(60, 90), torch.arange(24), torch.arange(30), indexing="ij"), dim=-1)
    beyond = found.at(at)
    assert beyond[0, :, 0].tolist() == [1, 1] + 22 * [2]
    assert (beyond == beyond[:1, :, :1]).all()


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


@pytest.mark.parametrize("kept", ["bare", "small", "ragged", "shifted"])
def test_some_land_ends_where_its_file_does(kept: str):
    """Where that is wanted, and where a mirror image would be seen for what it is, or not meet it."""
    world = upland(side=112 if kept == "small" else 160, shift=3 if kept == "shifted" else 0)
    if kept == "ragged":
        index = world.index.clone()
        index[::2, :, ::2] = 0
        world = replace(world, index=index)
    scene = landscape(world, bare=kept == "bare")
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
