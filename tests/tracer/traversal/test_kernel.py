"""The compiled kernel against the torch reference."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
import voxels

from tracer.scene.scene import MASK_ALL, MASK_SHADOW, Instance, Scene
from tracer.traversal import drivers
from tracer.traversal import rays as traversal
from tracer.traversal import reference as reference_form
from tracer.traversal.hits import Hits
from tracer.traversal.lane_kernel import BATCH
from tracer.traversal.rays import run_lengths, trace, transmission

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def reference(monkeypatch: pytest.MonkeyPatch):
    """Switch to the torch reference."""

    def switch() -> None:
        for name in ("surface", "transmit", "runs"):
            monkeypatch.setattr(traversal.ops, name, getattr(reference_form, name))

    return switch


def case(seed: int) -> tuple[Scene, torch.Tensor, torch.Tensor, torch.Tensor]:
    scene = voxels.random_scene(seed)
    origins, directions = voxels.random_rays(seed, 1800)
    return scene, origins.view(2, -1, 3), directions.view(2, -1, 3), scene.poses([0.0, 0.7])


def same(a: Hits, b: Hits, share: float = 0.001) -> None:
    """All but a ``share`` of rays, which graze an edge, hit the same face at the same place."""
    differs = (a.hit != b.hit) | (a.hit & ((a.cell != b.cell).any(-1) | (a.face != b.face)))
    differs |= a.hit & ((a.material != b.material) | (a.instance != b.instance) | (a.back_face != b.back_face))
    assert differs.float().mean() <= share
    agree = a.hit & ~differs
    torch.testing.assert_close(a.t[agree], b.t[agree], rtol=1e-6, atol=1e-5)
    torch.testing.assert_close(a.local[agree], b.local[agree], rtol=1e-6, atol=1e-5)
    torch.testing.assert_close(a.normal[agree], b.normal[agree])


@pytest.mark.parametrize("seed", [0, 1])
def test_surfaces(seed: int, reference) -> None:
    scene, origins, directions, poses = case(seed)
    spans = {"t_min": 0.5, "t_max": torch.linspace(1.0, 80.0, 1800).view(2, -1)}
    queries = [
        lambda: trace(scene, origins, directions, poses=poses),
        lambda: trace(scene, origins, directions, poses=poses, mask=MASK_SHADOW, **spans),
    ]
    first = [query() for query in queries]
    behind = trace(scene, origins, directions, poses=poses, beyond=first[0])
    assert 0.3 < float(first[0].hit.float().mean()) < 0.95
    assert int(first[0].instance.max()) == 2
    assert first[0].back_face.any()
    assert behind.hit.sum() > 100
    reference()
    for hits, query in zip(first, queries, strict=True):
        same(hits, query())
    same(behind, trace(scene, origins, directions, poses=poses, beyond=first[0]))


@pytest.mark.parametrize("seed", [0, 1])
def test_transmission_and_runs(seed: int, reference) -> None:
    scene, origins, directions, poses = case(seed)
    hits = trace(scene, origins, directions, poses=poses, mask=MASK_ALL)
    spans = {"t_min": 0.5, "t_max": torch.linspace(1.0, 30.0, 1800).view(2, -1)}
    passed = transmission(scene, origins, directions, poses=poses)
    part = transmission(scene, origins, directions, poses=poses, **spans)
    lengths = run_lengths(scene, origins, directions, hits, poses=poses, cap=5.0)
    assert ((passed > 0) & (passed < 1)).any(-1).sum() > 100
    assert (lengths[0] > lengths[1]).sum() > 30
    reference()
    other = transmission(scene, origins, directions, poses=poses)
    assert ((passed - other).abs() > 1e-5).any(-1).float().mean() <= 0.001
    other = transmission(scene, origins, directions, poses=poses, **spans)
    assert ((part - other).abs() > 1e-5).any(-1).float().mean() <= 0.001
    for a, b in zip(lengths, run_lengths(scene, origins, directions, hits, poses=poses, cap=5.0), strict=True):
        assert ((a - b).abs() > 1e-4).float().mean() <= 0.001


def test_lanes_answer_as_single_rays_do_through_many_instances_and_batches() -> None:
    model = voxels.random_world(5, (7, 6, 8), share=0.4)
    places = [(8.0 * x - 32, 6.0 * y - 12, 8.0 * z - 32) for x in range(8) for y in range(3) for z in range(3)]
    many = (Instance(model=model, pose=lambda t, p=p: voxels.pose(p, yaw=0.3 * p[0], pitch=0.2 * p[2])) for p in places)
    scene = Scene(world=voxels.random_world(4, origin=(-20, -6, -17)), instances=tuple(many))
    origins, directions = voxels.random_rays(7, 2 * BATCH + 300)
    spans = torch.stack([torch.full((len(origins),), 0.1), torch.linspace(1.0, 200.0, len(origins))], dim=1)
    rays = [origins, directions, spans, traversal.grid_from_world(scene, scene.poses([0.0]), scene.world.device)]
    grids, left = scene.grids.tensors, torch.zeros(0, 5, dtype=torch.int32)
    numbers, ids, passed = (
        torch.zeros(len(origins), 4),
        torch.zeros(len(origins), 7, dtype=torch.int32),
        origins.clone(),
    )
    drivers.surface_each(len(origins), *rays, *grids, left, MASK_ALL, numbers, ids)
    drivers.transmit_each(len(origins), *rays, *grids, MASK_ALL, passed)
    found = drivers.surface(rays, grids, left, MASK_ALL)
    assert len(ids[:, 1].unique()) > 60
    assert (found[1] != ids).any(dim=1).float().mean() <= 0.001
    assert ((found[0] - numbers).nan_to_num(0.0).abs() > 1e-5).any(dim=1).float().mean() <= 0.001
    light = drivers.transmit(rays, grids, MASK_ALL)
    assert ((passed > 0) & (passed < 1)).any(dim=1).sum() > 100
    assert ((light - passed).abs() > 1e-6).any(dim=1).float().mean() <= 0.001
    starts = torch.cat([ids[:, :2], ids[:, 4:]], dim=1)
    rays[2] = torch.stack([numbers[:, 0], numbers[:, 0] + 6.0], dim=1)
    lengths = torch.zeros(len(origins), 2)
    drivers.runs_each(len(origins), *rays, *grids, starts, lengths)
    assert (lengths[:, 0] > lengths[:, 1]).sum() > 30
    assert ((drivers.runs(rays, grids, starts) - lengths).abs() > 1e-5).any(dim=1).float().mean() <= 0.001


def test_fakes_give_the_shapes() -> None:
    from torch._subclasses.fake_tensor import FakeTensorMode

    with FakeTensorMode():
        rays = [torch.empty(5, 3), torch.empty(5, 3), torch.empty(5, 2), torch.empty(1, 1, 4, 4)]
        grids = [torch.empty(0)] * 4
        numbers, ids = traversal.ops.surface(rays, grids, torch.empty(0, 5), 1)
        assert (numbers.shape, ids.shape, ids.dtype) == ((5, 4), (5, 7), torch.int32)
        assert traversal.ops.transmit(rays, grids, 1).shape == (5, 3)
        assert traversal.ops.runs(rays, grids, torch.empty(5, 5)).shape == (5, 2)
