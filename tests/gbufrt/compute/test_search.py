"""Binary search against Python's."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np

from gbufrt.compute.search import lower_bound, upper_bound


def test_bounds_are_those_of_bisection_for_every_length_and_value() -> None:
    rng = np.random.default_rng(0)
    for count in range(20):
        values = np.sort(rng.integers(0, 8, count))  # many alike
        for value in np.arange(-1.0, 9.0, 0.5):
            assert lower_bound(values, value) == bisect_left(values, value), (values, value)
            assert upper_bound(values, value) == bisect_right(values, value), (values, value)
