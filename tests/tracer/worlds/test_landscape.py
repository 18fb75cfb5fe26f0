"""Views over land from files, and the sun by the hour."""

from __future__ import annotations

import os
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from blocks import cubes_of
from traversals import looks_free

import tracer
from tracer.lights.sky import sky_radiance
from tracer.scene.cells import world_of_cells
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


def test_a_long_piece_of_land_is_flown_over_along_its_length():
    x, y, z = np.indices((240, 6, 48))
    strip = world_of_cells(
        np.stack([x, y, z], axis=-1).reshape(-1, 3), np.ones(x.size, np.int16), hills(side=96).materials
    )
    flight = landscape(strip).views["flight"]
    eyes = np.array([flight.eye(time) for time in np.linspace(0, 48, 97)])
    assert 0 < eyes[:, 2].min() < 14 < 34 < eyes[:, 2].max() < 48
    assert np.ptp(eyes[:, 0]) > 140


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
