"""What lies around pixels: the kernels beside their definitions, and the definitions beside plain loops."""

from __future__ import annotations

import boxes
import pytest
import torch

from post.filters.around import alike, kindred, least, pooled
from post.filters.surfaces import surface

SIZE = (19, 37)


def planes(channels: int, seed: int) -> torch.Tensor:
    return torch.rand(2, channels, *SIZE, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("size", [1, 3, 7, 25])
@pytest.mark.parametrize("masks", [1, 3])
def test_means_over_squares_are_those_of_their_definition(size, masks):
    value, mask = planes(3, 1), (planes(masks, 2) > 0.6).float() * planes(masks, 3)
    got, want = (pooled(value, mask, size, compiled=form) for form in (True, False))
    torch.testing.assert_close(got, want, rtol=1e-5, atol=1e-6)


def test_a_mean_is_that_of_the_pixels_that_count():
    value, mask = planes(1, 4), (planes(1, 5) > 0.5).float()
    there = mask[1, 0, 3:6, 0:2] > 0  # the square around the border's pixel (4, 0)
    assert there.any()
    torch.testing.assert_close(pooled(value, mask)[1, 0, 4, 0], value[1, 0, 3:6, 0:2][there].mean())
    assert (pooled(value, torch.zeros_like(mask)) == 0).all()


@pytest.mark.parametrize("size", [1, 5, 25])
def test_least_values_over_squares_are_those_of_their_definition(size):
    value = torch.where(planes(1, 6) > 0.9, torch.inf, planes(1, 7))
    assert torch.equal(least(value, size, compiled=True), least(value, size, compiled=False))


def test_least_value_beside_a_plain_one():
    value = planes(1, 8)
    assert least(value, 5)[0, 0, 1, 9] == value[0, 0, 0:4, 7:12].min()


@pytest.mark.parametrize("rough", [False, True])
def test_neighbours_alike_are_those_of_their_definition(rough):
    g = boxes.frame(boxes.camera((37, 53))).gbuffer
    roughness = torch.linspace(0.0, 1.0, 53).expand_as(g.depth) if rough else None
    hit = g.hit.clone()
    hit[..., :3, :] = hit[..., 20:24, 30] = False
    geometry = surface(g.depth, g.normal, hit, g.camera, roughness)
    got, want = (alike(geometry, compiled=form) for form in (True, False))
    assert 0.1 < want.float().mean() < 0.999
    assert (got != want).float().mean() < 1e-4  # the kernel's powers are approximations
    assert want[:, 4].all()


def test_gradients_take_the_definition():
    value = planes(1, 9).requires_grad_()
    pooled(value, torch.ones_like(value)).sum().backward()
    assert value.grad is not None
    torch.testing.assert_close(value.grad[0, 0, 5, 5], torch.tensor(1.0))


@pytest.mark.parametrize("rough", [False, True])
def test_means_over_like_surfaces_are_those_of_their_definition(rough):
    g = boxes.frame(boxes.camera((19, 37))).gbuffer
    roughness = torch.linspace(0.0, 1.0, 37).expand_as(g.depth) if rough else None
    geometry = surface(g.depth, g.normal, g.hit, g.camera, roughness)
    value, mask, where = planes(3, 10)[:1], planes(1, 11)[:1] * g.hit, planes(1, 12)[:1] > 0.5
    got, want = (kindred(value, mask, where, geometry, 3, compiled=form) for form in (True, False))
    torch.testing.assert_close(got, want, rtol=1e-5, atol=1e-6)
    assert (got[:, :, ~where[0, 0]] == 0).all()
    assert got.std() > 0.1


def test_surfaces_count_less_the_more_they_face_elsewhere_and_the_farther_they_lie():
    g = boxes.frame(boxes.camera((19, 37)), boxes=boxes.ROOM[:1]).gbuffer
    flat, ones = torch.full_like(g.depth, 4.0), torch.ones_like(g.depth)
    up = torch.tensor([0.0, 1.0, 0.0])[None, :, None, None].expand_as(g.normal)
    odd = (torch.arange(37) == 18).expand_as(g.depth)
    side = torch.where(odd, torch.tensor([1.0, 0.0, 0.0])[None, :, None, None], up)

    def share(depth: torch.Tensor, normal: torch.Tensor) -> float:
        """What the column counts for, for a pixel next to it: two taps, beside itself and two on its other side."""
        geometry = surface(depth, normal, ones > 0, g.camera)
        return float(kindred(odd.float(), ones, ones > 0, geometry, 1)[0, 0, 9, 17])

    assert share(flat, up) == pytest.approx(2 / 5)
    assert share(flat, side) == pytest.approx(2 * 0.5**6 / (3 + 2 * 0.5**6), rel=1e-4)
    assert share(flat, torch.where(odd, -up, up)) == 0
    far = torch.where(odd, flat + 5 / float(g.camera.pixels_per_unit(flat)[0, 0, 0, 0]), flat)
    away = 2.718281828 ** (-0.25 * 5)  # five footprints
    assert share(far, up) == pytest.approx(2 * away / (3 + 2 * away), rel=1e-4)
