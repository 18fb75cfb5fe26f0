"""Changes of light: followed where a surface as a whole shows them; a lone bright sample is none."""

from __future__ import annotations

import boxes
import torch

from post.filters.surfaces import surface
from post.history.changes import follow_changes, spread
from post.history.op import taken_in

SIZE = (48, 64)
G = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1]).gbuffer
AGE = 20.0
AT = (..., 24, 32)


def state(fast: torch.Tensor) -> torch.Tensor:
    """Twenty frames of light 1 with a variance of 1, and a fast history that shows ``fast``, in three channels."""
    one = torch.ones_like(G.depth)
    return torch.cat([one, one, one, fast, fast, fast, fast, fast**2 + 1, one / AGE, AGE * one], dim=1)


def follow(sample: float, fast: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """The sample, the slow history and its age after the test."""
    light = torch.full_like(G.normal, sample)
    light[AT] = 5000.0
    return after(light, state(fast), firefly=2.5)


def after(light: torch.Tensor, before: torch.Tensor, firefly: float) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """The sample, the slow history as it follows, and what is left of its age."""
    sample = taken_in(light, before, lead=3, firefly=firefly)
    changes = follow_changes(sample, before, G, lead=3, clamp=1.5)
    slow, explained = changes.slow.split([3, 1], dim=1)
    assert float((before[:, 3:6] + changes.fast).min()) >= 0
    return sample.signal, before[:, :3] + slow, 1 + (before[:, -1:] - 1) * explained


def test_a_change_of_all_light_is_followed_and_one_bright_spot_is_not():
    spot = torch.ones_like(G.depth)
    spot[AT] = 3.0
    kept, slow, age = follow(1.0, spot)
    assert float(kept[AT].max()) < 10.0
    assert torch.equal(age, torch.full_like(age, AGE))
    assert torch.equal(slow, torch.ones_like(slow))
    _, slow, age = follow(0.1, torch.full_like(G.depth, 0.2))
    hit = G.hit & (torch.arange(SIZE[0])[:, None] < SIZE[0] - 4)
    assert float(age[hit].mean()) < 5.0
    assert float(slow[hit.expand_as(slow)].mean()) < 0.4


def test_a_change_stays_on_its_surface():
    g = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM).gbuffer
    up = (g.normal[:, 1:2].abs() > 0.9) & g.hit
    others = g.hit & ~up
    assert min(int(up.sum()), int(others.sum())) > 200
    light, left = spread(up.to(g.depth), torch.ones_like(g.depth), surface(g.depth, g.normal, g.hit, g.camera), 4)
    assert float(light[up].min()) > 0.95
    assert float(light[others].max()) < 0.05
    assert float(left[g.hit].mean()) < 0.01


def test_what_is_dark_beside_a_highlight_that_has_moved_on_stays_light():
    """The mean change of the surface is far more than a dark pixel holds; it would become negative."""
    bright = torch.ones_like(G.depth)
    bright[..., ::4, ::4] = 60.0
    before = state(torch.full_like(bright, 0.1))
    before[:, :3] = bright
    before[:, 6:8] = torch.cat([bright, bright**2 + 0.01 * bright], dim=1)
    _, slow, _ = after(torch.full_like(G.normal, 0.1), before, firefly=0.0)
    hit = G.hit.expand_as(G.normal)
    assert float((slow - bright)[hit].mean()) < -1.0
    assert float(slow.min()) >= 0.0
