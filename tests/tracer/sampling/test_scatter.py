"""Directions that surfaces scatter into."""

from __future__ import annotations

import math

import torch

from tracer.sampling.scatter import sample_specular, specular_response


def test_mirrored_directions_follow_the_reflectance():
    g = torch.Generator().manual_seed(2)
    n, alpha = 200000, torch.tensor(0.3)
    up, view = torch.tensor([0.0, 1.0, 0.0]), torch.nn.functional.normalize(torch.tensor([1.0, 0.7, 0.2]), dim=0)
    normals, toward, alpha = up.expand(n, 3), view.expand(n, 3), alpha.expand(n)
    white = torch.ones(n, 3)
    directions, weight, _ = sample_specular(normals, toward, alpha, torch.rand(2, n, generator=g))
    even = torch.nn.functional.normalize(torch.randn(n, 3, generator=g), dim=1)
    even = torch.where(even[:, 1:2] < 0, -even, even)
    value = specular_response(normals, toward, alpha, white, even)[:, 0] * 2 * math.pi
    assert abs(float(weight.mean() - value.mean())) < 0.01
    assert torch.allclose((directions * weight[:, None]).mean(0), (even * value[:, None]).mean(0), atol=0.01)
