"""How much noise pixels are taken to have before their histories can tell."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt.luminance import luminance
from post.history.antilag import shared_at_first
from post.passes.denoising import denoise as stage

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
