"""Flicker and ghosting on sequences whose answers are known."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.metrics.temporal import flicker, frames_seen, ghosting, seen_before


def path(count: int, step: float) -> list[GBuffer]:
    """A camera that moves sideways by ``step`` a frame."""
    cameras = [boxes.camera(dx=step * i) for i in range(count)]
    return [
        boxes.frame(now, previous=before).gbuffer
        for before, now in zip([cameras[0], *cameras[:-1]], cameras, strict=True)
    ]


def world_pattern(gbuffer: GBuffer) -> Tensor:
    """A smooth picture that sticks to the surfaces."""
    points = gbuffer.camera.to_world(gbuffer.points_view())
    return 0.5 + 0.2 * torch.sin(0.7 * points)


def test_still_frames_flicker_by_their_noise_alone():
    still = path(1, 0.0) * 3
    flat = torch.full((1, 3, 72, 96), 0.5)
    assert float(flicker([flat] * 3, still)) == 0.0
    noisy = [flat + 0.1 * (-1) ** i for i in range(3)]
    assert float(flicker(noisy, still)) == pytest.approx(0.2, rel=1e-5)


def test_flicker_follows_the_motion_and_forgives_what_the_truth_does():
    moving = path(4, 0.15)
    stuck = [world_pattern(g) for g in moving]
    screen = [stuck[0]] * 4  # stays on screen while the world moves on
    assert float(flicker(stuck, moving)) < 0.3 * float(flicker(screen, moving))
    assert float(flicker(stuck, moving, truth=stuck)) == 0.0
    noise = 0.2 * torch.randn(2, 4, *stuck[0].shape, generator=torch.Generator().manual_seed(0))
    halves = [(p + noise[0, i], p + noise[1, i]) for i, p in enumerate(stuck)]
    assert float(flicker(stuck, moving, truth=halves)) < 0.03  # where one half would say 0.2
    assert float(flicker(stuck, moving, truth=[half for half, _ in halves])) > 0.15
    pulse = [p * (1.0 + 0.3 * (i % 2)) for i, p in enumerate(stuck)]
    assert float(flicker(pulse, moving, truth=stuck)) > 0.08


def test_uncovered_pixels_are_found_and_age():
    moving = path(6, 0.3)
    assert bool(seen_before(moving[0], moving[0]).all())
    fresh = ~seen_before(moving[1], moving[0])
    share = float(fresh.float().mean())
    assert 0.005 < share < 0.2
    age = frames_seen(moving)
    assert float(age.min()) == 0.0
    assert float(age.max()) == 6.0
    assert torch.equal(age == 0, frames_seen(moving[-2:]) == 0)
    assert bool(((age > 0) & (age < 5)).any())  # what was uncovered a few frames ago


def test_ghosts_are_errors_where_something_was_uncovered():
    moving = path(6, 0.3)
    truth = world_pattern(moving[-1])
    assert float(ghosting(truth, truth, moving)) == 0.0
    new = frames_seen(moving) < 4
    trail = torch.where(new, truth + 0.25, truth)
    assert float(ghosting(trail, truth, moving)) == pytest.approx(0.25, rel=1e-4)
    noisy = torch.randn(2, *truth.shape, generator=torch.Generator().manual_seed(0))
    found = float(ghosting(trail, (truth + 0.5 * noisy[0], truth + 0.5 * noisy[1]), moving))
    assert found == pytest.approx(0.25, abs=0.03)  # where either half alone would say 0.56
    elsewhere = torch.where(new, truth, truth + 0.25)
    assert float(ghosting(elsewhere, truth, moving)) == 0.0
    assert float(ghosting(trail, truth, moving, fresh=trail)) == 0.0


def test_wrong_counts_are_named():
    moving = path(3, 0.1)
    with pytest.raises(ValueError, match="at least two"):
        flicker([torch.zeros(1, 3, 72, 96)], moving[:1])
    with pytest.raises(ValueError, match="at least 5"):
        ghosting(torch.zeros(1, 3, 72, 96), torch.zeros(1, 3, 72, 96), moving)
