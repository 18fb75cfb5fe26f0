"""Weights of taps, in plain Python: what processors take long over does not come up."""

from __future__ import annotations

import numpy as np
import pytest

from post.filters.constants import B3
from post.filters.kernel import Guide
from post.filters.weight_kernel import ALONG, AWAY, LENGTH, ROOT, TO_X, Kind, edge_with, room_weight

VARIANCE = np.float32(1e-12)  # square radiance: filters tell nothing of noise below


def tap(normal: tuple[float, float, float], depth: float, unlike: float, hit: float = 1.0) -> np.float32:
    """The weight of a tap beside a pixel that faces along x, at depth 1 with a footprint of a thousandth."""
    room = np.zeros(14 * LENGTH, np.float32)
    room[TO_X], room[ALONG], room[AWAY] = 1.0, ROOT * np.float32(1000.0), ROOT * np.float32(1000.0)
    rows = [np.full(1, value, np.float32) for value in (depth, *normal, hit, 0.0)]
    edge = edge_with(np.zeros((5, 1, 1), np.float32), True, (0,) * 7, 128.0)
    kind = Kind((0,), (), (), edge.squares, edge.rest, edge.least)
    zero = np.float32(0)
    return np.float32(room_weight(np.uint64(0), room, 0, Guide(*rows), zero, zero, kind, ROOT * np.float32(unlike)))


@pytest.mark.parametrize(
    "away", [((-1.0, 0.0, 0.0), 50.0, 1e6), ((1.0, 0.0, 0.0), 50.0, 0.0), ((0.0, 1.0, 0.0), 1.0, 0.0)]
)
def test_no_square_of_a_weight_is_denormal(away: tuple[tuple[float, float, float], float, float]) -> None:
    weight = tap(*away)
    assert 0 < weight < 1e-9, "what lies on another surface hardly counts"
    share = np.float32(B3[0] * B3[0]) * weight
    assert share * share * VARIANCE >= np.finfo(np.float32).tiny


def test_a_tap_that_hit_nothing_counts_nothing() -> None:
    assert tap((1.0, 0.0, 0.0), 1.0, 0.0, hit=0.0) == 0
    assert tap((1.0, 0.0, 0.0), 1.0, 0.0) == pytest.approx(1.0, rel=1e-5)
