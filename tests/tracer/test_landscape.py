"""Views over land from files, and the sun by the hour."""

from __future__ import annotations

import math
import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch

import tracer
from tracer.scene.cells import world_of_cells
from tracer.scene.daylight import at_hour
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene
from tracer.scene.world import World
from tracer.worlds.landscape import landscape

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


def test_a_single_voxel_has_views():
    table = MaterialTable.of([Material(name="stone")])
    found = landscape(world_of_cells(np.array([[5, -3, 7]]), np.array([1], np.int16), table))
    for view in found.views.values():
        assert np.isfinite([*view.eye(1.0), *view.target(1.0)]).all()


def test_the_sun_goes_from_east_to_west_and_lamps_have_the_night():
    base = scene()
    for hour, x in ((8, 1), (12, 0), (16, -1)):
        sun = at_hour(base, hour).sun
        assert sun is not None
        assert math.copysign(1, sun.direction[0]) == x or abs(sun.direction[0]) < 1e-6
        assert sun.direction[1] > 0
    moon = at_hour(base, 20).sun  # where the sun was at 8
    assert moon is not None
    assert moon.direction[0] > 0.5 < moon.direction[1] + 0.3
    light = {hour: at_hour(base, hour) for hour in (0, 5.9, 6.5, 12, 17.5, 18.1, 24)}
    strength = {hour: sum(found.sun.irradiance) for hour, found in light.items() if found.sun is not None}
    assert strength[12] == pytest.approx(sum(base.sun.irradiance), rel=1e-3) if base.sun else False
    assert strength[0] == strength[24] < 0.1 * strength[12]
    assert sum(light[0].sky.zenith) < 0.1 * sum(light[12].sky.zenith)
    low = light[17.5].sun
    assert low is not None
    assert low.irradiance[2] / low.irradiance[0] < 0.5  # red
    hours = [at_hour(base, h / 20) for h in range(481)]
    steps = np.array([[*found.sky.zenith, *(found.sun.irradiance if found.sun else ())] for found in hours])
    assert np.abs(np.diff(steps, axis=0)).max() < 0.35  # nothing jumps
    assert torch.equal(hours[3].world.index, base.world.index)


@pytest.mark.parametrize("hour", [-0.1, 24.1, math.nan])
def test_hours_that_no_day_has_are_refused(hour: float):
    with pytest.raises(ValueError, match=r"hour must lie in 0\.\.24"):
        at_hour(scene(), hour)
