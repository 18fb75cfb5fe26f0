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


def test_a_history_without_its_brightness_is_refused():
    """As one is that an older version kept."""
    frame = jittered(0)
    _, state = upscale(frame.read("radiance"), frame.gbuffer)
    older = replace(state, signals={name: kept for name, kept in state.signals.items() if name != "level"})
    with pytest.raises(ValueError, match=r"^history must hold 'level', got toned, planes, around"):
        upscale(frame.read("radiance"), frame.gbuffer, older)
