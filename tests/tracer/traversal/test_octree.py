"""The octree against the bricks."""

from __future__ import annotations

import pytest
import torch
import voxels
from voxels import STONE, WATER

from tracer.scene.scene import Scene
from tracer.scene.world import World
from tracer.traversal.octree import Octree, morton
from tracer.traversal.rays import trace

WORLDS = {
    "scattered": voxels.random_world(0, origin=(-20, -6, -17)),
    "pool": voxels.world((48, 20, 48), (STONE, (0, 0, 0), (48, 8, 48)), (WATER, (4, 3, 9), (37, 8, 41))),
    "block": voxels.world((16, 16, 16), (STONE, (0, 0, 0), (16, 16, 16)), origin=(-8, -8, -8)),
    "far apart": voxels.world((80, 16, 112), (STONE, (3, 3, 3), (8, 9, 8)), (STONE, (79, 15, 111), (80, 16, 112))),
    "nothing": voxels.world((16, 16, 16)),
}


@pytest.mark.parametrize("name", WORLDS)
def test_hits_are_those_of_the_bricks(name: str) -> None:
    world = WORLDS[name]
    origins, directions = (rays.view(2, -1, 3) for rays in voxels.random_rays(3, 6000))
    span = {"t_min": 0.5, "t_max": torch.linspace(1.0, 80.0, 3000)}
    for given in ({}, span):
        a = trace(Scene(world=world), origins, directions, **given)
        b = Octree.of(world).trace(origins, directions, **given)
        differs = (a.hit != b.hit) | (a.hit & ((a.cell != b.cell).any(-1) | (a.face != b.face)))
        differs |= a.hit & ((a.material != b.material) | (a.back_face != b.back_face))
        assert differs.float().mean() <= 0.001, "all but rays along an edge"
        agree = a.hit & b.hit & ~differs
        torch.testing.assert_close(b.t[agree], a.t[agree], rtol=0, atol=1e-4)
        torch.testing.assert_close(b.local[agree], a.local[agree], rtol=0, atol=1e-4)
        assert torch.equal(b.normal[agree], a.normal[agree])
        assert torch.equal(b.t.isinf(), ~b.hit)
        assert bool(a.hit.any()) == (name != "nothing")


def test_uniform_cubes_are_one_child() -> None:
    tree = Octree.of(WORLDS["block"])
    assert tree.nodes.tolist() == [[-STONE] * 8], "the root alone"
    assert Octree.of(WORLDS["nothing"]).nodes.tolist() == [[0] * 8]


def test_nodes_lead_to_every_voxel() -> None:
    world = voxels.random_world(5, (33, 17, 40))
    tree = Octree.of(world)
    cells = torch.cartesian_prod(*(torch.arange(n * 16) for n in world.index.shape))
    row, value = torch.zeros(len(cells), dtype=torch.long), torch.full((len(cells),), -1)
    for level in reversed(range(tree.levels)):
        child = tree.nodes[row, (cells >> level & 1) @ torch.tensor([4, 2, 1])].long()
        value = torch.where((value < 0) & (child <= 0), -child, value)
        row = torch.where(value < 0, child, row)
    assert torch.equal(value, world.at(cells).long())


def test_each_level_is_in_morton_order_however_bricks_are_split(monkeypatch: pytest.MonkeyPatch) -> None:
    world = voxels.random_world(6, (70, 40, 50))
    whole = Octree.of(world)
    monkeypatch.setattr("tracer.traversal.octree.PART", 3)
    assert torch.equal(Octree.of(world).nodes, whole.nodes)
    mixed = whole.nodes[whole.nodes > 0]
    assert torch.equal(mixed, torch.arange(1, len(whole.nodes), dtype=torch.int32)), "children follow their parents"


def test_codes_interleave_x_y_and_z() -> None:
    assert morton(torch.tensor([[1, 0, 0], [0, 1, 0], [0, 0, 1], [3, 0, 2]]), 2).tolist() == [4, 2, 1, 0b101100]


def test_a_large_world_of_one_brick_costs_a_node_a_level() -> None:
    index = torch.zeros(64, 1, 64, dtype=torch.int32)
    index[40, 0, 3] = 1
    bricks = torch.zeros(2, 16, 16, 16, dtype=torch.int16)
    bricks[1, 5, 5, 5] = STONE
    tree = Octree.of(World(bricks=bricks, index=index, origin=(0, 0, 0), materials=voxels.TABLE))
    assert len(tree.nodes) == tree.levels == 10
