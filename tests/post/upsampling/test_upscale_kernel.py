"""Compiled temporal upscaling against its torch reference."""

from __future__ import annotations

from functools import cache
from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Frame, History
from gbufrt.compute.dispatch import form_of
from gbufrt.noise.noise import halton_jitter
from post import upscale
from post.upsampling import upscale_op

SIZE = (23, 31)


def noise(size: tuple[int, ...], seed: int) -> Tensor:
    return torch.rand(size, generator=torch.Generator().manual_seed(seed))


@cache
def frame_at(index: int, size: tuple[int, int], *, orthographic: bool = False, sky: bool = False) -> Frame:
    """From a camera that moves past boxes, with light of its own."""
    lens = {"orthographic": orthographic}
    camera = boxes.camera(size, dx=0.07 * index, **lens).with_jitter(halton_jitter(index, length=32))
    before = boxes.camera(size, dx=0.07 * max(index - 1, 0), **lens)
    frame = boxes.frame(camera, previous=before, boxes=boxes.ROOM + 500 if sky else boxes.ROOM)
    return frame.replace(color=frame.read("radiance") * (0.2 + 3 * noise((1, 3, *size), index) ** 4))


def last_of(monkeypatch, compiled: bool, run: list[Frame], masks: dict[str, Tensor] | None = None, **tunables: float):
    """What a run leaves after its last frame; histories come from the reference until then."""
    result: tuple[Tensor, History | None] = torch.zeros(()), None
    given: dict[str, Any] = {**(masks or {}), **tunables}
    for index, frame in enumerate(run):
        kernel = compiled and index == len(run) - 1
        monkeypatch.setattr(upscale_op, "form_of", lambda *each, k=kernel, **_: form_of(*each, compiled=k))
        result = upscale(frame.read("color"), frame.gbuffer, result[1], **given)
    light, history = result
    assert history is not None
    return [light / (1 + light), history.signals["toned"], history.length, history.signals["planes"]]


def assert_close(got: list[Tensor], want: list[Tensor]) -> None:
    """All but one pixel in 500, which lie where a surface ends or a choice is close."""
    for one, other in zip(got, want, strict=True):
        off = ((one - other).abs() > 1e-4 * (1 + other.abs())).any(dim=1)
        assert float(off.float().mean()) <= 0.002


@pytest.mark.parametrize(
    "case", ["moving", "orthographic", "sky", "ratio 1.5", "reactive", "channels", "mirrored", "tunables"]
)
def test_forms_agree(monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    frames = [frame_at(i, SIZE, orthographic=case == "orthographic", sky=case == "sky") for i in range(8)]
    given = {"ratio 1.5": {"ratio": 1.5}, "moving": {"gamma": 0.3}}.get(case, {})
    if case == "tunables":
        given = {"gamma": 0.7, "frames": 5.0, "lock": 0.5, "stability": 3.0}
    several = case == "channels"
    masks = {"reactive": noise((1, 3 if several else 1, *SIZE), 9)} if several or case == "reactive" else {}
    masks |= {"mirrored": noise((1, 1, *SIZE), 9) ** 4} if case == "mirrored" else {}
    got, want = (last_of(monkeypatch, form, frames, masks, **given) for form in (True, False))
    assert_close(got, want)
    length, planes = want[2], want[3]
    if case == "moving":
        assert float(length.amin()) < 0.24 < 0.5 < float(length.median()), "some pixels hold this frame alone"
        assert float(planes[:, 2].amax()) > 0.5, "something is locked"
        assert float(planes[:, 1].amax()) > 0.01, "something is clipped"


@pytest.mark.parametrize("compiled", [True, False])
def test_light_of_pure_colours_never_falls_below_none(monkeypatch: pytest.MonkeyPatch, compiled: bool) -> None:
    """A box of luma and chroma around pure colours holds some that are less than no light."""
    pure = [torch.where(noise((1, 3, *SIZE), i) > 0.6, 4.0, 0.0) for i in range(6)]
    light, toned, *_ = last_of(monkeypatch, compiled, [frame_at(i, SIZE).replace(color=pure[i]) for i in range(6)])
    assert float(light.min()) >= 0
    assert float(toned.min()) >= 0


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (2, 3)])
def test_small_pictures(monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]) -> None:
    frames = [frame_at(i, size) for i in range(3)]
    got, want = (last_of(monkeypatch, form, frames) for form in (True, False))
    for one, other in zip(got, want, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-4)


def test_operator_is_registered_properly() -> None:
    shapes = (3, 4, 5), (1, 8, 9), (2, 6, 7), (13, 4, 5), (2, 4, 5), (3, 8, 10), (1, 8, 10), (6, 8, 10), (8, 10), (8, 8)
    operands = [*(torch.rand(1, *shape) for shape in shapes), torch.rand(1, 26)]
    settings = (False, 2.0, 32.0, 1.0, 1.0, 0.3)
    checks = ("test_schema", "test_faketensor")
    torch.library.opcheck(upscale_op.upscaled_cpu, (*operands, *settings), test_utils=checks)
