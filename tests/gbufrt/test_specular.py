"""Specular reflection of a dielectric, against the microfacet model itself."""

from __future__ import annotations

import math

import pytest
import torch

from gbufrt.specular import DIELECTRIC_F0, directional_albedo, masking_ratio, sample_visible_normal, schlick


@pytest.mark.parametrize("roughness", [0.0, 0.13, 0.4, 0.72, 1.0])
@pytest.mark.parametrize("cosine", [0.05, 0.21, 0.6, 1.0])
def test_share_is_the_integral_over_visible_microfacets(roughness: float, cosine: float) -> None:
    place = torch.arange(20000, dtype=torch.float64) + 0.5
    u = torch.stack([place * 0.7548776662466927 % 1, place * 0.5698402909980532 % 1])[None]
    view = torch.tensor([math.sqrt(1 - cosine**2), 0.0, cosine], dtype=torch.float64).view(1, 3, 1)
    alpha = torch.tensor(roughness**2, dtype=torch.float64).view(1, 1, 1)
    half = torch.cat(sample_visible_normal(view.split(1, dim=1), alpha, u.split(1, dim=1)), dim=1)
    facing = (half * view).sum(1, keepdim=True)
    out = 2 * facing * half[:, 2:] - cosine
    cosines = torch.full_like(out, cosine)
    mirrored = schlick(facing, DIELECTRIC_F0) * masking_ratio(cosines, out, alpha)
    got = float(directional_albedo(torch.tensor(cosine), torch.tensor(roughness)))
    assert abs(got - float(mirrored.mean())) < 0.012


def test_a_smooth_dielectric_follows_schlick_and_a_rough_one_mirrors_less_aslant() -> None:
    cosine = torch.linspace(0, 1, 65)
    smooth = directional_albedo(cosine, torch.zeros(65))
    torch.testing.assert_close(smooth, 0.04 + 0.96 * (1 - cosine) ** 5, atol=2e-3, rtol=0.0)
    assert (directional_albedo(cosine[:20], torch.full((20,), 0.8)) < 0.3 * smooth[:20]).all()


def test_differentiable_in_both() -> None:
    cosine = torch.tensor([0.13, 0.52, 0.91], dtype=torch.float64, requires_grad=True)
    roughness = torch.tensor([0.2, 0.55, 0.8], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(directional_albedo, (cosine, roughness))
    grads = torch.autograd.grad(directional_albedo(cosine, roughness).sum(), (cosine, roughness))
    assert all(bool((g != 0).all()) for g in grads)
