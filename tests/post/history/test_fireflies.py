"""Fireflies: what stands out is cut and given back, what history or the surface explains stays; no lamp lingers."""

from __future__ import annotations

import boxes
import pytest
import torch

from post import denoise
from post.filters.surfaces import surface
from post.history.fireflies import cut_outliers, given_back, taken

SIZE = (36, 48)
FRAME = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1])
G = FRAME.gbuffer
GEOMETRY = surface(G.depth, G.normal, G.hit, G.camera)
INNER = (..., slice(8, -8), slice(8, -8))
AT = (..., 18, 24)


def noisy(seed: int, level: float = 1.0) -> torch.Tensor:
    """Light of which a sample brings all or nothing: a third of them bright."""
    generator = torch.Generator().manual_seed(seed)
    return (level * 3.0 * (torch.rand(G.depth.shape, generator=generator) < 1 / 3)).expand_as(G.normal).contiguous()


def state(mean: float, square: float, age: float) -> torch.Tensor:
    """As `cut_outliers` takes it, for three channels that lead."""
    planes = [mean] * 6 + [mean, square, 1 / age, age]
    return torch.tensor(planes).view(1, -1, 1, 1).expand(1, -1, *SIZE).contiguous()


def test_an_outlier_is_cut_among_noise_and_light_without_noise_is_not():
    light = noisy(1)
    light[AT] = 100.0
    kept = cut_outliers(light, GEOMETRY, None, None, 3, 2.5)
    around = torch.cat([light[0, 0, 15:22, 21:28].flatten()[:24], light[0, 0, 15:22, 21:28].flatten()[25:]])
    limit = float(around.mean() + 2.5 * around.std(correction=0))
    assert limit < float(kept[AT].max()) < 1.15 * limit  # edge weights below one leave a little of the sample in
    assert torch.equal(cut_outliers(light, GEOMETRY, None, None, 3, 0.0), light)
    edge = torch.where(torch.arange(SIZE[1]) < 24, 1.0, 4.0).expand_as(G.normal).contiguous()
    edge[AT] = 100.0
    assert torch.allclose(cut_outliers(edge, GEOMETRY, None, None, 3, 2.5), edge, rtol=0.02)


def test_outliers_are_cut_where_there_is_little_noise_whatever_stands_beside_them():
    """A quarter of the light is noise. The limit is that of the calm surface, with one outlier or with five."""
    generator = torch.Generator().manual_seed(3)
    calm = (1 + 0.25 * torch.randn(G.depth.shape, generator=generator)).clamp_min(0.1).expand_as(G.normal).contiguous()
    assert float((cut_outliers(calm, GEOMETRY, None, None, 3, 2.5) - calm).abs().max()) < 0.1
    one = calm.clone()
    one[AT] = 200.0
    kept = cut_outliers(one, GEOMETRY, None, None, 3, 2.5)
    assert 1.6 < float(kept[AT].max()) < 8.0  # 2.5 standard deviations above, and four times that
    five = one.clone()
    for y, x in ((-2, 0), (2, 0), (0, -2), (0, 2)):
        five[..., 18 + y, 24 + x] = 200.0
    assert float(cut_outliers(five, GEOMETRY, None, None, 3, 2.5)[AT].max()) < 1.3 * float(kept[AT].max())


def test_history_explains_a_bright_sample_once_it_is_old_enough():
    light = noisy(1)
    light[AT] = 9.0
    for mean, square, age, stays in ((9.0, 81.0, 8.0, True), (9.0, 81.0, 2.0, False), (1.0, 3.0, 8.0, False)):
        noise = torch.full_like(G.depth, square - mean * mean)
        kept = cut_outliers(light, GEOMETRY, state(mean, square, age), noise, 3, 2.5)
        assert bool((kept[AT] > 8.9).all()) is stays


def test_what_is_cut_comes_back_as_light_all_around():
    light = noisy(1)
    light[AT] = 60.0
    kept = cut_outliers(light, GEOMETRY, None, None, 3, 2.5)
    cut = taken(light, kept, 3)
    assert float(cut[AT].min()) > 30.0
    lighter = given_back(kept, kept, cut, GEOMETRY)
    inner = G.hit.expand_as(light)
    assert abs(float(lighter[inner].sum() / light[inner].sum()) - 1) < 0.03
    assert float(kept[inner].sum()) < 0.96 * float(light[inner].sum())


def test_few_samples_of_a_small_surface_do_not_tell_what_to_give_back():
    """A patch of which a third was cut lies in front of a wall of which a tenth was."""
    camera, one = boxes.camera(SIZE), torch.ones_like(G.depth)
    patch = torch.zeros_like(G.hit)
    patch[..., 14:22, 20:28] = True
    toward = camera.rotate_to_world(torch.tensor([0.0, 0.0, -1.0]).view(1, 3, 1, 1).expand_as(G.normal))
    geometry = surface(torch.where(patch, 2.0, 4.0), toward, one > 0, camera)
    light, cut = one.expand_as(G.normal).contiguous(), torch.where(patch, 1 / 3, 0.1)
    typical = float(cut.mean())

    def share(frames: float | None) -> torch.Tensor:
        length = None if frames is None else frames * one
        return given_back(light, light, cut, geometry, length=length)[:, :1] - 1

    known, first, later, even = share(None), share(1.0), share(64.0), share(1e9)
    assert torch.allclose(known[patch], torch.tensor(1 / 3), atol=1e-3)
    assert torch.allclose(even, known, atol=1e-4)
    own = [float((found[patch].mean() - typical) / (1 / 3 - typical)) for found in (first, later)]
    assert 0.1 < own[0] < 0.6 < 0.9 < own[1]
    assert float((first - known)[~patch].abs().max()) < 0.02
    same = given_back(light, light, torch.full_like(cut, 0.2), geometry, length=one) / light
    assert torch.allclose(same, torch.tensor(1.2), atol=1e-4)


def test_what_a_single_sample_brings_far_above_the_limit_is_lost():
    kept = torch.ones_like(G.normal)
    assert float(taken(9.0 * kept, kept, 3).max()) == pytest.approx(8.0)
    assert float(taken(60.0 * kept, kept, 3).max()) == pytest.approx(10.0)


def test_a_lamp_that_goes_out_does_not_linger():
    history, light, generator = None, torch.zeros_like(G.normal), torch.Generator().manual_seed(4)
    for frame in range(11):
        grain = 0.25 + 1.5 * torch.rand(G.depth.shape, generator=generator)
        light, history = denoise((grain * (1.0 if frame < 8 else 0.2)).expand_as(G.normal), G, history)
    mask = G.hit[INNER].expand_as(light[INNER])
    assert abs(float(light[INNER][mask].mean()) - 0.2) < 0.03
