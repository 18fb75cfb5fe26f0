"""Temporal upscaling of dim pictures, which are shown brighter than they are."""

from __future__ import annotations

from dataclasses import replace

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Frame, History
from gbufrt.luminance import luminance
from gbufrt.noise.noise import halton_jitter
from post import upscale
from post.passes.lens.upscale import DIM, toned_again
from post.upsampling.accumulate import light_around, same_light


def jittered(index: int) -> Frame:
    return boxes.frame(boxes.camera((30, 40)).with_jitter(halton_jitter(index, length=32)))


def toned(color: Tensor) -> Tensor:
    return color / (1 + luminance(color))


def averaged(factor: float, count: int = 6) -> tuple[Tensor, History]:
    first = jittered(0)
    light, state = upscale(first.read("radiance") * factor, first.gbuffer)
    for index in range(1, count):
        frame = jittered(index)
        light, state = upscale(frame.read("radiance") * factor, frame.gbuffer, state)
    return light, state


def test_they_have_the_edges_of_bright_ones():
    factor = DIM / float(luminance(jittered(0).read("radiance")).clamp_min(1e-4).log().mean().exp())
    (bright, _), (dim, state) = averaged(factor), averaged(factor / 6)
    assert float(state.signals["level"]) == pytest.approx(6.0, rel=0.01)
    torch.testing.assert_close(dim * 6, bright, rtol=2e-3, atol=1e-3)


def test_what_is_kept_dims_with_the_light():
    light = jittered(0).read("radiance")
    again = toned_again(toned(light), luminance(toned(light)), torch.tensor(3.0))
    torch.testing.assert_close(again, toned(light * 3))
    flat = jittered(0).gbuffer
    _, state = upscale(torch.ones_like(light), flat)
    found, state = upscale(torch.full_like(light, 0.02), flat, state)
    assert float(state.signals["level"]) == pytest.approx(3.0, rel=1e-3)
    torch.testing.assert_close(found, torch.full_like(found, 0.02), rtol=0.02, atol=0)


def test_noisy_light_that_goes_out_leaves_less_behind(monkeypatch: pytest.MonkeyPatch):
    """Noise widens the box to which a history is clipped, so that clipping alone leaves much of it."""

    def left() -> float:
        state, light, noise = None, torch.zeros(()), torch.Generator().manual_seed(3)
        for index in range(10):
            frame = jittered(index)
            sample = torch.empty(frame.gbuffer.depth.shape).exponential_(generator=noise)
            light, state = upscale((0.1 if index > 8 else 1.0) * sample.expand(-1, 3, -1, -1), frame.gbuffer, state)
        return float(light.mean()) - 0.1

    now = left()
    monkeypatch.setattr("post.passes.lens.upscale.same_light", lambda now, before, motion: torch.ones_like(now))
    assert 0 < now < 0.75 * left()


def test_light_that_comes_on_leaves_no_dark_edges():
    """Clipping holds a history to a box that is wide at edges, so that there the dark would stay for many frames."""
    state, last = None, jittered(16)
    for index in range(16):
        frame = jittered(index)
        _, state = upscale(torch.zeros_like(frame.read("radiance")), frame.gbuffer, state)
    lit = 0.03 * last.read("albedo")
    lit[..., : lit.shape[-1] // 2] *= 20  # exposure follows this half
    shown, anew = upscale(lit, last.gbuffer, state)[0], upscale(lit, last.gbuffer)[0]
    assert float((shown / anew)[:, :, 8:, 45:].min()) > 0.99


def test_few_bright_pixels_that_samples_miss_are_no_change():
    dark, still = torch.full((1, 3, 24, 32), 0.01), torch.zeros(1, 2, 24, 32)
    met = dark.clone()
    met[..., 12, 16] = 0.9
    for now, before in ((dark, met), (met, dark)):
        assert bool((same_light(light_around(now), light_around(before), still) == 1).all())
    assert not bool(same_light(light_around(3 * dark), light_around(dark), still).any())


def test_a_history_without_its_brightness_is_refused():
    """As one is that an older version kept."""
    frame = jittered(0)
    _, state = upscale(frame.read("radiance"), frame.gbuffer)
    older = replace(state, signals={name: kept for name, kept in state.signals.items() if name != "level"})
    with pytest.raises(ValueError, match=r"^history must hold 'level', got toned, planes, around"):
        upscale(frame.read("radiance"), frame.gbuffer, older)
