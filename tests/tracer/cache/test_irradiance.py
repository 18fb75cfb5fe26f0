"""A cache of irradiance: what its cells hold, how they forget, and how many there are."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from tracer.cache import kernel
from tracer.cache.irradiance import KEPT, LEAST, PRIOR, IrradianceCache

UP = torch.tensor([[0.0, 1.0, 0.0]])
GREY = torch.tensor([[0.5, 0.4, 0.3]])


def places(*points: tuple[float, float, float]) -> Tensor:
    return torch.tensor(points) + 1e-3 * UP


def met(cache: IrradianceCache, point: tuple[float, float, float], light: Tensor, count: int = 8) -> IrradianceCache:
    return cache.update(places(point).expand(count, 3), UP.expand(count, 3), light.expand(count, 3))


def random_samples(seed: int, count: int = 3000) -> tuple[Tensor, Tensor, Tensor]:
    """On both sides of floors and walls of a block of cells, on either side of the origin."""
    generator = torch.Generator().manual_seed(seed)
    points = (torch.rand(count, 3, generator=generator) - 0.5) * 24
    axis = torch.randint(3, (count,), generator=generator)
    side = torch.randint(2, (count,), generator=generator) * 2.0 - 1
    normals = torch.nn.functional.one_hot(axis, 3) * side[:, None]
    points = torch.where(normals != 0, points.round() + 1e-3 * normals, points)
    return points, normals, torch.rand(count, 3, generator=generator)


def test_a_cell_holds_the_mean_of_its_samples():
    light = torch.arange(24.0).view(8, 3)
    cache = IrradianceCache.empty().update(places((2.2, 3.0, -1.7)).expand(8, 3), UP.expand(8, 3), light)
    found, known = cache.look_up(places((2.9, 3.0, -1.1)), UP)
    assert bool(known)
    torch.testing.assert_close(found, light.mean(dim=0, keepdim=True))
    for point, normal in (((2.9, 3.0, -1.1), -UP), ((2.9, 3.0, 4.1), UP), ((-2.9, 3.0, -1.1), UP)):
        found, known = cache.look_up(places(point), normal)
        assert not bool(known), "another face, or another place"
        assert not bool(found.any())


def test_few_samples_are_filled_up_with_those_around():
    cache = met(met(IrradianceCache.empty(), (0.5, 0.0, 0.5), GREY, 2), (2.5, 0.0, 0.5), 3 * GREY, 30)
    own, around = 2, 2 * KEPT + 30
    mean = (2 * KEPT * GREY + 90 * GREY) / around
    more = min(around, PRIOR)
    found, _ = cache.look_up(places((0.5, 0.0, 0.5), (1.5, 0.0, 3.5)), UP.expand(2, 3))
    torch.testing.assert_close(found[:1], (own * GREY + more * mean) / (own + more))
    torch.testing.assert_close(found[1:], mean)


def test_small_changes_are_forgotten_in_eight_frames_and_what_none_meets_is_kept():
    cache = met(IrradianceCache.empty(), (40.5, 0.0, 0.5), GREY)
    for _ in range(20):
        cache = met(cache, (0.5, 0.0, 0.5), GREY)
    for _ in range(8):
        cache = met(cache, (0.5, 0.0, 0.5), 0.92 * GREY)
    found, known = cache.look_up(places((0.5, 0.0, 0.5), (40.5, 0.0, 0.5)), UP.expand(2, 3))
    assert bool(known.all())
    old = KEPT**8 * (1 - KEPT**20) / (1 - KEPT**28)
    torch.testing.assert_close(found[0], (0.92 + 0.08 * old) * GREY[0])
    torch.testing.assert_close(found[1:], GREY)


def test_time_passes_for_cells_that_none_meets():
    """What is seen again after a while counts less than what is seen now."""
    cache = met(IrradianceCache.empty(), (0.5, 0.0, 0.5), GREY, 100)
    for _ in range(20):
        cache = met(cache, (40.5, 0.0, 0.5), GREY)
    found, _ = met(cache, (0.5, 0.0, 0.5), 0.92 * GREY).look_up(places((0.5, 0.0, 0.5)), UP)
    assert float((found / GREY).max()) < 0.92 + 0.2 * 0.08


def test_the_cells_met_last_stay_where_there_is_no_room():
    cache = IrradianceCache.empty(capacity=6)
    for number in range(5):
        cache = met(cache, (40.5 * number, 0.0, 0.5), GREY)
        assert len(cache.keys) == min(2 * number + 2, 6)
        assert bool((cache.keys.diff() > 0).all())
    _, known = cache.look_up(places(*((40.5 * number, 0.0, 0.5) for number in range(5))), UP.expand(5, 3))
    assert known.tolist() == [False, False, True, True, True]


def test_equal_frames_give_equal_caches():
    found = []
    for _ in range(2):
        cache = IrradianceCache.empty()
        for seed in range(3):
            cache = cache.update(*random_samples(seed))
        found.append(cache)
    for name in ("keys", "radiance", "weight", "age"):
        assert torch.equal(getattr(found[0], name), getattr(found[1], name))


def test_light_that_is_not_finite_is_left_out():
    light = torch.stack([GREY[0], torch.full((3,), torch.inf), torch.full((3,), torch.nan)]).repeat(4, 1)
    cache = IrradianceCache.empty().update(places((0.5, 0.0, 0.5)).expand(12, 3), UP.expand(12, 3), light)
    torch.testing.assert_close(cache.look_up(places((0.5, 0.0, 0.5)), UP)[0], GREY)
    assert cache.weight.tolist() == [4.0, 4.0]


def test_compiled_reads_are_those_of_torch():
    cache = IrradianceCache.empty()
    for seed in range(2):
        cache = cache.update(*random_samples(seed))
    points, normals, _ = random_samples(2, 500)
    want, known = cache.look_up(points, normals)
    assert 0.3 < known.float().mean() < 1
    assert bool((cache.weight < LEAST).any())
    keys, values = cache.keys.numpy(), torch.cat([cache.radiance, cache.weight[:, None]], dim=1).numpy()
    for number, (point, normal) in enumerate(zip(points.tolist(), normals.tolist(), strict=True)):
        light, there = kernel.look_up(keys, values, tuple(point), tuple(normal))
        assert there == bool(known[number])
        torch.testing.assert_close(torch.tensor(light, dtype=torch.float32), want[number])
    assert not kernel.look_up(keys[:0], values[:0], (0.5, 1e-3, 0.5), (0.0, 1.0, 0.0))[1]


def test_a_cache_without_room_is_refused():
    with pytest.raises(ValueError, match="capacity must be at least 1 cell, got 0"):
        IrradianceCache.empty(capacity=0)
