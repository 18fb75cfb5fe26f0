"""Stills: `Pipeline.settle` fills their history as the frames before would have; an index that repeats is told."""

from __future__ import annotations

import warnings

import boxes
import pytest
import torch
import torch.nn.functional as F

from gbufrt import Frame, History, Pass, Pipeline, TemporalPass
from gbufrt.frame import REPLAYED
from gbufrt.noise.noise import blue_noise
from post import SSR, EstimateMissing, Temporal


class Noise(Pass):
    """Writes the frame's noise as AO, and how long its motion is."""

    reads, writes = frozenset({"depth", "motion"}), frozenset({"ao", "moved"})

    def forward(self, frame: Frame) -> Frame:
        noise = blue_noise(*frame.gbuffer.camera.size, index=frame.index)[None]
        return frame.replace(ao=noise).write("moved", frame.read("motion").norm(dim=1, keepdim=True))


class Mean(TemporalPass):
    """The mean of AO over all frames so far."""

    reads, writes = frozenset({"ao"}), frozenset({"ao", "runs"})

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        ao = frame.read("ao")
        length = torch.ones_like(ao) if state is None else state.length + 1
        mean = ao if state is None else state.signals["ao"] + (ao - state.signals["ao"]) / length
        return frame.replace(ao=mean).write("runs", length), History(length=length, signals={"ao": mean})


def moving(index: int = 1) -> Frame:
    frame = boxes.frame(boxes.camera((16, 24)), previous=boxes.camera((16, 24), dx=0.3), index=index)
    return frame.replace(behind=frame)


PIPELINE = Pipeline(noise=Noise(), mean=Mean())


def test_a_still_takes_the_noise_of_the_frames_before():
    frame = moving(index=1)
    result, state = PIPELINE.settle(frame, 4)
    mean = torch.stack([blue_noise(16, 24, index=index) for index in (-2, -1, 0, 1)]).mean(0)
    assert torch.allclose(result.read("ao")[0], mean, atol=1e-6)
    assert result.index == 1
    after, _ = PIPELINE(frame.replace(index=2), state)
    assert after.read("runs").unique().tolist() == [5.0]


def test_a_still_converges_and_the_same_index_again_does_not():
    frame, state = moving(), None
    settled = PIPELINE.settle(frame, 32)[0].read("ao").std()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(32):
            _, state = PIPELINE(frame, state)
    assert state is not None
    assert float(settled) < 0.1 * float(state.stages["mean"].signals["ao"].std())


class Blurred(Pass):
    """Noise as filters leave it: alike in pixels that lie side by side."""

    reads, writes = frozenset({"depth"}), frozenset({"ao"})

    def forward(self, frame: Frame) -> Frame:
        noise = torch.randn(frame.gbuffer.depth.shape, generator=torch.Generator().manual_seed(int(frame.index)))
        return frame.replace(ao=0.5 + F.avg_pool2d(noise, 9, stride=1, padding=4, count_include_pad=False))


def test_noise_that_filters_have_spread_is_not_taken_for_changes_of_light_in_a_still():
    """Over an area it is as great as in a pixel, and histories that follow it do not converge."""
    pipeline, frame = Pipeline(noise=Blurred(), mean=Temporal(signal="ao")), boxes.frame(boxes.camera((48, 64)))
    hit = frame.gbuffer.hit
    errors = [pipeline.settle(frame, runs)[0].read("ao")[hit].sub(0.5).square().mean().sqrt() for runs in (1, 16)]
    assert float(errors[1]) < 0.3 * float(errors[0])
    assert pipeline.settle(frame, 2)[0].steady is False


def test_passes_see_no_motion_and_the_result_has_its_own():
    frame = moving()
    assert float(frame.read("motion").norm(dim=1).max()) > 1
    result, _ = PIPELINE.settle(frame)
    assert float(result.read("moved").max()) == 0
    assert result.behind is not None
    for layer in (result, result.behind):
        assert layer.gbuffer.previous_camera is frame.gbuffer.previous_camera
        assert torch.equal(layer.read("motion"), frame.read("motion"))


def test_every_run_is_told_and_there_is_at_least_one():
    ticks = []
    PIPELINE.settle(moving(), 3, tick=lambda: ticks.append(1))
    assert len(ticks) == 3
    with pytest.raises(ValueError, match="runs must be at least 1, got 0"):
        PIPELINE.settle(moving(), 0)


def test_an_index_that_repeats_is_told():
    frame = moving()
    _, state = PIPELINE(frame)
    with pytest.warns(UserWarning, match=r"frame index 1 repeats.*pipeline\.settle") as told:
        PIPELINE(frame, state)
    assert told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PIPELINE(frame.replace(index=2), state)
        PIPELINE(frame.replace(cut=torch.tensor([True])), state)


def test_what_is_left_out_for_want_of_an_input_is_told_once():
    frame = boxes.frame(boxes.camera((8, 8)))
    mirrors, bare = Pipeline(mirrors=Pipeline(estimate=SSR(samples=1))), frame.replace(environment=None)
    with pytest.warns(
        UserWarning, match=r"^mirrors\.estimate: mirrors guess the sky.*no environment: give the Frame"
    ) as told:
        _, state = mirrors(bare)
    assert [warning.filename for warning in told] == [__file__]
    assert "metals" not in str(told[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mirrors(bare.replace(index=1), state)
        Pipeline(mirrors=SSR(samples=1))(frame)
    plain = bare.replace(gbuffer=frame.gbuffer.replace(metallic=None))
    with pytest.warns(UserWarning, match=r"mirrors guess the sky.*; estimate: metals mirror.*no metallic"):
        Pipeline(estimate=SSR(samples=1))(plain)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Pipeline(missing=EstimateMissing(), mirrors=SSR(samples=1))(plain.replace(environment=frame.environment))


def test_a_still_has_no_replayed_samples():
    frame = moving()
    again = dict(zip(REPLAYED, (frame.read(name) for name in ("depth", "normal", "normal")), strict=True))
    frame = frame.replace(**again, behind=frame.replace(**again))
    still = frame.still()
    back = still.moving_as(frame)
    assert still.behind is not None
    assert back.behind is not None
    for name in REPLAYED:
        assert still.get(name) is None
        assert still.behind.get(name) is None
        assert torch.equal(back.read(name), frame.read(name))
        assert back.behind.get(name) is not None
