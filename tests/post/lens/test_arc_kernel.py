"""Motion turned onto the arcs of what spins: what it does, and the compiled form against the torch reference."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from post.lens.arc_op import turned, turned_cpu


def places(size: tuple[int, int]) -> tuple[Tensor, Tensor]:
    y, x = torch.meshgrid(*(torch.arange(n) - n / 2 for n in size), indexing="ij")
    return x, y


def spin(angle: float, size: tuple[int, int]) -> Tensor:
    """``(1, 2, H, W)``: previous minus current where all turns by ``angle`` radians a frame."""
    (x, y), cosine, sine = places(size), math.cos(angle), math.sin(angle)
    return torch.stack([cosine * x + sine * y - x, cosine * y - sine * x - y])[None]


def arrives(motion: Tensor, angle: float, share: float) -> Tensor:
    """How far from its arc a straight path leads in a share of a frame, as a share of the way, at its worst pixel."""
    true = spin(angle * share, (41, 31))
    return ((motion * share - true).norm(dim=1) / true.norm(dim=1).clamp_min(0.1)).max()


@pytest.mark.parametrize("angle", [0.6, -0.2])
def test_paths_of_what_spins_follow_its_arcs(angle: float) -> None:
    chords = spin(angle, (41, 31))
    for share in (0.02, -0.02):
        found, before = (float(arrives(motion, angle, share)) for motion in (turned(chords), chords))
        assert found < 0.02 < 0.2 * abs(angle) < before


def test_what_glides_past_goes_straight() -> None:
    """Ground under a camera that moves to its side is sheared: its motion grows from row to row, along the rows."""
    _, y = places((41, 31))
    ground = torch.stack([0.3 * (y + 30), torch.zeros_like(y)])[None]
    zoom = 0.2 * torch.stack(places((41, 31)))[None]
    step = torch.where(places((41, 31))[0] > 0, 7.0, 6.5).expand(1, 2, -1, -1)
    for motion in (ground, zoom, step, torch.full((1, 2, 41, 31), 9.0)):
        torch.testing.assert_close(turned(motion), motion, rtol=1e-6, atol=1e-5)


def test_each_body_turns_by_itself() -> None:
    """A wheel before a wall: its rim, which only has neighbours to one side, turns as the rest, and the wall not."""
    x, y = places((60, 60))
    wheel, chords = torch.hypot(x, y) < 20, spin(0.5, (60, 60))
    found = turned(torch.where(wheel, chords, 0.0))
    assert torch.equal(found[..., ~wheel], torch.zeros(1, 2, int((~wheel).sum())))
    off = (found - spin(0.01, (60, 60)) / 0.01 * 0.5).norm(dim=1)[0][wheel]
    assert float(off.max()) < 0.3
    assert float((chords - spin(0.01, (60, 60)) / 0.01 * 0.5).norm(dim=1)[0][wheel].max()) > 2.0


@pytest.mark.parametrize("size", [(31, 17), (1, 1), (1, 9), (9, 1), (2, 2), (40, 300)], ids=str)
def test_forms_agree(size: tuple[int, int]) -> None:
    noise = torch.rand(2, 2, *size, generator=torch.Generator().manual_seed(1))
    motion = torch.cat([spin(0.5, size), 5 + noise[:1]]) + 0.2 * noise
    got, want = (turned(motion, compiled=form) for form in (True, False))
    torch.testing.assert_close(got, want, rtol=1e-5, atol=1e-4)
    assert max(size) < 30 or float((want - motion).abs().mean()) > 0.1
    torch.library.opcheck(turned_cpu, (motion,), test_utils=("test_schema", "test_faketensor"))


def test_gradients() -> None:
    noise = torch.rand(1, 2, 5, 7, generator=torch.Generator().manual_seed(1))
    motion = (spin(0.3, (5, 7)) + 0.05 * noise).double().requires_grad_()
    assert torch.autograd.gradcheck(turned, motion, eps=1e-6, atol=1e-4)
