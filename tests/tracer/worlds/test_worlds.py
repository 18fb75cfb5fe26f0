"""Built-in worlds: reproducible, made of what they promise, viewed from free places, with movers that touch nothing."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from torch import Tensor

from tracer import worlds
from tracer.scene.cells import cells_of_world, world_of_cells
from tracer.scene.daylight import at_hour
from tracer.scene.material import Material, MaterialTable
from tracer.scene.placement import place
from tracer.scene.scene import Instance, Scene
from tracer.scene.world import World
from tracer.traversal.rays import trace

TIMES = [0.0, 0.7, 2.5, 4.9, 7.3, 10.0]
MAY_TOUCH = {"water", "reed", "leaf", "leaf_light", "blossom_light"}
STILL = ("village", "lake", "cave", "plaza", "hall", "horizon", "closeup", "mill")
PATHS = {"flythrough": 40.0, "orbit": 36.0}


@cache
def valley(seed: int = 0) -> Scene:
    return worlds.builtin(seed)


def test_builds_quickly() -> None:
    worlds.builtin(0)
    begin = time.process_time()
    worlds.builtin(0)
    assert time.process_time() - begin < 4.0  # well under a second on a quiet machine


def test_the_same_seed_gives_the_same_world_and_another_does_not() -> None:
    again, other = worlds.builtin(0), valley(1)
    assert torch.equal(valley().world.bricks, again.world.bricks)
    assert torch.equal(valley().world.index, again.world.index)
    assert not torch.equal(valley().world.index, other.world.index) or not torch.equal(
        valley().world.bricks, other.world.bricks
    )


def test_a_wrong_view_is_told_the_right_ones() -> None:
    with pytest.raises(
        KeyError, match=r"no view 'vilage' in the scene \(did you mean village or lake\?\); it has village, lake"
    ):
        valley().views["vilage"]
    assert valley().views.get("vilage") is None
    assert replace(valley(), sun=None).views["lake"] is valley().views["lake"]


def test_the_valley_holds_water_glass_lamps_metal_and_polished_stone() -> None:
    table = valley().world.materials
    used = torch.bincount(valley().world.bricks.flatten().long(), minlength=len(table))
    for name, least in (
        ("water", 5000),
        ("glass", 100),
        ("lamp", 40),
        ("gold", 30),
        ("marble", 300),
        ("red_wall", 100),
    ):
        assert int(used[table.id(name)]) >= least, name
    shiny = (table.roughness < 0.15) & (table.opacity == 1) & (used > 100)
    assert bool(shiny.any())


def test_albedos_are_those_of_real_surfaces_and_lamps_are_in_proportion_to_the_sun() -> None:
    table = valley().materials
    assert float(table.albedo.max()) <= 0.85
    dielectric = table.albedo[1:][table.metallic[1:] == 0]
    assert float(dielectric.min()) > 0.0
    assert float(dielectric.amin(1).div(dielectric.amax(1)).min()) > 0.02
    assert 2.0 < float(table.emission.max()) < 20.0


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_every_view_is_outside_blocks_and_sees_the_world(seed: int) -> None:
    scene = valley(seed)
    assert next(iter(scene.views)) == "village"
    assert set(STILL) | set(PATHS) <= set(scene.views)
    for name, view in scene.views.items():
        for t in (0.0, *(PATHS[name] * i / 24 for i in range(1, 24))) if name in PATHS else (0.0,):
            camera = view.camera(t, size=(18, 32))
            around = camera.position[0] + 0.35 * torch.tensor(
                [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
            )
            assert not scene.world.at(around.floor().long()).any(), f"{name} at {t:.1f} s sits in a block"
            origins, directions = camera.rays()
            hits = trace(scene, origins, directions, poses=scene.poses([t]))
            share = hits.hit.float().mean().item()
            least = 0.40 if name in ("mill", *PATHS) else 0.55
            assert share > least, f"{name} at {t:.1f} s sees {share:.0%} of world"
            near = hits.t[hits.hit].quantile(0.1).item()
            assert near > (1.5 if name in STILL else 4.0), f"{name} at {t:.1f} s is against a wall, {near:.1f} away"


def test_still_views_stay_and_paths_move_smoothly_and_return() -> None:
    views = valley().views
    for name in STILL:
        assert tuple(views[name].eye(0.0)) == tuple(views[name].eye(3.7))
    for name, seconds in PATHS.items():
        eyes = torch.tensor([views[name].eye(seconds * i / 480) for i in range(481)])
        step = eyes.diff(dim=0)
        assert torch.allclose(eyes[0], eyes[-1], atol=1e-4)
        assert float(step.norm(dim=1).min()) > 0.01
        assert float(step.diff(dim=0).norm(dim=1).max()) < 0.25 * float(step.norm(dim=1).mean())


def centers(instance: Instance, t: float) -> Tensor:
    cells, _ = cells_of_world(instance.model)
    local = (torch.from_numpy(cells).double() + 0.5) * instance.scale
    pose = instance.pose(t).double()
    return local @ pose[:3, :3].T + pose[:3, 3]


def test_at_least_three_things_move_rigidly_inside_the_world() -> None:
    scene = valley()
    low, high = scene.world.bounds()
    moving = 0
    for instance in scene.instances:
        for t in TIMES:
            pose = instance.pose(t)
            assert pose.shape == (4, 4)
            assert torch.allclose(pose[:3, :3] @ pose[:3, :3].T, torch.eye(3, dtype=pose.dtype), atol=1e-6)
            assert torch.linalg.det(pose[:3, :3]).item() == pytest.approx(1.0, abs=1e-6)
            points = centers(instance, t)
            assert bool((points > torch.tensor(low)).all())
            assert bool((points < torch.tensor(high)).all())
        moving += not torch.allclose(instance.pose(0.0), instance.pose(1.0), atol=1e-2)
        jump = (instance.pose(5.0 + 1 / 240) - instance.pose(5.0)).norm().item()
        assert jump < 0.1, f"{instance.name} jumps"
    assert moving >= 3


@pytest.mark.parametrize("seed", [0, 2])
def test_movers_stay_out_of_solid_voxels(seed: int) -> None:
    scene = valley(seed)
    names = scene.world.materials.names
    for instance in scene.instances:
        for i in range(41):
            ids = scene.world.at(centers(instance, 0.25 * i).floor().long())
            touched = {names[j] for j in ids.unique().tolist()} - MAY_TOUCH - {"air"}
            assert not touched, f"{instance.name} runs into {touched} at {0.25 * i:.2f} s"


def test_some_instance_shines() -> None:
    assert any(bool(i.model.materials.emission[i.model.bricks.unique().long()].any()) for i in valley().instances)


def test_terrain_has_the_size_asked_for_and_a_horizon() -> None:
    scene = worlds.terrain()
    assert scene.world.bounds() == ((0, 0, 0), (256, 128, 256))
    camera = scene.views["horizon"].camera(0.0, size=(24, 40))
    hits = trace(scene, *camera.rays())
    assert 0.4 < hits.hit.float().mean().item() < 0.9
    assert hits.t[hits.hit].max().item() > 150
    assert not torch.equal(scene.world.index, worlds.terrain(seed=1).world.index)
    with pytest.raises(ValueError, match="size must be three sides of at least 16"):
        worlds.terrain((8, 128, 256))


def test_worlds_load_by_name_and_say_what_there_is() -> None:
    assert torch.equal(worlds.load("valley").world.index, valley().world.index)
    with pytest.raises(ValueError, match=r"region\.mcx cannot be read as a world; there are"):
        worlds.load("region.mcx")
    with pytest.raises(ValueError, match=r"no world 'valey' \(did you mean valley\?\); there are .*valley.*terrain"):
        worlds.load("valey")
    with pytest.raises(FileNotFoundError, match=r"nowhere\.vox"):
        worlds.load("nowhere.vox")


def test_cells_of_a_world_make_the_same_world() -> None:
    world = valley().world
    again = world_of_cells(*cells_of_world(world), world.materials)
    probe = torch.randint(-20, 280, (4096, 3), generator=torch.Generator().manual_seed(0))
    assert torch.equal(world.at(probe), again.at(probe))
    assert math.prod(again.index.shape) <= math.prod(world.index.shape)


@pytest.mark.parametrize("name", ["valley", "terrain", "model"])
def test_the_plain_below_the_horizon_is_like_the_land_that_ends_there(name: str) -> None:
    """Grey land would be violet under the blue and red light of a morning, beside land that is not."""
    made = {"valley": valley, "terrain": worlds.terrain, "model": lambda: place(one_voxel())}
    morning = at_hour(made[name](), 6.5).sky.picture
    assert morning is not None
    _, green, blue = morning[0, :, 160:].mean(dim=(1, 2)).tolist()
    assert green > 1.15 * blue


def one_voxel() -> World:
    return world_of_cells(np.zeros((1, 3), np.int64), np.ones(1, np.int16), MaterialTable.of([Material(name="stone")]))
