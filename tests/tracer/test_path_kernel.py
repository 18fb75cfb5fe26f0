"""Compiled paths against the torch reference, number for number."""

from __future__ import annotations

from typing import Any

import pytest
import torch
import voxels
from torch import Tensor

from tracer import light_paths, path_ops, paths
from tracer.light_samples import Lights
from tracer.material import Material, MaterialTable
from tracer.scene import Instance, Scene, Sun
from tracer.world import World

BOUNCES = 3


def polished(seed: int) -> Scene:
    """`voxels.random_scene` with every kind of surface: metals and dielectrics, sharp and rough, glass and lamps."""
    table = MaterialTable.of(
        [
            Material(name="matt", albedo=(0.7, 0.5, 0.3)),
            Material(name="glass", opacity=0.25, tint=(0.9, 0.7, 0.5), roughness=0.05),
            Material(name="metal", albedo=(0.9, 0.6, 0.4), metallic=1.0, roughness=0.4),
            Material(name="mirror", albedo=(0.9, 0.9, 0.9), metallic=0.7, roughness=0.02),
            Material(name="lamp", emission=(4.0, 3.0, 2.0), roughness=0.2),
        ]
    )
    scene, g = voxels.random_scene(seed), torch.Generator().manual_seed(seed)

    def recast(world: World) -> World:
        other = torch.randint(1, len(table), world.bricks.shape, generator=g).to(world.bricks)
        return World(
            bricks=torch.where(world.bricks > 0, other, world.bricks),
            index=world.index,
            origin=world.origin,
            materials=table,
        )

    return Scene(
        world=recast(scene.world),
        instances=tuple(
            Instance(model=recast(i.model), pose=i.pose, scale=i.scale, mask=i.mask) for i in scene.instances
        ),
        sun=Sun(angular_radius=2.0),
    )


def case(seed: int, count: int = 3000) -> tuple[Scene, Tensor, Lights, Tensor, Tensor, Tensor]:
    scene = polished(seed)
    poses = scene.poses([0.3])[0]
    u = torch.rand(1 + light_paths.MORE * (BOUNCES + 1), count, generator=torch.Generator().manual_seed(seed))
    return scene, poses, Lights.of(scene, poses), *voxels.random_rays(seed, count), u


def same(a: Tensor, b: Tensor, share: float = 0.004) -> None:
    """All but a ``share`` of paths, which graze an edge or a choice, find the same."""
    off = (a - b).abs() > 1e-3 + 1e-2 * b.abs()
    assert off.float().mean() <= share
    assert b[~off].abs().mean() > 0


@pytest.mark.parametrize("seed", [0, 1])
def test_rays_meet_the_same(seed: int) -> None:
    scene, poses, _, origins, directions, u = case(seed)
    inside = u[1] < 0.3
    ends = torch.linspace(5.0, 90.0, len(inside))
    got, want = (
        f.meet(scene, origins, directions, u[0], poses=poses, inside=inside, t_max=ends) for f in (path_ops, paths)
    )
    assert float((got.hit != want.hit).float().mean()) <= 0.002
    both = got.hit & want.hit
    assert 0.2 < float(both.float().mean()) < 0.95
    same(got.weight[both], want.weight[both])
    same(got.distance[both], want.distance[both])
    mine, theirs = got.surface[both[got.rows]], want.surface[both[want.rows]]
    for name in ("points", "normals", "toward", "albedo", "roughness", "metallic", "opacity", "emission"):
        same(getattr(mine, name), getattr(theirs, name))
    assert float((mine.inside != theirs.inside).float().mean()) <= 0.002
    assert mine.inside.any()


@pytest.mark.parametrize("bounces", [1, 2])
def test_surfaces_send_the_same(bounces: int) -> None:
    scene, poses, lights, origins, directions, u = case(2)
    met = paths.meet(scene, origins, directions, u[0], poses=poses)
    given = (scene, lights, met.surface, u[1:, met.rows].contiguous(), bounces, poses)
    same(path_ops.gathered(*given), light_paths.gathered(*given))


def test_surfaces_mirror_the_same_lamps() -> None:
    scene, poses, lights, origins, directions, u = case(4)
    at = paths.meet(scene, origins, directions, u[0], poses=poses).surface
    given = (scene, lights, at, u[1:7, : len(at)].contiguous(), poses)
    got, want = path_ops.mirrored_lamps(*given), light_paths.mirrored_lamps(*given)
    shows = want[0].amax(dim=1) > 0
    assert shows.float().mean() > 0.05
    same(got[0], want[0])
    for mine, theirs in zip(got[1:], want[1:], strict=True):
        same(mine[shows], theirs[shows])


@pytest.mark.parametrize("next_event", [True, False])
@pytest.mark.parametrize("spreads", [True, False])
def test_paths_bring_the_same_light(next_event: bool, spreads: bool) -> None:
    scene, poses, lights, origins, directions, u = case(3)
    given: dict[str, Any] = {"bounces": BOUNCES, "poses": poses, "t_min": 0.05, "t_max": 100.0}
    given |= {"detail": 200.0 if spreads else 20.0, "spreads": spreads, "next_event": next_event}
    got, want = (f.radiance(scene, lights, origins, directions, u, **given) for f in (path_ops, light_paths))
    same(got, want)
    assert (got.mean(0) / want.mean(0) - 1).abs().max() < 0.01


def test_a_scene_without_sun_and_lamps_is_lit_by_its_sky() -> None:
    scene = Scene(world=voxels.world((9, 3, 9), (voxels.STONE, (0, 0, 0), (9, 1, 9))), sun=None)
    poses = scene.poses([0.0])[0]
    origins = torch.rand(500, 3, generator=torch.Generator().manual_seed(0)) * 9 + torch.tensor([0.0, 2.0, 0.0])
    directions = torch.tensor([0.0, -1.0, 0.0]).expand(500, 3)
    u = torch.rand(1 + 2 * light_paths.MORE, 500, generator=torch.Generator().manual_seed(1))
    lights = Lights.of(scene, poses)
    got, want = (
        f.radiance(scene, lights, origins, directions, u, bounces=1, poses=poses) for f in (path_ops, light_paths)
    )
    same(got, want)
    assert got.mean() > 0.1
