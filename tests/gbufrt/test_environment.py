from __future__ import annotations

import math

import pytest
import torch

from gbufrt.environment import (
    environment_directions,
    environment_mean,
    environment_solid_angles,
    lookup_environment,
)


def one(x: float, y: float, z: float) -> torch.Tensor:
    return torch.tensor([x, y, z]).view(1, 3, 1, 1)


def test_axes_lie_where_the_module_says():
    size = (64, 128)
    way = environment_directions(size)
    for direction, row, column in [
        ((0.0, 0.0, -1.0), 32.0, 64.0),
        ((1.0, 0.0, 0.0), 32.0, 96.0),
        ((-1.0, 0.0, 0.0), 32.0, 32.0),
    ]:
        near = (way[0] * torch.tensor(direction)[:, None, None]).sum(0).argmax()
        assert abs(int(near) // 128 + 0.5 - row) <= 0.5
        assert abs(int(near) % 128 + 0.5 - column) <= 0.5
    assert (way[0, 1, 0] > 0.99).all()
    assert torch.allclose(way.norm(dim=1), torch.ones(1, *size))


def test_solid_angles_cover_the_sphere():
    angles = environment_solid_angles((16, 32))
    assert angles.expand(1, 1, 16, 32).sum().item() == pytest.approx(4 * math.pi, rel=1e-6)


def test_lookup_inverts_directions():
    torch.manual_seed(0)
    picture = torch.rand(2, 3, 12, 20)
    way = environment_directions((12, 20)).expand(2, -1, -1, -1)
    assert torch.allclose(lookup_environment(picture, way * 3.0), picture, atol=1e-5)


def test_lookup_of_a_smooth_sky_is_smooth_across_the_seam():
    way = environment_directions((64, 128))
    picture = 0.5 + 0.5 * way[:, 0:1] + 0.2 * way[:, 1:2]
    angle = torch.linspace(math.pi - 0.1, math.pi + 0.1, 201)
    directions = torch.stack([angle.sin(), torch.full_like(angle, 0.1), -angle.cos()])[None, :, None]
    found = lookup_environment(picture, directions)
    unit = directions / directions.norm(dim=1, keepdim=True)
    assert torch.allclose(found, 0.5 + 0.5 * unit[:, 0:1] + 0.2 * unit[:, 1:2], atol=2e-3)


def test_batch_equals_loop_and_one_sky_serves_all():
    torch.manual_seed(1)
    picture, way = torch.rand(2, 3, 8, 16), torch.randn(2, 3, 5, 7)
    both = lookup_environment(picture, way)
    assert torch.allclose(both[1:], lookup_environment(picture[1:], way[1:]), atol=1e-6)
    shared = lookup_environment(picture[:1], way)
    assert torch.equal(shared, lookup_environment(picture[:1].expand(2, -1, -1, -1), way))


def test_gradients_match_differences_and_are_not_zero():
    torch.manual_seed(2)
    picture = torch.rand(1, 2, 6, 8, dtype=torch.float64, requires_grad=True)
    way = torch.randn(1, 3, 2, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lookup_environment, (picture, way))
    lookup_environment(picture, way).sum().backward()
    assert picture.grad is not None
    assert way.grad is not None
    assert picture.grad.abs().max() > 0
    assert way.grad.abs().max() > 0


def test_poles_and_the_zero_vector_are_finite():
    picture = torch.rand(1, 3, 8, 16)
    way = torch.cat([one(0.0, 1.0, 0.0), one(0.0, -1.0, 0.0), one(0.0, 0.0, 0.0)], dim=3).requires_grad_()
    found = lookup_environment(picture, way)
    found.sum().backward()
    assert torch.isfinite(found).all()
    assert way.grad is not None
    assert torch.isfinite(way.grad).all()


def test_the_mean_is_over_directions_not_over_pixels():
    height = environment_directions((16, 32))[:, 1:2].square()
    picture = torch.cat([height, 2 * torch.ones_like(height)], dim=1)
    assert environment_mean(picture)[0, :, 0, 0].tolist() == pytest.approx([1 / 3, 2.0], rel=1e-2)
    assert float(height.mean()) > 0.45  # the zenith has as many pixels as the horizon


def test_wrong_shape_says_what_was_expected():
    with pytest.raises(ValueError, match=r"directions must be \(B,3,H,W\)"):
        lookup_environment(torch.rand(1, 3, 4, 8), torch.rand(1, 4, 8, 3))
