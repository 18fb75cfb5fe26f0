"""Polynomials of kernels against the exact functions."""

from __future__ import annotations

import numpy as np
import torch

from gbufrt.compute.approximations import atan2, cos_sin, exp2, falling_exp2, log2


def test_exp2() -> None:
    x = np.linspace(-125.9, 126.9, 5001, dtype=np.float32)
    got = np.array([exp2(v) for v in x], dtype=np.float64)
    assert np.abs(got / 2.0 ** x.astype(np.float64) - 1).max() < 3e-7
    assert exp2(np.float32(-1e9)) < 1.2e-38
    assert 1e38 < exp2(np.float32(1e9)) < np.inf


def test_falling_exp2() -> None:
    x = np.append(np.linspace(-125.9, 0, 5001, dtype=np.float32), np.float32(0))
    with np.errstate(over="ignore"):
        got = np.array([falling_exp2(v) for v in x], dtype=np.float64)
    assert np.abs(got / 2.0 ** x.astype(np.float64) - 1).max() < 3e-7
    assert falling_exp2(np.float32(-1e9)) < 1.2e-38


def test_log2() -> None:
    x = np.exp2(np.linspace(-120, 120, 5001)).astype(np.float32)
    got, want = np.array([log2(v) for v in x], dtype=np.float64), np.log2(x.astype(np.float64))
    assert (np.abs(got - want) <= 6e-7 + 1e-7 * np.abs(want)).all()
    near = (1 - np.geomspace(1e-6, 0.2, 1000)).astype(np.float32)
    got, want = np.array([log2(v) for v in near], dtype=np.float64), np.log2(near.astype(np.float64))
    assert np.abs(got / want - 1).max() < 3e-7
    assert log2(np.float32(1)) == 0


def test_angles_are_those_of_the_library() -> None:
    angle = torch.linspace(-3.14, 3.14, 2001)
    for length in (1e-6, 1.0, 1e6):
        x, y = (length * angle.cos()).numpy(), (length * angle.sin()).numpy()
        found = torch.tensor([atan2(y[i], x[i]) for i in range(len(x))])
        torch.testing.assert_close(found, angle, atol=5e-7, rtol=0)


def test_cosine_and_sine_are_those_of_the_library() -> None:
    turns = np.concatenate([np.linspace(-1, 2, 4001), np.arange(-8, 17) / 8]).astype(np.float32)
    got = np.array([cos_sin(t) for t in turns], dtype=np.float64)
    angle = 2 * np.pi * turns.astype(np.float64)
    assert np.abs(got - np.stack([np.cos(angle), np.sin(angle)], axis=1)).max() < 2e-7
