"""The compiled histories against their torch reference."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from post.history.changes import differences, differences_cpu, unexplained, unexplained_cpu
from post.history.op import blend_cpu, blended, sample_cpu, taken_in
from post.history.read import read_history, read_history_cpu

SIZE = (45, 61)
FORMS = (True, False)


def noise(channels: int, seed: int = 0) -> Tensor:
    return torch.rand((1, channels, *SIZE), generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("search", [True, False])
@pytest.mark.parametrize("sharp", [True, False])
@pytest.mark.parametrize("lenient", [True, False])
@pytest.mark.parametrize("orthographic", [True, False])
def test_read_history(search: bool, sharp: bool, lenient: bool, orthographic: bool) -> None:
    camera, before = (
        boxes.camera(SIZE, dx=0.35, orthographic=orthographic),
        boxes.camera(SIZE, orthographic=orthographic),
    )
    now, then = boxes.frame(camera, previous=before).gbuffer, boxes.frame(before).gbuffer
    assert then.object_id is not None
    decal = torch.arange(SIZE[1]).expand_as(then.object_id) % 20 < 5  # another object in the same plane
    then = then.replace(object_id=torch.where(decal, 999, then.object_id))
    options = {"length": (noise(1) > 0.1).float(), "search": search, "sharp": sharp, "lenient": lenient}
    got, want = (read_history(now, then, noise(3), **options, compiled=form) for form in FORMS)
    torch.testing.assert_close(got.image, want.image, rtol=1e-5, atol=2e-6)
    torch.testing.assert_close(got.support, want.support, rtol=1e-5, atol=1e-6)
    assert torch.equal(got.valid, want.valid)
    assert torch.equal(got.lent, want.lent)
    assert bool(want.lent.any()) == (search and lenient)
    assert 0.3 < float(want.valid.float().mean()) < 1.0, "some surfaces are new"


@pytest.mark.parametrize("width", [30, 150])
def test_what_is_not_wanted_has_no_history(width: int) -> None:
    size = (23, width)
    now, then = boxes.frame(boxes.camera(size, dx=0.2)).gbuffer, boxes.frame(boxes.camera(size)).gbuffer
    image = torch.rand(1, 3, *size, generator=torch.Generator().manual_seed(3))
    wanted = image[:, :1] > 0.5
    wanted[..., :5, :], wanted[..., width // 3 :] = False, False  # whole rows, and most of all
    every = read_history(now, then, image)
    got, want = (read_history(now, then, image, wanted=wanted, compiled=form) for form in FORMS)
    for a, b, of_all in zip(got, want, every, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-5, atol=2e-6)
        torch.testing.assert_close(a, torch.where(wanted, of_all, torch.zeros_like(of_all)), rtol=0, atol=0)
    assert got.valid.any()
    assert not bool(got.valid[~wanted].any())


def test_read_history_far_outside_and_without_motion() -> None:
    g = boxes.frame(boxes.camera(SIZE)).gbuffer
    motion = torch.zeros(1, 2, *SIZE)
    motion[..., :9], motion[..., 9:20], motion[..., 20:30] = torch.inf, -1e30, torch.nan
    got, want = (read_history(g, g, noise(2), motion=motion, compiled=form) for form in FORMS)
    torch.testing.assert_close(got.image, want.image)
    assert torch.equal(got.valid, want.valid)
    assert not want.valid[..., :20].any()


@pytest.mark.parametrize("case", ["jittered", "nothing but depth", "another view"])
def test_what_is_looked_for(case: str) -> None:
    camera, before = (boxes.camera(SIZE, dx=dx) for dx in (0.35, 0.0))
    if case == "jittered":
        camera, before = camera.with_jitter((0.3, -0.4)), before.with_jitter((-0.2, 0.1))
    now, then = boxes.frame(camera, previous=before).gbuffer, boxes.frame(before).gbuffer
    bare = {"normal_geo": None, "motion": None, "motion_z": None, "object_id": None}
    now = now.replace(**bare) if case == "nothing but depth" else now
    length = (noise(1) > 0.1).float() if case == "another view" else None
    motion = 9 * noise(2).round(decimals=1) - 4 if case == "another view" else None
    given = {"length": length, "motion": motion, "plane_tolerance": 1.0}
    got, want = (read_history(now, then, noise(3), **given, compiled=form) for form in FORMS)
    torch.testing.assert_close(got.image, want.image, rtol=1e-5, atol=5e-6)
    torch.testing.assert_close(got.support, want.support, rtol=1e-5, atol=2e-6)
    assert torch.equal(got.valid, want.valid)
    assert 0.2 < float(want.valid.float().mean()) < 1.0


def state_of(lead: int, signal: Tensor) -> Tensor:
    """Histories of every age, some of which the signal agrees with."""
    mean = signal * (0.8 + 0.4 * noise(signal.shape[1], 1))
    fast = signal[:, :lead] * (0.9 + 0.2 * noise(lead, 2))
    first = signal[:, :1] * 0.9
    moments = torch.cat([first, first * first + 0.01 * noise(1, 3)], dim=1)
    age = torch.floor(12 * noise(1, 4))
    return torch.cat([mean, fast, moments, 1 / age.clamp_min(1.0), age], dim=1)


@pytest.mark.parametrize("lead", [1, 3])
@pytest.mark.parametrize("clamp", [2.0, 0.0])
@pytest.mark.parametrize("firefly", [6.0, 0.0])
def test_accumulate(lead: int, clamp: float, firefly: float) -> None:
    signal = 0.5 + 0.1 * noise(4)
    signal[..., 20:, :] *= 2.0  # the light has changed
    state = state_of(lead, 0.5 + 0.1 * noise(4))
    signal[..., ::7, ::5] *= 4.0  # fireflies, not so bright that rounding shows in what they leave
    longest = 4 + 8 * noise(1)
    got, want = (accumulated(signal, state, longest, lead, clamp, firefly, form) for form in FORMS)
    for a, b in zip(got, want, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-5)
    assert (float((want[1] - signal).abs().max()) > 1) == (firefly > 0), "fireflies are cut"
    younger = want[0][:, -1:] < torch.minimum(state[:, -1:] + 1, longest) - 0.01
    assert bool((younger & (state[:, -1:] > 0)).any()) == (clamp > 0), "changed light makes histories younger"


def accumulated(
    signal: Tensor, state: Tensor, longest: Tensor, lead: int, clamp: float, firefly: float, compiled: bool
) -> tuple[Tensor, ...]:
    """The state after a frame, and all that is found on the way."""
    options = {"lead": lead, "compiled": compiled}
    sample, changes = taken_in(signal, state, firefly=firefly, **options), []
    for slow in (False, True) if clamp > 0 else ():
        found = differences(sample, state, changes[0] if slow else None, **options)
        averaged = torch.cat([found[:, :lead], found[:, lead:] / 9], dim=1)
        changes += [unexplained(averaged, state, clamp=clamp, slow=slow, **options), found]
    moves = (changes[0], changes[2]) if changes else None
    return (blended(sample.signal, state, longest, moves, **options), *sample, *changes)


def test_gradients_take_the_reference() -> None:
    g = boxes.frame(boxes.camera(SIZE)).gbuffer
    image = noise(3).requires_grad_()
    read_history(g, g, image).image.sum().backward()
    assert image.grad is not None
    assert float(image.grad.abs().sum()) > 0


def test_operators_are_registered_properly() -> None:
    g, checks = boxes.frame(boxes.camera(SIZE)).gbuffer, ("test_schema", "test_faketensor")
    signal, one, none, lenses = noise(4), noise(1), torch.empty(1, 1, 0, 0, dtype=torch.int32), torch.ones(1, 2, 6)
    look = ([one, noise(3), g.hit, none, noise(2), one, noise(2), g.hit], [one, noise(3), g.hit, none, one], lenses)
    options = (torch.eye(3)[None], False, 2.0, 0.9, True, False)
    torch.library.opcheck(read_history_cpu, (signal, *look, *options), test_utils=checks)
    state = state_of(3, signal)
    torch.library.opcheck(sample_cpu, (signal, state, 3, 6.0), test_utils=checks)
    torch.library.opcheck(differences_cpu, (signal, one, state, noise(3), 3), test_utils=checks)
    torch.library.opcheck(unexplained_cpu, (noise(4), state, 3, 2.0, True), test_utils=checks)
    torch.library.opcheck(blend_cpu, (signal, state, one, noise(3), noise(4), 3), test_utils=checks)
