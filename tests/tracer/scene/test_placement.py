"""Models on their ground: views that frame them, and ground that fills the picture."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tracer import Material, MaterialTable, World, trace
from tracer.scene.cells import cells_of_world
from tracer.scene.placement import place

SIZE = (54, 96)
STONE = MaterialTable.of([Material(name="stone")])


def model(shape: str) -> World:
    voxels = torch.zeros(24, 40, 24, dtype=torch.int16)
    if shape == "tower":
        voxels[8:14, :, 8:14] = 1
    elif shape == "slab":
        voxels[:, :3, 4:20] = 1
    else:  # a low wall along one side, and a pole in the opposite corner
        voxels[:2, :6, :] = 1
        voxels[-1, :, -1] = 1
    return World.from_dense(voxels, STONE)


@pytest.mark.parametrize("shape", ["tower", "slab", "wall and pole"])
def test_the_front_view_shows_all_of_the_model_in_its_middle_and_nothing_but_ground_beside_it(shape):
    world = model(shape)
    scene = place(world)
    camera = scene.views["front"].camera(0.0, size=SIZE)
    cells, _ = cells_of_world(world)
    corners = (cells[:, None] + np.array(list(np.ndindex(2, 2, 2)))).reshape(-1, 3)
    points = torch.as_tensor(corners, dtype=torch.float32).T[None, :, :, None]
    px = camera.project(camera.to_view(points))[0, :, :, 0]
    low, high = px.amin(1), px.amax(1)
    size = torch.tensor([SIZE[1], SIZE[0]])
    assert bool((low >= 0).all())
    assert bool((high <= size).all())
    assert float(((low + high) / 2 - size / 2).abs().max()) < 0.01 * SIZE[0], "in the middle"
    assert float(((high - low) / size).max()) > 0.75, "large"
    assert bool(trace(scene, *camera.rays()).hit.all()), "no edge of the ground"
