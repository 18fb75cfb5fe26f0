"""The view from within a sea that has nothing over it."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import voxels

from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance
from tracer.scene.world import World
from tracer.worlds.regions.depths import view_within
from tracer.worlds.regions.landscape import landscape

SAND, WATER, KELP = 1, 2, 3
TABLE = MaterialTable.of(
    [Material(name="sand"), Material(name="water in ocean", opacity=0.25, tint=(0.4, 0.6, 0.75)), Material(name="kelp")]
)
LEVEL = 40


def sea(*boxes: tuple) -> World:
    """Water of 40 blocks over sand, 64 wide."""
    return voxels.world(
        (64, 48, 64), (WATER, (0, 0, 0), (64, LEVEL, 64)), (SAND, (0, 0, 0), (64, 8, 64)), *boxes, table=TABLE
    )


def kelp() -> Instance:
    """Stalks a quarter of a block thick round (30, 30), up to three blocks below the surface."""
    stalks = [
        (KELP, (4 * x + 1, 32, 4 * z + 1), (4 * x + 2, 4 * (LEVEL - 3), 4 * z + 2)) for x in (29, 31) for z in (30, 33)
    ]
    model = voxels.world((256, 192, 256), *stalks, table=TABLE)
    return Instance(model=model, pose=lambda _: torch.eye(4), scale=0.25)


def look(world: World, *instances: Instance) -> tuple[np.ndarray, np.ndarray]:
    view = view_within(world, instances, float(LEVEL))
    assert view is not None
    eye, target = (np.array(place(0.0)) for place in (view.eye, view.target))
    assert LEVEL - 14 < eye[1] <= LEVEL - 3
    return eye, (target - eye) / np.linalg.norm(target - eye)


@pytest.mark.parametrize("what", ["kelp", "rock"])
def test_it_looks_at_what_reaches_up_into_the_light(what: str):
    rock = sea((SAND, (28, 8, 29), (33, LEVEL - 4, 34)))
    eye, way = look(sea(), kelp()) if what == "kelp" else look(rock)
    to = np.array([30.5, eye[1], 31.5]) - eye
    assert 3 < np.linalg.norm(to) < 12
    assert way[[0, 2]] @ to[[0, 2]] > 0.85 * np.linalg.norm(to[[0, 2]]) * np.linalg.norm(way[[0, 2]])
    assert way[1] > 0, "and up to the surface"


def test_there_is_none_where_all_lies_in_the_dark():
    assert view_within(sea(), (), float(LEVEL)) is None


def test_it_comes_first_only_where_all_is_sea():
    rock = (SAND, (28, 8, 29), (33, LEVEL - 4, 34))
    assert next(iter(landscape(sea(rock)).views)) == "underwater"
    island = landscape(sea(rock, (SAND, (10, 8, 10), (14, LEVEL + 4, 14))))
    assert next(iter(island.views)) == "landscape"
    assert island.waves is not None
    assert "underwater" not in landscape(sea()).views
