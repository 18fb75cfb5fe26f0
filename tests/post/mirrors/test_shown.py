"""Mirrors whose direct light holds sky and lamps already, as that of path tracers does."""

from __future__ import annotations

import torch
from mirrors import shiny

from gbufrt import Frame
from post.mirrors.shown import shown_already
from post.passes.light.ssr import SSR


def half_sky(level: float = 0.2, lamp: float = 30.0) -> Frame:
    """Mirrors all over, whose rays meet the sky in the left half of the picture, with a lamp in it."""
    frame = shiny().replace(emitters_mirrored=True)
    light = torch.zeros_like(frame.read("radiance"))
    width = light.shape[-1] // 2
    light[..., :width] = level
    light[..., 5:7, 5:7] = lamp
    return frame.replace(radiance=torch.where(frame.gbuffer.hit, light, 0.1))


def test_what_shows_the_sky_reflects_nothing_else():
    """But for what is found on screen: light of some renderers holds the sky in mirrors as if nothing hid it."""
    frame = half_sky()
    known, result = shown_already(frame), SSR(samples=1)(frame)
    reflection, found = result.read("reflection"), result.read("reflection_confidence")
    lit = frame.gbuffer.hit & (frame.read("radiance")[:, :1] > 0)
    assert float(known[lit].median()) == 1.0
    assert float(known[~lit].max()) == 0.0
    guessed = SSR(samples=1)(frame.replace(emitters_mirrored=False)).read("reflection")
    assert float(guessed.mean(1, keepdim=True)[lit].mean()) > 0.01
    assert float(reflection.amax(1, keepdim=True)[lit & (known == 1) & (found == 0)].max()) == 0.0
    seen = lit & (found == 1)
    assert bool(seen.any())
    torch.testing.assert_close(reflection * seen, guessed * seen)
    torch.testing.assert_close(reflection * (~lit), guessed * (~lit))


def test_what_filters_leave_of_the_sky_is_none():
    frame = half_sky()
    width = frame.read("radiance").shape[-1] // 2
    faint = frame.read("radiance").clone()
    faint[..., width:] += 0.01
    assert float(shown_already(frame.replace(radiance=faint))[..., width + 1 :].max()) == 0.0


def test_rough_metals_and_others_tell_nothing():
    """Their direct light may be that of lamps on their surface."""
    frame = half_sky()
    g = frame.gbuffer
    rough, plain = (g.replace(roughness=torch.full_like(g.depth, 0.1)), g.replace(metallic=torch.zeros_like(g.depth)))
    for other in (rough, plain):
        assert float(shown_already(frame.replace(gbuffer=other)).max()) == 0.0
