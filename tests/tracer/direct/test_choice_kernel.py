"""Which lamps are candidates of a tile, which a pixel lists, and the bounds that tell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from voxels import polished_scene

from tracer.direct import choice_kernel
from tracer.direct.kernel import Sources
from tracer.direct.sources import sources_of
from tracer.lights.emitters import Lamps, lamps_of, lamps_of_world
from tracer.scene.material import Material, MaterialTable
from tracer.scene.world import World


def few_faces() -> Sources:
    """Lamps of one rectangle or a few."""
    scene = polished_scene(1)
    return sources_of(lamps_of(scene, scene.poses([0.3])[0]), None)


def test_a_list_holds_no_more_lamps_than_it_has_room_for(monkeypatch: pytest.MonkeyPatch):
    """Of 128 lamps that are alike, rounding lets each give more than a 128th of the light."""
    monkeypatch.setattr(choice_kernel, "SHARE_ALONE", 1 / 128)
    sources = few_faces()
    point, toward = (0.0, 40.0, 0.0), (0.0, -1.0, 0.0)
    number = next(n for n in range(128) if choice_kernel.importance(sources, n, point, toward, 0.0) > 0)
    sources.lamps[choice_kernel.MEAN, number] = 0.1 / choice_kernel.importance(sources, number, point, toward, 0.0)
    sent, row = choice_kernel.importance(sources, number, point, toward, 0.0), np.full(128, -1, np.int32)

    def listed(room: np.ndarray) -> tuple[int, float]:
        power = np.full(128, sent)
        count, _ = choice_kernel.list_lamps(np.full(128, number, np.int32), 0.0, 1.0, 0.0, power, np.inf, 8, room)
        return count, power[-1]

    assert listed(row)[0] == 128, "rounding has to matter for what follows"
    count, rest = listed(row[:127])
    assert count == 127
    assert rest == sent > 0, "it may still be drawn"


def test_where_many_rays_were_due_only_the_greatest_lamps_are_listed():
    power = np.random.default_rng(1).permutation(1.1 ** np.arange(40.0))
    listed = dict[int, set[int]]()
    for rays in (12, 20, 1000):
        row, rest = np.empty(95, np.int32), power.copy()
        count, draws = choice_kernel.list_lamps(np.arange(40, dtype=np.int32), 0.0, 1.0, 0.0, rest, rays, 8, row)
        assert count + draws <= rays
        listed[rays] = {int(entry) >> 2 for entry in row[:count]}
        assert listed[rays] == set(power.argsort()[40 - count :].tolist())
        mine = np.isin(np.arange(40), list(listed[rays]))
        np.testing.assert_allclose(rest, np.where(mine, 0, power).cumsum())
    assert 0 < len(listed[12]) < len(listed[20]) < len(listed[1000])


def test_with_a_reach_no_lamp_is_left_out_that_a_point_within_it_gets():
    sources, g, kept = few_faces(), torch.Generator().manual_seed(8), 0
    for _ in range(60):
        center, reach = (torch.rand(3, generator=g) * 24 - 12).double(), 0.2 + 3 * float(torch.rand((), generator=g))
        normal = tuple(F.normalize(torch.randn(3, generator=g), dim=0).double().tolist())
        around = center + reach * F.normalize(torch.randn(12, 3, generator=g), dim=1).double()
        for number in range(sources.lamps.shape[1]):
            at = [
                choice_kernel.importance(sources, number, p, normal, 0.0) for p in (center.tolist(), *around.tolist())
            ]
            whole = choice_kernel.importance(sources, number, center.tolist(), normal, reach)
            assert whole > 0 or max(at) == 0
            kept += at[0] == 0 < max(at)
    assert kept > 50, "the centre alone would leave lamps out"


def test_a_tile_is_known_by_the_lit_pixel_nearest_its_centre():
    width, seen, zeros, groups = 12, np.zeros(120, np.float32), np.zeros((120, 3)), np.full(120, -1, np.int8)
    known = np.arange(120, 0, -1).astype(np.float32)
    tile, surface, ranges = (1, 9, 2, 10), (zeros, zeros, seen, known, groups), (np.empty(6), np.empty(6))
    assert choice_kernel.extent(surface, width, tile, 0, *ranges)[0] == -1
    least, greatest = np.inf, 0.0
    for y, x in ((8, 2), (2, 9), (4, 8), (5, 6)):  # each nearer (5, 6), whence eyes meet; later ones hide none before
        seen[y * width + x], groups[y * width + x] = 1 / (y + 1), 0
        least, greatest = min(least, known[y * width + x]), max(greatest, known[y * width + x])
        wanted = y * width + x, seen.max(), least, greatest
        assert choice_kernel.extent(surface, width, tile, 0, *ranges) == wanted


def test_pixels_of_another_group_do_not_count():
    normals = F.normalize(torch.randn(64, 3, generator=torch.Generator().manual_seed(7)), dim=1).double().numpy()
    points, seen, known = np.arange(192.0).reshape(64, 3), np.ones(64, np.float32), np.arange(64.0)
    groups, low, high = np.random.default_rng(7).integers(0, 6, 64, np.int8), np.empty(6), np.empty(6)
    for group in range(6):
        mine = np.flatnonzero(groups == group)
        surface = points, normals, seen, known, groups
        middle, _, least, greatest = choice_kernel.extent(surface, 8, (0, 8, 0, 8), group, low, high)
        assert middle in mine
        assert (least, greatest) == (mine[0], mine[-1])
        np.testing.assert_array_equal(low, np.concatenate([points[mine].min(0), normals[mine].min(0)]))
        np.testing.assert_array_equal(high, np.concatenate([points[mine].max(0), normals[mine].max(0)]))


def crowd() -> Lamps:
    """Lamps of many rectangles each: a third of a block of voxels shines."""
    shines = torch.rand(8, 8, 8, generator=torch.Generator().manual_seed(3)) < 0.3
    lamp = MaterialTable.of([Material(name="lamp", emission=(4.0, 3.0, 2.0))])
    return lamps_of_world(World.from_dense(shines.to(torch.int16), lamp, origin=(-4, -4, -4)))


def weighed(
    sources: Sources, place: tuple[Any, Any], around: tuple[Any, Any, Any, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """What `choice_kernel.weigh` finds at a place and around a centre."""
    here, most = np.empty((2, sources.lamps.shape[1]))
    choice_kernel.weigh(sources, *place, *around, here, most)
    return here, most


@pytest.mark.parametrize("crowded", [False, True])
def test_no_lamp_sends_more_than_its_bound(crowded: bool):
    g = torch.Generator().manual_seed(4)
    sources = sources_of(crowd(), None) if crowded else few_faces()
    assert not crowded or np.diff(sources.first).min() > len(sources.faces), "faces are sums"
    tight = behind = 0
    for case in range(25, 55) if crowded else range(120):
        center, reach = (torch.rand(3, generator=g) * 24 - 12).double().numpy(), float(torch.rand((), generator=g)) * 4
        facing = F.normalize(torch.randn(1, 3, generator=g) + 0.4 * torch.randn(20, 3, generator=g), dim=1).double()
        if case >= 40:  # near a lamp, on a surface that faces away from it
            way = F.normalize(torch.randn(1, 3, generator=g), dim=1).double()
            lamp = sources.lamps[:, case % sources.lamps.shape[1]]
            away = lamp[choice_kernel.RADIUS] * (0.6 + reach / 4)
            center, reach = lamp[:3] + way[0].numpy() * away, float(away) * 0.5
            facing = F.normalize(way + 0.01 * torch.randn(20, 3, generator=g).double(), dim=1)
        low, high = tuple(facing.amin(0).tolist()), tuple(facing.amax(0).tolist())
        offsets = F.normalize(torch.randn(20, 3, generator=g), dim=1).double().numpy() * reach
        bounds = weighed(sources, (center, (0.0, 1.0, 0.0)), (center, reach, low, high))[1]
        for number, most in enumerate(bounds.tolist()):
            sent = [
                choice_kernel.importance(sources, number, tuple(center + offset), tuple(normal), 0.0)
                for offset, normal in zip(offsets, facing.tolist(), strict=True)
            ]
            assert max(sent) <= most * (1 + 1e-9)
            tight += max(sent) > 0.2 * most > 0
            behind += case >= 40 and max(sent) > 0.2 * most > 0
    assert tight - behind > (10 if crowded else 100)
    assert crowded or behind > 100  # there bounds are wider


def test_what_many_rectangles_send_is_nearly_what_each_of_them_sends():
    sources = sources_of(crowd(), None)
    g = torch.Generator().manual_seed(5)
    for far, least in ((3.0, 0.0), (12.0, 0.5), (200.0, 0.98)):
        for _ in range(20):
            way = F.normalize(torch.randn(3, generator=g), dim=0).double()
            point, normal = tuple((far * way).tolist()), tuple((-way).tolist())
            roughly, most = weighed(sources, (point, normal), (point, 0.0, normal, normal))
            sent = [
                choice_kernel.importance(sources, number, point, normal, 0.0)
                for number in range(sources.lamps.shape[1])
            ]
            assert (least * np.array(sent) <= roughly).all()
            assert (roughly <= np.array(sent) * (1 + 1e-9)).all()
            assert (sent <= most * (1 + 1e-9)).all()


def test_a_lamp_that_one_pixel_does_not_get_may_still_be_drawn_for_its_tile():
    sources = few_faces()
    lamps = sources.lamps.shape[1]
    candidates, others = np.empty(lamps, np.int32), (np.empty(lamps, np.int32), np.empty(lamps))
    point, away = (0.0, 40.0, 0.0), (0.0, 1.0, 0.0)  # above everything, and turned from it
    low, high = np.array([*point, -1.0, -1.0, -1.0]), np.array([*point, 1.0, 1.0, 1.0])
    bright = 1e9  # nothing is worth rays of its own
    tile = 1.0, low, high, candidates, others, np.empty(lamps)
    found, count, sent = choice_kernel.find_candidates(sources, 0, point, away, bright, *tile)
    assert (found, sent) == (0, 0.0)
    reached = [n for n in range(lamps) if choice_kernel.importance(sources, n, point, (0.0, -1.0, 0.0), 0.0) > 0]
    assert len(reached) > 4
    assert set(reached) <= set(others[0][:count].tolist())
    assert (np.diff(others[1][:count], prepend=0.0) > 0).all()
