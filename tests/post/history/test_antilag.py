"""How much noise pixels are taken to have before their histories can tell; shadows and dark samples among bright."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt.luminance import luminance
from post.filters.around import alike
from post.filters.surfaces import surface
from post.history.antilag import shared_at_first
from post.passes.denoising import denoise as stage
from post.passes.denoising.shadows import into_shadow, often_dark

SIZE = (36, 48)
G = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1]).gbuffer
ONES = torch.ones_like(G.depth)
HIT = torch.ones_like(G.hit)


def test_pixels_of_one_sample_share_the_relative_variance_of_those_around():
    dim = (torch.arange(SIZE[1]) < 24).expand_as(G.depth)
    mean = torch.where(dim, 0.5, 2.0).expand_as(G.normal)
    variance = 0.5 * luminance(mean).square()
    likely = shared_at_first(mean, variance, ONES, HIT)
    torch.testing.assert_close(likely[..., :21], variance[..., :21])
    torch.testing.assert_close(likely[..., 27:], variance[..., 27:])
    missed = variance.clone()
    missed[..., 18, 12] = 0.0
    assert float(shared_at_first(mean, missed, ONES, HIT)[..., 18, 12]) == pytest.approx(0.125 * 24 / 25)


def test_older_means_keep_their_variance_and_tell_nothing_of_single_samples():
    old = (torch.arange(SIZE[1]) < 24).expand_as(G.depth)
    mean, variance = torch.ones_like(G.normal), torch.where(old, 0.1, 1.0)
    likely = shared_at_first(mean, variance, torch.where(old, 10.0, 1.0), HIT)
    torch.testing.assert_close(likely, variance)
    assert torch.equal(shared_at_first(mean, variance, 2 * ONES, HIT), variance)


def test_wavelets_are_told_of_noise_where_all_samples_nearby_missed_the_light(monkeypatch):
    told, filtered = [], stage.atrous
    monkeypatch.setattr(stage, "atrous", lambda *a, **k: (told.append(k["variance"]), filtered(*a, **k))[1])
    generator = torch.Generator().manual_seed(0)
    light = 2.0 * (torch.rand(G.depth.shape, generator=generator) < 0.5).expand_as(G.normal)
    light[..., 16:21, 22:27] = 0.1
    stage.denoise(light, G)
    monkeypatch.setattr(stage, "shared_at_first", lambda mean, variance, length, hit: variance)
    stage.denoise(light, G)
    assert float(told[0][..., 18, 24]) > 10 * float(told[1][..., 18, 24])


def test_borders_of_shadows_come_from_the_sample():
    frame = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1])
    g = frame.gbuffer
    same = alike(surface(g.depth, g.normal, g.hit, g.camera))
    left = torch.arange(SIZE[1]).view(1, 1, 1, -1).expand(1, 3, *SIZE) < 24
    dark = left & g.hit
    truth = torch.where(left, 0.1, 1.0)
    blurred = torch.nn.functional.avg_pool2d(
        torch.nn.functional.pad(truth, (1, 1, 1, 1), mode="replicate"), 3, stride=1
    )
    sample = torch.where(left, 0.0, 0.9)
    kept = into_shadow(blurred, sample, same, torch.ones_like(g.depth))
    assert float((kept - truth)[dark].abs().max()) < 0.5 * float((blurred - truth)[dark].abs().max())
    assert torch.equal(kept[~left], blurred[~left])
    flat = torch.full_like(truth, 0.5)
    assert torch.allclose(into_shadow(flat, torch.zeros_like(flat), same, torch.ones_like(g.depth)), flat)


def test_dark_samples_among_bright_ones_are_no_shadow():
    frame = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1])
    g, mean = frame.gbuffer, torch.linspace(0.5, 1.0, SIZE[1]).expand_as(frame.gbuffer.normal).contiguous()
    same, sure = alike(surface(g.depth, g.normal, g.hit, g.camera)), torch.ones_like(g.depth)
    rows, columns = torch.arange(SIZE[0])[:, None], torch.arange(SIZE[1])
    scattered = torch.where((rows % 2 == 0) & (columns % 2 == 0), 0.0, 1.3) * mean
    inner = (..., slice(8, -8), slice(8, -8))
    assert torch.equal(into_shadow(mean, scattered, same, sure)[inner], mean[inner])
    together = into_shadow(mean, torch.where(columns < 24, 0.0, 1.0) * mean, same, sure)
    lower = (mean - together)[inner][g.hit.expand_as(mean)[inner] & (columns < 22).expand_as(mean)[inner]]
    assert float(lower.min()) > 0


def test_samples_that_are_often_dark_prove_no_shadow():
    """A penumbra that stays: half of its samples have been dark, and half of those of this frame are."""
    frame = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1])
    g = frame.gbuffer
    same, sure = alike(surface(g.depth, g.normal, g.hit, g.camera)), torch.ones_like(g.depth)
    mean = torch.linspace(0.4, 0.6, SIZE[1]).expand_as(g.normal).contiguous()
    rows, columns = torch.arange(SIZE[0])[:, None], torch.arange(SIZE[1])
    half = torch.where((rows + columns) % 2 == 0, 0.0, 2.0) * mean
    long, one = torch.full_like(g.depth, 30.0), torch.ones_like(g.depth)
    variance = mean[:, :1].square() / long  # of samples that are all or nothing, half of the time
    often = often_dark(mean, variance, long, g.hit)
    torch.testing.assert_close(often[g.hit], torch.full_like(often[g.hit], 0.5), rtol=0.02, atol=0)
    young = often_dark(mean, variance * long, one, g.hit)
    assert float(young.max()) == 0
    whole = (same.all(dim=1, keepdim=True) & g.hit).expand_as(mean)
    kept, darker = (into_shadow(mean, half, same, sure, each)[whole] for each in (often, young))
    torch.testing.assert_close(kept, mean[whole])
    assert float((darker - mean[whole]).min()) < -0.001
    dark = into_shadow(mean, 0 * mean, same, sure, often)  # where all are dark a shadow has come
    assert float((mean - dark)[g.hit.expand_as(mean)].mean()) > 0
