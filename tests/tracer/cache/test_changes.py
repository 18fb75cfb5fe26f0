"""Cells of a cache whose light changes: what is told from noise, by whom, and what follows."""

from __future__ import annotations

import torch
from torch import Tensor

from tracer.cache.cells import SIDES, around, cells, level_of
from tracer.cache.changes import REGION
from tracer.cache.irradiance import IrradianceCache

FRAMES, COUNT = 12, 2400


def surfaces(count: int, seed: int, side: float = REGION) -> tuple[Tensor, Tensor]:
    """Places on floor and two walls of the cube between 0 and ``side``, in turn."""
    generator = torch.Generator().manual_seed(seed)
    points = torch.rand(count, 3, generator=generator) * (side - 1e-3)
    normals = torch.eye(3)[torch.arange(count) % 3]
    return torch.where(normals > 0, 1e-3, points), normals


def noisy(mean: Tensor, seed: int) -> Tensor:
    """Light as paths find it: one in four finds any, a few much more than that."""
    generator = torch.Generator().manual_seed(seed)
    u, v = torch.rand(2, len(mean), generator=generator)
    grey = 4 * mean * (u < 0.25) * -torch.log1p(-v)
    return grey[:, None] * torch.tensor([1.2, 1.0, 0.8])


def filled(count: int, side: float = REGION, level: float = 0.5, frames: int = FRAMES) -> IrradianceCache:
    """What such light leaves: bright on the floor, dark on the walls."""
    cache = IrradianceCache.empty()
    for seed in range(frames):
        points, normals = surfaces(count, seed, side)
        cache = cache.update(points, normals, noisy(level * (0.2 + normals[:, 1]), 100 + seed))
    return cache


def later(cache: IrradianceCache, count: int, level: float, side: float = REGION, seed: int = 50) -> IrradianceCache:
    points, normals = surfaces(count, seed, side)
    return cache.update(points, normals, noisy(level * (0.2 + normals[:, 1]), 100 + seed))


def kept(cache: IrradianceCache, before: IrradianceCache) -> Tensor:
    """Weight of each coarse cell over what it had."""
    rows = torch.searchsorted(cache.keys, before.keys)
    return (cache.weight[rows] / before.weight)[level_of(before.keys) == 1]


def test_noise_is_no_change():
    cache = filled(COUNT)
    expected = sum(COUNT * 0.82**k for k in range(FRAMES)) / len(cache.weight[level_of(cache.keys) == 1])
    assert float(cache.weight[level_of(cache.keys) == 1].mean()) > 0.97 * expected
    light, known = cache.look_up(*surfaces(300, 77))
    assert bool(known.all())
    floor = surfaces(300, 77)[1][:, 1] > 0
    torch.testing.assert_close(light[floor, 1].mean(), torch.tensor(0.6), rtol=0.1, atol=0)
    torch.testing.assert_close(light[~floor, 1].mean(), torch.tensor(0.1), rtol=0.15, atol=0)


def test_a_room_forgets_in_a_frame_what_none_of_its_cells_can_tell_alone():
    full, alone = filled(COUNT), filled(COUNT // 16, side=SIDES[1])
    changed, lone = later(full, COUNT, 0.1), later(alone, COUNT // 16, 0.1, side=SIDES[1])
    assert float(kept(changed, full).max()) < 0.02
    assert float(kept(lone, alone).min()) > 0.1
    assert not bool(changed.look_up(*surfaces(300, 77))[1].any()), "paths go on where all is forgotten"
    again = later(changed, COUNT, 0.1, seed=51)
    light, known = again.look_up(*surfaces(300, 77))
    assert float(known.float().mean()) > 0.9
    floor = surfaces(300, 77)[1][:, 1] > 0
    torch.testing.assert_close(light[floor & known, 1].mean(), torch.tensor(0.12), rtol=0.2, atol=0)


def test_light_that_comes_is_seen_as_light_that_goes():
    full = filled(COUNT)
    assert float(kept(later(full, COUNT, 1.1), full).max()) < 0.2


def test_a_change_stays_in_its_region():
    cache, far = filled(COUNT), torch.tensor([4.0 * REGION, 0.0, 0.0])
    points, normals = surfaces(COUNT, 3)
    both = cache.update(points + far, normals, noisy(0.5 * (0.2 + normals[:, 1]), 7))
    after = later(both, COUNT, 0.05)
    found, known = after.look_up(surfaces(300, 77)[0] + far, surfaces(300, 77)[1])
    assert float(known.float().mean()) > 0.9
    assert float(found.mean()) > 0.2


def test_small_changes_are_left_to_time():
    cell, up = torch.full((400, 3), 0.5), torch.tensor([[0.0, 1.0, 0.0]]).expand(400, 3)
    steady = IrradianceCache.empty()
    for _ in range(FRAMES):
        steady = steady.update(cell, up, torch.full((400, 3), 0.5))
    shares = [kept(steady.update(cell, up, torch.full((400, 3), light)), steady)[0] for light in (0.46, 0.3)]
    assert float(shares[0]) > 1
    assert float(shares[1]) < 0.1


def test_fine_cells_whose_coarse_one_made_way_are_not_read():
    cache = IrradianceCache.empty(capacity=1)
    for seed in range(3):
        points, normals = surfaces(60, seed)
        cache = cache.update(points, normals, noisy(normals[:, 1], seed))
    assert len(cache.keys) == 1
    assert not bool((level_of(cache.keys) == 0).any() and cache.look_up(*surfaces(60, 1))[1].any())


def test_cells_know_what_they_lie_in():
    generator = torch.Generator().manual_seed(5)
    points = (torch.rand(400, 3, generator=generator) - 0.5) * 900
    normals = torch.randn(400, 3, generator=generator)
    fine, coarse = (cells(points, normals, side, level) for level, side in enumerate(SIDES))
    assert torch.equal(around(fine), coarse)
    assert level_of(fine).tolist() == [0] * 400
    assert level_of(coarse).tolist() == [1] * 400
    cube = torch.floor(points.double() / REGION)
    same = (cube[:, None] == cube[None]).all(dim=2)
    found = around(coarse, REGION)
    assert torch.equal(found[:, None] == found[None], same)
