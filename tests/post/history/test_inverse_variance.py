"""Neighbours that keep less noise count more; edges of light and of surfaces stay."""

from __future__ import annotations

import boxes
import torch

from post.filters.surfaces import surface
from post.history.inverse_variance import certain_mean

SIZE = (36, 48)
G = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1]).gbuffer
GEOMETRY = surface(G.depth, G.normal, G.hit, G.camera)
WHOLE = torch.ones_like(G.depth)  # of the variance is left
INNER = (..., slice(8, -8), slice(8, -8))


def noise(deviation: torch.Tensor) -> torch.Tensor:
    generator = torch.Generator().manual_seed(3)
    return (1 + deviation * torch.randn(G.depth.shape, generator=generator)).expand_as(G.normal).contiguous()


def test_noise_is_averaged_and_uncertain_pixels_follow_certain_ones():
    light, even = noise(torch.tensor(0.2)), torch.full_like(G.depth, 1.0)
    before, after = (
        float((mean - 1)[INNER].square().mean()) for mean in (light, certain_mean(light, even, WHOLE, GEOMETRY))
    )
    assert after < 0.5 * before
    column = (torch.arange(SIZE[1]) == 24).expand_as(G.depth)
    light = torch.where(column, 1.5, 1.0).expand_as(G.normal).contiguous()
    mean = certain_mean(light, torch.where(column, 25.0, 0.01), WHOLE, GEOMETRY)
    assert float(mean[..., 12:24, 24].max()) < 1.1  # the kernel alone leaves 3/8 of the difference: 1.19


def test_edges_stay_where_there_is_no_noise_and_sky_stays():
    light = torch.where(torch.arange(SIZE[1]) < 24, 1.0, 4.0).expand_as(G.normal).contiguous()
    kept = certain_mean(light, torch.full_like(G.depth, 1e-4), WHOLE, GEOMETRY)
    assert torch.allclose(kept, light, rtol=0.02)
    sky = G.replace(hit=torch.zeros_like(G.hit))
    nothing = surface(sky.depth, sky.normal, sky.hit, sky.camera)
    assert torch.equal(certain_mean(light, WHOLE, WHOLE, nothing), light)


def test_a_surface_of_one_pixel_leans_on_those_around_it_as_its_noise_requires():
    alone = torch.zeros_like(G.depth)
    alone[..., 18, 24] = 1
    normal = torch.where(alone > 0, -G.normal, G.normal)
    geometry = surface(G.depth, normal, G.hit, G.camera)
    light = torch.where(alone > 0, 0.2, 1.0).expand_as(G.normal).contiguous()
    kept = torch.where(alone > 0, 1.0, 0.01)
    noisy, half, sure = (certain_mean(light, WHOLE * variance, kept, geometry) for variance in (1.0, 0.3, 1e-6))
    assert noisy[..., 18, 24].min() > 0.9
    metal = certain_mean(light, WHOLE, kept, geometry, metallic=alone > 0)[..., 18, 24]
    torch.testing.assert_close(metal, (noisy[..., 18, 24] + 0.2) / 2)
    assert noisy[..., 17, 24].min() > 0.95
    assert 0.82 < half[..., 18, 24].min() < 0.92  # its variance is half of the squared difference
    torch.testing.assert_close(sure[..., 18, 24], light[..., 18, 24])


def test_a_lonely_pixel_leans_on_like_surfaces_farther_around_not_on_those_beside_it():
    bars = (torch.arange(SIZE[1]) % 3 == 0).expand_as(G.depth)  # a pixel wide, and brighter than what lies between
    geometry = surface(G.depth, torch.where(bars, -G.normal, G.normal), G.hit, G.camera)
    alone = torch.zeros_like(G.depth)
    alone[..., 18, 24] = 1
    light = torch.where(alone > 0, 9.0, torch.where(bars, 3.0, 1.0)).expand_as(G.normal).contiguous()
    variance, kept = torch.where(alone > 0, 50.0, 1e-4), torch.where(bars, 1.0, 0.1)
    among, apart = (
        certain_mean(light, variance, kept, geometry, lonely)[..., 18, 24] for lonely in (None, bars.float())
    )
    assert among.max() < 2.5
    torch.testing.assert_close(apart, torch.full_like(apart, 3.0), rtol=0.1, atol=0.0)


def test_a_lonely_pixel_leans_on_like_surfaces_six_pixels_away():
    rows, columns = (torch.arange(side) % 6 == 0 for side in SIZE)
    dots = (rows[:, None] & columns).expand_as(G.depth)
    geometry = surface(G.depth, torch.where(dots, -G.normal, G.normal), G.hit, G.camera)
    alone = torch.zeros_like(G.depth)
    alone[..., 18, 24] = 1
    light = torch.where(alone > 0, 9.0, torch.where(dots, 3.0, 1.0)).expand_as(G.normal).contiguous()
    variance, kept = torch.where(alone > 0, 50.0, 1e-4), torch.where(dots, 1.0, 0.1)
    mean = certain_mean(light, variance, kept, geometry, dots.float())[..., 18, 24]
    torch.testing.assert_close(mean, torch.full_like(mean, 3.0), rtol=0.15, atol=0.0)
