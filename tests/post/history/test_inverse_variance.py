"""Neighbours that keep less noise count more; edges of light and of surfaces stay."""

from __future__ import annotations

import boxes
import torch

from post.filters.surfaces import surface
from post.history.inverse_variance import certain_mean

SIZE = (36, 48)
G = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1]).gbuffer
GEOMETRY = surface(G.depth, G.normal, G.hit, G.camera)
INNER = (..., slice(8, -8), slice(8, -8))


def noise(deviation: torch.Tensor) -> torch.Tensor:
    generator = torch.Generator().manual_seed(3)
    return (1 + deviation * torch.randn(G.depth.shape, generator=generator)).expand_as(G.normal).contiguous()


def test_noise_is_averaged_and_uncertain_pixels_follow_certain_ones():
    light, even = noise(torch.tensor(0.2)), torch.full_like(G.depth, 1.0)
    before, after = (float((mean - 1)[INNER].square().mean()) for mean in (light, certain_mean(light, even, GEOMETRY)))
    assert after < 0.5 * before
    column = (torch.arange(SIZE[1]) == 24).expand_as(G.depth)
    light = torch.where(column, 1.5, 1.0).expand_as(G.normal).contiguous()
    mean = certain_mean(light, torch.where(column, 25.0, 0.01), GEOMETRY)
    assert float(mean[..., 12:24, 24].max()) < 1.1  # the kernel alone leaves 3/8 of the difference: 1.19


def test_edges_stay_where_there_is_no_noise_and_sky_stays():
    light = torch.where(torch.arange(SIZE[1]) < 24, 1.0, 4.0).expand_as(G.normal).contiguous()
    kept = certain_mean(light, torch.full_like(G.depth, 1e-4), GEOMETRY)
    assert torch.allclose(kept, light, rtol=0.02)
    sky = G.replace(hit=torch.zeros_like(G.hit))
    nothing = surface(sky.depth, sky.normal, sky.hit, sky.camera)
    assert torch.equal(certain_mean(light, torch.ones_like(G.depth), nothing), light)
