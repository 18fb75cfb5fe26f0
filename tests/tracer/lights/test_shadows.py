"""How many rays a source gets where, against a source whose shadow is known."""

from __future__ import annotations

import pytest
import torch

from tracer.lights.shadows import ALL, FIRST, LEAST, MOST, PASSED, QUARTER, UNBLOCKED, WEIGHT, arriving

SIZE = (9, 24)
EDGE = 12  # first column in the light


def sent(level: int, seen: float, samples: int = 16) -> torch.Tensor:
    """``(H, W)`` rays to a source that columns from `EDGE` on see."""
    rays = torch.zeros(SIZE[0] * SIZE[1])

    def shadow_rays(pixels: torch.Tensor, turned: torch.Tensor, points: range) -> torch.Tensor:
        light = (pixels % SIZE[1] >= EDGE).float()
        rays[pixels] += len(points)
        sums = turned.new_zeros(MOST + 1, len(pixels))
        sums[UNBLOCKED], sums[PASSED], sums[WEIGHT] = 2.0, light * len(points), float(len(points))
        sums[LEAST], sums[MOST] = light, light
        return sums

    levels, shares = torch.full(SIZE, level, dtype=torch.uint8), torch.full(SIZE, seen)
    got = arriving(shadow_rays, levels, torch.zeros(2, *SIZE), seen=shares, samples=samples, start=0)
    assert torch.equal(got, 2.0 * (torch.arange(SIZE[1]) >= EDGE).float().expand_as(got) * (level > 0))
    return rays.view(SIZE)


def test_a_source_that_matters_gets_all_rays_at_the_edge_and_a_quarter_beside_it():
    assert sent(ALL, 1.0)[4].tolist() == [1] * 10 + [4, 16, 16, 4] + [1] * 10


def test_one_that_matters_less_gets_fewer():
    assert sent(QUARTER, 1.0)[4].tolist() == [1] * 10 + [4] * 4 + [1] * 10
    assert sent(FIRST, 1.0)[4].tolist() == [1] * 24
    assert sent(0, 1.0).max() == 0


@pytest.mark.parametrize(("seen", "most"), [(1.0, 16), (0.03, 16), (0.019, 1), (0.0, 1)])
def test_a_shadow_that_is_hardly_seen_gets_no_more_than_the_first_rays(seen: float, most: int):
    assert sent(ALL, seen).max() == most
