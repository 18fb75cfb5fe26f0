"""How often the host waits for a GPU in a steady frame, counted without one by a stand-in."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from gpu_stand_in import GPU, gpu
from torch import Tensor

from gbufrt import Pipeline
from gbufrt.compute.resident import number, numbers, places, resident, sent
from gbufrt.specimen import specimen
from post import me1, minecraft_rtx, with_fog

PIPELINES: dict[str, Callable[[], Pipeline]] = {
    "low": lambda: me1("low"),
    "high": lambda: me1("high"),
    "fog": lambda: with_fog(me1("low")),
    "minecraft-rtx": lambda: minecraft_rtx("high"),
    "minecraft-rtx of paths": lambda: minecraft_rtx("high", denoiser="denoise"),
}


@pytest.mark.parametrize(
    ("kind", "captured"),
    [("low", False), ("high", True), ("fog", True), ("minecraft-rtx", True), ("minecraft-rtx of paths", False)],
)
def test_a_steady_frame(kind: str, captured: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """In frames that a graph may capture, their number lies on the GPU."""
    pipeline, frame = PIPELINES[kind](), specimen()
    with torch.no_grad():
        _, first = pipeline(frame)
        _, second = pipeline(frame.replace(index=1), first)
        want, _ = pipeline(frame.replace(index=2), second)
    with gpu(monkeypatch) as seen:
        there = frame.to(GPU)
        index = torch.arange(4, device=GPU).unbind() if captured else range(4)
        _, start = pipeline(there.replace(index=index[0]))  # constants are copied
        _, second = pipeline(there.replace(index=index[1]), start)
        seen.clear()
        result, third = pipeline(there.replace(index=index[2]), second)
        waits, launches = dict(seen.waits), list(seen.launches)
        dark = there.replace(index=index[3]).write("radiance", there.read("radiance").flip(3) * 0.1)
        found = result.read("image").cpu()
        seen.clear()
        pipeline(dark, third)
        changed = [pair for pair in zip(launches, seen.launches, strict=True) if pair[0] != pair[1]]
    assert waits == {}
    assert not changed, "a frame launches the same whatever it shows, as a CUDA graph does"
    assert (found - want.read("image")).abs().mean() < 1e-3, "what a GPU does unasked changes nothing"


@pytest.mark.parametrize("preset", ["low", "high"])
def test_a_number_in_a_tensor_makes_the_same_frame(preset: str) -> None:
    pipeline, frame = me1(preset), specimen()
    with torch.no_grad():
        _, state = pipeline(frame)
        want, other, found = (pipeline(frame.replace(index=i), state)[0] for i in (7, 8, torch.tensor(7)))
    assert all(torch.equal(found.read(name), want.read(name)) for name in want.present)
    assert not torch.equal(other.read("composite"), want.read("composite"))


WAITING: dict[str, Callable[[Tensor], object]] = {
    "a number": lambda x: float(x.sum()),
    "a choice": lambda x: bool((x > 0).any()),
    "a list": lambda x: x[0].tolist(),
    "a copy": lambda x: x.cpu(),
    "constants": lambda x: torch.tensor([1.0, 2.0], device=x.device),
    "constants like": lambda x: x.new_tensor([1.0, 2.0]),
    "a number from the host": lambda x: torch.as_tensor(2.0, device=x.device),
    "a mask": lambda x: x[x > 0],
    "an inverse": lambda x: torch.linalg.inv(x[:, :2]),
    "indices of the host": lambda x: x[:, [0, 1]],
    "a copy of page-locked memory, waited for": lambda x: torch.ones(2).pin_memory().to(x.device),
}
NOT_WAITING: dict[str, Callable[[Tensor], object]] = {
    "made there": lambda x: torch.zeros_like(x) + torch.arange(3, device=x.device),
    "chosen there": lambda x: torch.where(x > 0, x, 0.0).masked_fill(x > 1, 0.0),
    "indexed there": lambda x: x[torch.arange(2, device=x.device)],
    "a mask's places": lambda x: x.index_put(places(x > 0), x.new_zeros(())),
    "sent": lambda x: sent(torch.ones(2), x) + 1,
    "kept": lambda x: (resident((1.0, 2.0), x), resident((1.0, 2.0), x)),
    "filled in": lambda x: (number(3.0, x), numbers(((1.0, 2.0), (3.0, 4.0)), x)),
}


@pytest.mark.parametrize("what", WAITING)
def test_what_waits_is_counted(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with gpu(monkeypatch) as seen:
        there = torch.eye(2, 3).to(GPU)
        seen.clear()
        WAITING[what](there)
        assert seen.waits.total() == 1


@pytest.mark.parametrize("what", NOT_WAITING)
def test_what_does_not_wait_is_not(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with gpu(monkeypatch) as seen:
        there = torch.eye(2, 3).to(GPU)
        resident((1.0, 2.0), there)
        seen.clear()
        NOT_WAITING[what](there)
        assert seen.waits.total() == 0
        assert seen.launches or what == "kept"


def test_tensors_on_two_devices_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with gpu(monkeypatch):
        there = torch.zeros(3).to(GPU)
        with pytest.raises(RuntimeError, match="two devices"):
            torch.add(there, torch.zeros(3))
