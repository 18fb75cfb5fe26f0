"""Lone bright pixels of reflections."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from post.shading.constants import BROAD, LIMIT
from post.shading.fireflies import without_lone_fireflies


def water(size: tuple[int, int] = (9, 9), roughness: float = 0.05) -> tuple[Tensor, Tensor]:
    """Grey light between 0.9 and 1, and the roughness of what reflects it."""
    light = 0.9 + 0.1 * torch.rand((1, 1, *size), generator=torch.Generator().manual_seed(3))
    return light.repeat(1, 3, 1, 1), torch.full((1, 1, *size), roughness)


@pytest.mark.parametrize("place", [(4, 4), (0, 0), (0, 5), (8, 3)])
def test_a_lone_bright_pixel_keeps_its_colour_and_twice_the_light_around(place: tuple[int, int]) -> None:
    light, roughness = water()
    light[0, :, place[0], place[1]] = torch.tensor([800.0, 400.0, 200.0])
    found = without_lone_fireflies(light, roughness)
    pixel = found[0, :, place[0], place[1]]
    assert 0.9 * LIMIT < float(pixel.dot(torch.tensor([0.2126, 0.7152, 0.0722]))) <= LIMIT
    torch.testing.assert_close(pixel / pixel[2], torch.tensor([4.0, 2.0, 1.0]))
    others = torch.ones(9, 9, dtype=torch.bool)
    others[place] = False
    assert torch.equal(found[..., others], light[..., others])


def test_the_image_of_a_lamp_stays() -> None:
    light, roughness = water()
    light[..., 4, 4:6] = 1000.0
    assert torch.equal(without_lone_fireflies(light, roughness), light)


@pytest.mark.parametrize("roughness", [0.0, BROAD, 0.6])
def test_mirrors_and_broad_lobes_keep_all(roughness: float) -> None:
    light, rough = water(roughness=roughness)
    light[..., 4, 4] = 1000.0
    assert torch.equal(without_lone_fireflies(light, rough), light)


def test_a_surface_of_one_pixel_is_not_compared_with_others() -> None:
    light, roughness = water(roughness=0.9)
    light[..., 4, 4], roughness[..., 4, 4] = 1000.0, 0.05
    assert torch.equal(without_lone_fireflies(light, roughness), light)
    single = torch.full((1, 3, 1, 1), 7.0)
    assert torch.equal(without_lone_fireflies(single, torch.full((1, 1, 1, 1), 0.05)), single)


@pytest.mark.parametrize("size", [(48, 63), (1, 9), (9, 1), (1, 1)])
def test_kernel_equals_reference(size: tuple[int, int]) -> None:
    draw = torch.Generator().manual_seed(5)
    light = torch.rand((2, 5, *size), generator=draw).pow(12) * 50
    roughness = 0.3 * torch.rand((2, 1, *size), generator=draw)
    for part in (light[:, :3], light[:, :3].contiguous()):
        got, want = (without_lone_fireflies(part, roughness, compiled=form) for form in (True, False))
        torch.testing.assert_close(got, want, rtol=1e-5, atol=0)
    assert max(size) < 10 or 0.02 < float((got != light[:, :3]).any(1).float().mean()) < 0.5
