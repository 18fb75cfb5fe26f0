"""Light at one sample a pixel whose paths read a cache of irradiance."""

from __future__ import annotations

import torch
import voxels

from gbufrt import Camera
from tracer.frames import render
from tracer.paths.sampled import sampled_with_cache
from tracer.truth.truth import light_truth


def test_light_through_a_cache_has_the_mean_of_paths():
    """Though most of them end at the second surface."""
    scene, inside = voxels.gallery(0.2, (0.4, 0.3, 0.2), size=(40, 52))
    still, cache, found = render(scene, inside, light_samples=1).replace(behind=None), None, []
    for index in range(10):
        lit, cache = sampled_with_cache(scene, still.replace(index=index), cache, bounces=2)
        found.append(torch.stack([lit.read(name).mean() for name in ("indirect", "specular", "cached_diffuse")]))
    truth = light_truth(scene, still.gbuffer, bounces=2, samples=32)
    want = torch.stack([light.mean() for light in (truth.indirect, truth.specular, truth.diffuse)])
    torch.testing.assert_close(torch.stack(found[4:]).mean(dim=0), want, rtol=0.02, atol=0)


def test_replayed_samples_do_not_see_the_cache_grow():
    scene, inside = voxels.gallery(0.0)
    frames = [render(scene, inside, index=index, light_samples=1).replace(behind=None) for index in range(5)]
    known = None
    for before in frames[:3]:
        _, known = sampled_with_cache(scene, before, known, bounces=2)
    first, cache = sampled_with_cache(scene, frames[3], known, bounces=2)
    result, _ = sampled_with_cache(scene, frames[4], cache, before=frames[3], bounces=2)
    result.validate()
    chosen = result.read("replayed") > 0
    for name in ("diffuse", "specular"):
        assert bool(first.read(name)[chosen.expand_as(first.read(name))].any())
        assert torch.equal(result.read(f"replayed_{name}"), torch.where(chosen, first.read(name), 0.0))
    other, _ = sampled_with_cache(scene, frames[3], known, bounces=2)
    again, _ = sampled_with_cache(scene, frames[3], cache, bounces=2)
    assert torch.equal(other.read("indirect"), first.read("indirect")), "equal frames give equal light"
    assert not torch.equal(again.read("indirect"), first.read("indirect")), "the rest reads the cache"


def test_a_cut_to_what_other_paths_have_met_shows_less_noise():
    scene, inside = voxels.gallery(0.0)
    cache, there = None, Camera.look_at((1.5, 6.0, 8.5), (7.0, 2.0, 2.0), size=(10, 13), far=100.0)
    for index in range(8):
        still = render(scene, inside, index=index, light_samples=1).replace(behind=None)
        _, cache = sampled_with_cache(scene, still, cache, bounces=2)
    cut = render(scene, there, index=8, light_samples=1).replace(behind=None)
    lit, _ = sampled_with_cache(scene, cut, cache, bounces=2)
    truth = light_truth(scene, cut.gbuffer, bounces=3, samples=64)
    cached = lit.read("cached_diffuse") - (lit.read("diffuse") - lit.read("indirect"))
    ours, plain = ((x - truth.indirect).square().mean().sqrt() for x in (cached, lit.read("indirect")))
    assert float(ours) < 0.5 * float(plain)
