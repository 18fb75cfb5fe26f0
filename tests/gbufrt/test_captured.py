"""Captured pipelines: what is replayed is what the pipeline itself makes of the same frames.

Without a GPU the step that would be captured is repeated by the host; with one, the same tests run on it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import boxes
import pytest
import torch

from gbufrt import Captured, Frame, Pipeline, captured
from post import me1

GPU = torch.cuda.is_available()
DEVICE = "cuda" if GPU else "cpu"
SIZE = (24, 32)
if GPU:
    pytest.importorskip("numba_cuda")


@pytest.fixture(autouse=True)
def _repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    if not GPU:
        monkeypatch.setattr(captured, "_recordable", lambda like: True)
        monkeypatch.setattr(captured, "_record", lambda step, like: step)


def frames(count: int, *, apart: float = 0.1) -> Iterator[Frame]:
    """A camera that moves past boxes while the light grows."""
    before = boxes.camera(SIZE)
    for n in range(count):
        camera = boxes.camera(SIZE, dx=apart * n)
        frame = boxes.frame(camera)
        motion, motion_z = camera.static_motion(before, frame.gbuffer.depth, frame.gbuffer.hit)
        g = frame.gbuffer.replace(previous_camera=before, motion=motion, motion_z=motion_z)
        light = frame.read("radiance") * (1 + 0.3 * n)
        yield frame.replace(gbuffer=g, radiance=light, index=n, time=n / 10).to(DEVICE)
        before = camera


def pipeline() -> Pipeline:
    """Its exposure adapts in time, its noise changes with the index, and its histories follow motion.

    Without FXAA, which takes a rounding for an edge: times differ by one, as they lie in a tensor when captured.
    """
    return me1("low", tunables={"pulse.strength": 0.4, "motion_blur.target_frame_time": 0.05}).without("fxaa")


def apart(found: Frame, want: Frame) -> float:
    return float((found.read("image") - want.read("image")).abs().max())


def test_replayed_frames_are_those_of_the_pipeline() -> None:
    *_, last = frames(9)
    ours, want = Captured(pipeline(), last), list(pipeline().stream(frames(5)))
    found = [result.read("image").clone() for result in ours.stream(frames(5))]
    for one, other in zip(found, want, strict=True):
        torch.testing.assert_close(one, other.read("image"), atol=1e-5, rtol=0)
    assert (found[4] - found[3]).abs().mean() > 1e-3


def test_results_carry_the_frame_s_own_numbers() -> None:
    given = list(frames(2))
    results = Captured(pipeline(), given[0]).stream(given)
    assert [(result.index, result.time) for result in results] == [(0, 0.0), (1, 0.1)]


def test_reset_forgets() -> None:
    given = list(frames(3))
    ours, (want, _) = Captured(pipeline(), given[0]), pipeline()(given[2])
    for frame in given:
        ours(frame)
    assert apart(ours(given[2]), want) > 1e-3, "the history shows"
    ours.reset()
    assert apart(ours(given[2]), want) < 1e-5


def test_a_cut_forgets_without_the_graph() -> None:
    first, second, third = frames(3)
    cut = second.replace(cut=torch.ones(1, dtype=torch.bool, device=DEVICE))
    ours, want = Captured(pipeline(), first), list(pipeline().stream([first, cut, third]))
    found = [result.read("image").clone() for result in ours.stream([first, cut, third])]
    for one, other in zip(found, want, strict=True):
        torch.testing.assert_close(one, other.read("image"), atol=1e-5, rtol=0)


def test_the_given_frame_and_the_pipeline_stay_as_they_are() -> None:
    given = list(frames(2))
    light = given[0].read("radiance").clone()
    for _ in Captured(pipeline(), given[0]).stream(given):
        pass
    assert torch.equal(given[0].read("radiance"), light)


OTHER: dict[str, tuple[Callable[[Frame], Frame], str]] = {
    "size": (lambda frame: boxes.frame(boxes.camera((16, 32))).to(DEVICE), "size|shape|as captured"),
    "channel": (lambda frame: frame.replace(ambient=None), r"frame\.ambient must be a tensor as captured, got None"),
    "constant": (
        lambda frame: frame.replace(emitters_sampled=False),
        "frame.emitters_sampled must be True as captured",
    ),
    "extra": (lambda frame: frame.write("more", frame.read("radiance")), "frame.extra"),
}


@pytest.mark.parametrize("what", OTHER)
def test_frames_of_another_form_are_refused(what: str) -> None:
    frame = next(frames(1))
    frame = frame if frame.ambient is not None else frame.replace(ambient=frame.read("radiance"))
    change, told = OTHER[what]
    ours = Captured(pipeline(), frame)
    with pytest.raises(ValueError, match=told):
        ours(change(frame))


def test_wrong_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    frame = next(frames(1))
    with pytest.raises(TypeError, match="pipeline must be a Pipeline, got function"):
        Captured(pipeline, frame)  # pyright: ignore[reportArgumentType]
    monkeypatch.undo()
    passes = pipeline()
    monkeypatch.setattr(passes, "forward", lambda *given, **options: pytest.fail("refused before it runs"))
    with pytest.raises(ValueError, match="frame must be on a GPU to be captured, but is on cpu"):
        Captured(passes, frame.to("cpu"))
