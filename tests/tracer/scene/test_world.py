"""Worlds: dense grids in and the same voxels out, cheap empty space, and clear refusals."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import voxels

from tracer.scene.grids import BRICK, REACHES, Grid
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Scene
from tracer.scene.world import World


def dense_ids(world: World, size: tuple[int, int, int]) -> torch.Tensor:
    grid = torch.stack(torch.meshgrid(*(torch.arange(n) for n in size), indexing="ij"), dim=-1)
    return world.at(grid + torch.tensor(world.origin))


@pytest.mark.parametrize("origin", [(0, 0, 0), (-37, -3, 1000)])
def test_voxels_come_back(origin: tuple[int, int, int]) -> None:
    g = torch.Generator().manual_seed(0)
    ids = torch.randint(0, len(voxels.TABLE), (19, 33, 16), generator=g)
    world = World.from_dense(ids, voxels.TABLE, origin=origin)
    assert torch.equal(dense_ids(world, (19, 33, 16)).long(), ids)
    outside = torch.tensor([[-1, 0, 0], [0, 48, 0], [0, 0, 16]]) + torch.tensor(origin)
    assert world.at(outside).tolist() == [0, 0, 0]
    assert world.bounds() == (origin, (origin[0] + 32, origin[1] + 48, origin[2] + 16))


KINDS = ("u1", "i1", "u2", "u4", "u8", "i8", ">i4")


@pytest.mark.parametrize("kind", KINDS)
def test_ids_may_be_of_any_integer_type_and_lie_in_any_order(kind: str) -> None:
    ids = np.random.default_rng(0).integers(0, 3, (5, 20, 3))
    wanted = World.from_dense(torch.from_numpy(ids), voxels.TABLE).bricks
    array = ids.astype(kind)
    array.flags.writeable = False  # as those of files that are mapped into memory
    mirrored = np.asfortranarray(array[::-1])[::-1]
    tensors = [torch.from_numpy(ids.T.astype(kind, "C")).permute(2, 1, 0)] if kind.isalnum() else []
    for given in (array, mirrored, *tensors):
        assert torch.equal(World.from_dense(given, voxels.TABLE).bricks, wanted)


def test_empty_bricks_are_not_stored() -> None:
    ids = torch.zeros(160, 160, 160, dtype=torch.int16)
    ids[3, 4, 5] = ids[150, 4, 5] = 1
    world = World.from_dense(ids, voxels.TABLE)
    assert len(world.bricks) == 3
    assert not world.empty
    assert World.from_dense(torch.zeros(3, 3, 3, dtype=torch.int16), voxels.TABLE).empty


def test_the_walkable_grid_knows_its_bounds_and_its_empty_space() -> None:
    ids = torch.zeros(100, 40, 60, dtype=torch.int16)
    ids[3:90, 17, 5:59] = 1
    ids[50, 20, 30] = 2
    grid = World.from_dense(ids, voxels.TABLE, origin=(-9, 1, 2)).grid
    assert (grid.low, grid.high) == ((3, 17, 5), (90, 21, 59))
    empty = World.from_dense(torch.zeros(3, 3, 3, dtype=torch.int16), voxels.TABLE).grid
    assert empty.low == empty.high


def test_no_step_through_empty_space_skips_a_voxel() -> None:
    world = voxels.random_world(2, (70, 40, 66), share=0.0005)
    solid = dense_ids(world, tuple(n * BRICK for n in world.index.shape)) > 0  # type: ignore[arg-type]
    grid = world.grid
    for x, y, z in (grid.index <= 0).nonzero().tolist():
        reach = -int(grid.index[x, y, z]) - 1
        low = [max((n - reach) * BRICK, 0) for n in (x, y, z)]
        high = [(n + reach + 1) * BRICK for n in (x, y, z)]
        assert not solid[low[0] : high[0], low[1] : high[1], low[2] : high[2]].any()
    coded = grid.bricks[grid.index.clamp_min(0).long()]
    full = torch.where((grid.index > 0)[..., None, None, None], coded, 0).permute(0, 3, 1, 4, 2, 5).reshape(solid.shape)
    assert torch.equal(full > 0, solid)
    for power in (1, 2, 3):
        side = 2**power
        blocks = [n // side for n in solid.shape]
        split = (blocks[0], side, blocks[1], side, blocks[2], side)
        claimed = (full == -power).view(split).any(5).any(3).any(1)
        assert claimed.any()
        assert not (claimed & solid.view(split).any(5).any(3).any(1)).any()


def test_scenes_convert_and_pose() -> None:
    scene = voxels.random_scene(0)
    moved = scene.to("cpu", copy=True)
    assert torch.equal(moved.grids.entries, scene.grids.entries)
    assert len(moved.materials) == len(voxels.TABLE)
    assert moved.instances[1].scale == scene.instances[1].scale
    assert scene.poses([0.0, 1.0]).shape == (2, 2, 4, 4)
    assert Scene(world=scene.world).poses([0.0]).shape == (1, 0, 4, 4)


def test_a_scene_is_empty_only_without_any_voxel() -> None:
    nothing = World.from_dense(torch.zeros(2, 2, 2, dtype=torch.int16), voxels.TABLE)
    something = voxels.world((2, 2, 2), (1, (0, 0, 0), (1, 1, 1)))
    assert Scene(world=nothing).empty
    assert not Scene(world=nothing, instances=(Instance(model=something, pose=lambda t: torch.eye(4)),)).empty


def test_errors_name_what_is_wrong() -> None:
    table = MaterialTable.of([Material(name="a")])
    with pytest.raises(ValueError, match=r"voxels must be \(X,Y,Z\)"):
        World.from_dense(torch.zeros(3, 3, dtype=torch.int16), table)
    with pytest.raises(ValueError, match=r"voxels must hold ids in 0..1, the material table; got 0..2"):
        World.from_dense(torch.arange(3).view(1, 1, 3), table)
    with pytest.raises(ValueError, match=r"got -1..0"):
        World.from_dense(torch.tensor([[[-1, 0]]]), table)
    with pytest.raises(TypeError, match=r"integer material ids, got torch\.float32"):
        World.from_dense(torch.zeros(2, 2, 2), table)
    solid, listed = np.ones((2, 2, 2), np.int64), [Material(name="a")]
    for wrong, message in (
        ((solid.astype(bool), table), r"integer material ids, got torch\.bool"),
        ((solid * 1j, table), r"integer material ids, got torch\.complex128"),
        ((solid.tolist(), table), "voxels must be a tensor or a numpy array, got list"),
        ((solid, listed), "materials must be a MaterialTable, got list"),
    ):
        with pytest.raises(TypeError, match=message):
            World.from_dense(*wrong)  # pyright: ignore[reportArgumentType]
    for origin in ((0.5, 0, 0), (0, 0)):
        with pytest.raises(TypeError, match="origin must be three integers"):
            World.from_dense(solid, table, origin=origin)  # pyright: ignore[reportArgumentType]
    bricks, index = torch.zeros(2, 16, 16, 16, dtype=torch.int16), torch.zeros(1, 1, 1, dtype=torch.int32)
    with pytest.raises(ValueError, match=r"index must hold ids in 0..1, the bricks; got 2..2"):
        World(bricks=bricks, index=index + 2, origin=(0, 0, 0), materials=table)
    with pytest.raises(ValueError, match="bricks\\[0\\] must be all air"):
        World(bricks=bricks + 1, index=index, origin=(0, 0, 0), materials=table)
    with pytest.raises(TypeError, match="bricks must be int16 and index int32"):
        World(bricks=bricks.int(), index=index, origin=(0, 0, 0), materials=table)


@pytest.mark.parametrize(
    ("shape", "share"), [((7, 4, 9), 0.1), ((1, 3, 40), 0.03), ((5, 5, 5), 1.0), ((3, 80, 2), 0.0)]
)
def test_reach_is_the_distance_to_the_nearest_brick(shape: tuple[int, int, int], share: float) -> None:
    """Cells away along the axis where they are most, in the steps in which it is counted."""
    filled = torch.rand(shape, generator=torch.Generator().manual_seed(2)) < share
    bricks = torch.zeros(2, BRICK, BRICK, BRICK, dtype=torch.int16)
    bricks[1, 0, 0, 0] = 1
    cells = torch.stack(torch.meshgrid(*(torch.arange(n) for n in shape), indexing="ij"), dim=-1).view(-1, 3)
    far = (cells[:, None] - filled.nonzero()).abs().amax(dim=2)
    nearest = far.amin(dim=1) if filled.any() else torch.full((len(cells),), max(shape))
    wanted = [max((reach for reach in REACHES if reach <= n), default=0) for n in nearest.tolist()]
    reach = -Grid.of(bricks, filled.to(torch.int32)).index.flatten()
    assert reach.clamp_min(0).tolist() == wanted


def test_worlds_that_share_bricks_store_them_once() -> None:
    first, second = (World.from_dense(torch.ones(n, 16, 16, dtype=torch.int16), voxels.TABLE) for n in (40, 20))
    other = World(bricks=second.bricks, index=second.index.flip(0), origin=(0, 0, 0), materials=voxels.TABLE)
    still = torch.eye(4)
    models = [Instance(model=model, pose=lambda _: still) for model in (second, other)]
    grids = Scene(world=first, instances=tuple(models)).grids
    assert len(grids.bricks) == len(first.bricks) + len(second.bricks)
    assert grids.index.tolist() == [1, 2, 3, 5, 6, 6, 5]
