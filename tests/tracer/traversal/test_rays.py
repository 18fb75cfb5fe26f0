"""Hits of rays, where the answer is known beforehand."""

from __future__ import annotations

import pytest
import torch
import voxels
from torch import Tensor
from voxels import GLASS, LAMP, STONE, WATER

from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import MASK_ALL, MASK_PRIMARY, MASK_SECONDARY, MASK_SHADOW, Instance, Scene
from tracer.scene.world import World
from tracer.traversal.rays import run_lengths, trace, transmission


def wall(*more, origin: tuple[int, int, int] = (0, 0, 0)) -> Scene:
    """Stone fills z in [10, 14]; further boxes come on top."""
    return Scene(world=voxels.world((20, 20, 20), (STONE, (0, 0, 10), (20, 20, 14)), *more, origin=origin))


def ray(origin: tuple[float, ...], direction: tuple[float, ...]) -> tuple[Tensor, Tensor]:
    return torch.tensor(origin), torch.nn.functional.normalize(torch.tensor(direction), dim=-1)


def test_distance_to_a_wall() -> None:
    g = torch.Generator().manual_seed(0)
    origins = torch.rand(200, 3, generator=g) * torch.tensor([2.0, 2.0, 5.0]) + torch.tensor([9.0, 9.0, 1.0])
    directions = torch.nn.functional.normalize(torch.rand(200, 3, generator=g) * 0.6 + torch.tensor([0, 0, 1.0]), dim=1)
    hits = trace(wall(), origins, directions)
    torch.testing.assert_close(hits.t, (10 - origins[:, 2]) / directions[:, 2])
    assert hits.hit.all()
    assert (hits.material == STONE).all()
    torch.testing.assert_close(hits.normal, torch.tensor([0.0, 0.0, -1.0]).expand(200, 3))
    torch.testing.assert_close(hits.local, origins + directions * hits.t[:, None])
    assert (hits.cell[:, 2] == 10).all()
    torch.testing.assert_close(hits.uv(), hits.local[:, :2] - hits.cell[:, :2], atol=1e-5, rtol=0)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_face_of_a_voxel(axis: int, sign: float) -> None:
    scene = Scene(world=voxels.world((3, 3, 3), (LAMP, (1, 1, 1), (2, 2, 2)), origin=(-7, -8, -9)))
    normal = torch.zeros(3)
    normal[axis] = sign
    hits = trace(scene, torch.tensor([-5.5, -6.5, -7.5]) + 4 * normal, -normal)
    assert float(hits.t) == 3.5
    assert torch.equal(hits.normal, normal)
    assert int(hits.face) == 2 * axis + (sign > 0)
    assert hits.cell.tolist() == [-6, -7, -8]
    torch.testing.assert_close(hits.uv(), torch.tensor([0.5, 0.5]))


def test_a_ray_on_a_face_is_in_the_voxel_it_heads_into() -> None:
    scene = wall()
    away = ray((5.5, 5.5, 10.0), (0.0, 0.0, -1.0))
    assert not trace(scene, *away).hit
    assert transmission(scene, *away).tolist() == [1.0, 1.0, 1.0]
    into = ray((5.5, 5.5, 10.0), (0.0, 0.0, 1.0))
    assert transmission(scene, *into).tolist() == [0.0, 0.0, 0.0]
    assert not trace(scene, *into).hit


def test_from_inside_a_block_one_sees_out() -> None:
    scene = wall((LAMP, (0, 0, 17), (20, 20, 18)), (WATER, (0, 0, 6), (20, 20, 7)))
    ahead = trace(scene, *ray((5.5, 5.5, 11.5), (0.0, 0.0, 1.0)))
    assert (float(ahead.t), int(ahead.material)) == (5.5, LAMP)
    back = trace(scene, *ray((5.5, 5.5, 11.5), (0.0, 0.0, -1.0)))
    assert (float(back.t), int(back.material), bool(back.back_face)) == (4.5, WATER, False)


def test_transmissive_runs_have_no_inner_faces() -> None:
    scene = wall((WATER, (0, 0, 3), (20, 20, 7)), (GLASS, (0, 0, 7), (20, 20, 9)))
    rays = ray((5.5, 5.5, 0.5), (0.0, 0.0, 1.0))
    first = trace(scene, *rays)
    second = trace(scene, *rays, beyond=first)
    third = trace(scene, *rays, beyond=second)
    assert [float(h.t) for h in (first, second, third)] == [2.5, 6.5, 9.5]
    assert [int(h.material) for h in (first, second, third)] == [WATER, GLASS, STONE]
    assert not trace(scene, *rays, beyond=third).hit
    assert [float(x) for x in run_lengths(scene, *rays, first)] == [6.0, 4.0]
    assert [float(x) for x in run_lengths(scene, *rays, third)] == [4.0, 4.0]
    assert [float(x) for x in run_lengths(scene, *rays, third, cap=1.5)] == [1.5, 1.5]


def test_out_of_water_through_its_back_face() -> None:
    scene = wall((WATER, (0, 0, 3), (20, 20, 7)))
    rays = ray((5.5, 5.5, 5.0), (0.0, 0.0, 1.0))
    surface = trace(scene, *rays)
    assert (float(surface.t), int(surface.material), bool(surface.back_face)) == (2.0, WATER, True)
    assert surface.normal.tolist() == [0.0, 0.0, -1.0]
    assert int(surface.cell[2]) == 6
    beyond = trace(scene, *rays, beyond=surface)
    assert (float(beyond.t), int(beyond.material)) == (5.0, STONE)


def test_transmission_multiplies_runs() -> None:
    water, glass = (voxels.TABLE.id(name) for name in ("water", "glass"))
    scene = Scene(world=voxels.world((9, 9, 20), (water, (0, 0, 3), (9, 9, 6)), (glass, (0, 0, 8), (9, 9, 9))))
    rays = ray((4.3, 2.2, -3.0), (0.1, 0.2, 1.0))
    slant = 1 / float(rays[1][2])
    tint, opacity = voxels.TABLE.tint, voxels.TABLE.opacity
    through_water = (1 - opacity[water]) * tint[water] ** (3 * slant)
    through_glass = (1 - opacity[glass]) * tint[glass] ** slant
    enters = 0.96 * (1 - (1 - 1 / slant) ** 5)  # what the two faces do not reflect
    torch.testing.assert_close(transmission(scene, *rays), through_water * through_glass * enters**2)
    inside = ray((4.3, 2.2, 4.0), (0.0, 0.0, 1.0))
    want = (1 - opacity[water]) * tint[water] ** 2 * (1 - opacity[glass]) * tint[glass] * 0.96**2
    torch.testing.assert_close(transmission(scene, *inside), want)  # out of the water, and through the glass
    want = (1 - opacity[water]) * tint[water]
    torch.testing.assert_close(transmission(scene, *inside, t_max=1.0), want)  # by no face at all
    torch.testing.assert_close(transmission(scene, *rays, t_max=10 * slant), through_water * enters)
    half = (1 - opacity[water]) * tint[water] ** (1.5 * slant) * enters
    torch.testing.assert_close(transmission(scene, *rays, t_max=7.5 * slant), half)
    torch.testing.assert_close(transmission(scene, *rays, t_min=7.5 * slant, t_max=10 * slant), half)


def test_instances_move_turn_and_scale() -> None:
    model = voxels.world((2, 4, 2), (LAMP, (0, 0, 0), (2, 4, 2)), origin=(-1, 0, -1))
    instance = Instance(model=model, pose=lambda t: voxels.pose((10.0, 2.0, 5.0), yaw=torch.pi / 4), scale=0.5)
    scene = Scene(world=wall().world, instances=(instance,))
    poses = scene.poses([0.0])[0]
    hits = trace(scene, *ray((10.0, 3.9, 0.0), (0.0, 0.0, 1.0)), poses=poses)
    torch.testing.assert_close(hits.t, torch.tensor(5 - 0.5 * 2**0.5))  # a box of 1 x 2 x 1 on its edge
    assert int(hits.instance) == 1
    assert scene.materials.names[int(hits.material)] == "lamp"
    torch.testing.assert_close(hits.normal.abs(), torch.tensor([0.5, 0.0, 0.5]).sqrt())
    missed = trace(scene, *ray((10.0, 4.1, 0.0), (0.0, 0.0, 1.0)), poses=poses)
    assert (int(missed.instance), float(missed.t)) == (0, 10.0)


def test_masks_choose_who_sees_an_instance() -> None:
    model = voxels.world((2, 2, 2), (LAMP, (0, 0, 0), (2, 2, 2)))
    for mask in (MASK_PRIMARY, MASK_SHADOW, MASK_SECONDARY):
        instance = Instance(model=model, pose=lambda t: voxels.pose((5.0, 5.0, 5.0)), mask=MASK_ALL & ~mask)
        scene = Scene(world=wall().world, instances=(instance,))
        rays = ray((6.0, 6.0, 0.0), (0.0, 0.0, 1.0))
        for asked in (MASK_PRIMARY, MASK_SHADOW, MASK_SECONDARY):
            visible = trace(scene, *rays, poses=scene.poses([0.0])[0], mask=asked)
            assert int(visible.instance) == (0 if asked == mask else 1)
        light = transmission(scene, *rays, poses=scene.poses([0.0])[0], t_max=9.0)
        assert float(light[0]) == (1.0 if mask == MASK_SHADOW else 0.0)


def test_materials_of_models_get_their_own_rows() -> None:
    table = MaterialTable.of([Material(name="stone", albedo=(0.1, 0.2, 0.3)), Material(name="sail")])
    model = World.from_dense(torch.full((2, 2, 2), 1), table)
    still = lambda t: voxels.pose((5.0, 5.0, 5.0))
    boats = [Instance(model=model, pose=still, name=f"boat{i}") for i in range(2)]
    scene = Scene(world=wall().world, instances=(*boats, Instance(model=wall().world, pose=still)))
    assert len(scene.materials) == len(voxels.TABLE) + 2
    assert scene.materials.names == (*voxels.TABLE.names, "boat0.stone", "sail")
    hits = trace(scene, *ray((6.0, 6.0, 0.0), (0.0, 0.0, 1.0)), poses=scene.poses([0.0])[0])
    torch.testing.assert_close(scene.materials.albedo[int(hits.material)], table.albedo[1])


def test_batch_equals_loop() -> None:
    scene = voxels.random_scene(3)
    origins, directions = (x.view(3, 10, 20, 3) for x in voxels.random_rays(5, 600))
    poses = scene.poses([0.0, 0.5, 1.0])
    together = trace(scene, origins, directions, poses=poses)
    light = transmission(scene, origins, directions, poses=poses)
    for b in range(3):
        alone = trace(scene, origins[b], directions[b], poses=poses[b])
        assert torch.equal(together.t[b], alone.t)
        assert torch.equal(together.normal[b], alone.normal)
        assert torch.equal(light[b], transmission(scene, origins[b], directions[b], poses=poses[b]))


def test_rays_that_are_no_rays_miss() -> None:
    scene = wall()
    bad = torch.tensor([[torch.nan, 5.0, 5.0], [torch.inf, 5.0, 5.0], [5.0, 5.0, 5.0]])
    aim = torch.tensor([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, torch.nan, 1.0]])
    assert not trace(scene, bad, aim).hit.any()
    assert torch.equal(transmission(scene, bad, aim), torch.ones(3, 3))
    none = trace(scene, torch.zeros(0, 3), torch.zeros(0, 3))
    assert none.t.shape == (0,)
    assert not trace(scene, torch.full((3,), 5.0), torch.zeros(3)).hit


def test_errors_name_what_is_wrong() -> None:
    scene = voxels.random_scene(0)
    with pytest.raises(ValueError, match=r"poses must be given for a scene with 2 instances"):
        trace(scene, torch.zeros(4, 3), torch.ones(4, 3))
    with pytest.raises(ValueError, match=r"poses must be \(2,4,4\)"):
        trace(scene, torch.zeros(4, 3), torch.ones(4, 3), poses=torch.zeros(3, 4, 4))
    with pytest.raises(ValueError, match=r"rays must be \(2,...,3\)"):
        trace(scene, torch.zeros(5, 3), torch.ones(5, 3), poses=scene.poses([0.0, 1.0]))
    with pytest.raises(ValueError, match=r"origins and directions must both be"):
        transmission(wall(), torch.zeros(4, 2), torch.ones(4, 2))
