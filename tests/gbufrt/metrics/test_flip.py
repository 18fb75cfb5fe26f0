"""FLIP: known values, symmetry of form, masks, and a clear word where the package is missing."""

from __future__ import annotations

import sys

import pytest
import torch

from gbufrt.metrics.flip import flip, flip_map


@pytest.fixture(autouse=True)
def package() -> None:
    pytest.importorskip("flip_evaluator")


def test_known_values():
    black, white = torch.zeros(1, 3, 24, 24), torch.ones(1, 3, 24, 24)
    assert float(flip(black, black)) == 0.0
    assert float(flip(white, black)) == pytest.approx(0.9673, abs=1e-3)  # FLIP's error of white on black
    green = torch.zeros(1, 3, 24, 24).index_fill(1, torch.tensor(1), 1.0)
    blue = torch.zeros(1, 3, 24, 24).index_fill(1, torch.tensor(2), 1.0)
    assert float(flip(blue, green)) == pytest.approx(1.0, abs=0.05)  # the largest difference of hue there is


def test_a_faint_change_scores_little_and_a_batch_is_its_parts():
    truth = torch.rand(2, 3, 20, 30, generator=torch.Generator().manual_seed(1))
    estimate = torch.stack([truth[0] * 0.98, truth[1] * 0.5])
    both = flip(estimate, truth)
    assert float(both[0]) < 0.1 < float(both[1])
    assert torch.allclose(both[1:], flip(estimate[1:], truth[1:]))
    assert flip_map(estimate, truth).shape == (2, 1, 20, 30)


def test_mask_and_hdr():
    truth = torch.rand(1, 3, 20, 30, generator=torch.Generator().manual_seed(2))
    estimate = truth.clone()
    estimate[..., :10, :] = 1.0
    mask = torch.zeros(1, 1, 20, 30, dtype=torch.bool)
    mask[..., 19:, :] = True
    assert float(flip(estimate, truth, mask)) < float(flip(estimate, truth)) < float(flip(estimate, truth, ~mask))
    assert 0.0 < float(flip(truth * 20, truth * 10, hdr=True)) <= 1.0


def test_errors_say_what_to_do(monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(ValueError, match="B,3,H,W"):
        flip_map(torch.zeros(1, 1, 4, 4), torch.zeros(1, 1, 4, 4))
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(ModuleNotFoundError, match=r"gbufrt\[metrics\]"):
        flip_map(torch.zeros(1, 3, 4, 4), torch.zeros(1, 3, 4, 4))
