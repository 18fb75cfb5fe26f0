"""Metrics: values worked out by hand, and masks."""

from __future__ import annotations

import pytest
import torch

from gbufrt.metrics.image import psnr, relative_squared_error, rmse, squared_error_map, ssim, ssim_map


def pair() -> tuple[torch.Tensor, torch.Tensor]:
    truth = torch.rand(2, 3, 16, 16, generator=torch.Generator().manual_seed(1))
    estimate = truth.clone()
    estimate[1, :, :8] += 0.5
    return estimate, truth


def test_known_values():
    estimate, truth = pair()
    assert torch.allclose(rmse(estimate, truth), torch.tensor([0.0, 0.125**0.5]))
    assert torch.allclose(psnr(estimate, truth), torch.tensor([torch.inf, 10 * torch.log10(torch.tensor(8.0))]))
    assert torch.allclose(squared_error_map(estimate, truth)[1, 0, :8], torch.tensor(0.25))
    ones = torch.ones(1, 1, 12, 12)
    assert float(relative_squared_error(ones * 1.5, ones, epsilon=0.0)) == pytest.approx(0.25)
    assert float(relative_squared_error(ones * 0.5, ones * 0)) == pytest.approx(0.25 / 1e-2)


def test_mask_chooses_the_pixels():
    estimate, truth = pair()
    mask = torch.zeros(2, 1, 16, 16, dtype=torch.bool)
    mask[:, :, :4] = True
    assert torch.allclose(rmse(estimate, truth, mask), torch.tensor([0.0, 0.5]))
    assert torch.equal(rmse(estimate, truth, ~mask)[:1], torch.zeros(1))
    assert bool(rmse(estimate, truth, mask & False).isnan().all())
    estimate[:, :, 8:] = torch.nan
    assert torch.allclose(rmse(estimate, truth, mask), torch.tensor([0.0, 0.5]))


def test_ssim_is_one_for_equals_and_falls_with_noise():
    estimate, truth = pair()
    assert torch.allclose(ssim(truth, truth), torch.ones(2), atol=1e-5)
    values = ssim(estimate, truth)
    assert float(values[1]) < 0.98 < float(values[0])
    assert ssim_map(estimate, truth).shape == (2, 1, 16, 16)


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match="one shape"):
        rmse(torch.zeros(1, 3, 4, 4), torch.zeros(1, 3, 4, 5))
    with pytest.raises(ValueError, match="mask must be"):
        rmse(torch.zeros(1, 3, 4, 4), torch.zeros(1, 3, 4, 4), torch.ones(1, 3, 4, 4))
    with pytest.raises(ValueError, match="larger than 5"):
        ssim(torch.zeros(1, 3, 4, 4), torch.zeros(1, 3, 4, 4))
