"""States handed to pipelines that they are not of are told by the name of the stage."""

from __future__ import annotations

import copy
import io
import pickle
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import boxes
import pytest
import torch

from gbufrt import Pipeline
from post import Reduced, Temporal

FRAME: Any = boxes.frame()
NEXT = FRAME.replace(index=1)


def accumulating(stride: int | None = None, **stages: Any) -> Pipeline:
    """One that accumulates light at every pixel, or every n-th."""
    reduction = None if stride is None else Reduced(stride)
    light = Pipeline(reduction=reduction, accumulate=Temporal(signal="radiance"), **stages)
    return Pipeline(light=light)


@pytest.mark.parametrize(("before", "now"), [(3, 2), (2, None), (None, 3)])
def test_a_state_of_another_preset_names_its_stage(before: int | None, now: int | None):
    _, state = accumulating(before)(FRAME)
    said = r"is of frames of \d+x\d+ pixels in a batch of 1, but it sees \d+x\d+ pixels .*; start with state=None"
    with pytest.raises(ValueError, match=r"^the state of stage 'light\.accumulate' " + said):
        accumulating(now)(NEXT, state)


def test_a_state_of_a_pass_is_none_of_a_pipeline():
    _, state = accumulating()(FRAME)
    _, flat = Pipeline(light=Temporal(signal="radiance"))(FRAME)
    with pytest.raises(TypeError, match=r"^the state of stage 'light' is of a pass, but the stage is a pipeline"):
        accumulating()(NEXT, flat)
    with pytest.raises(TypeError, match=r"^the state of stage 'light' is of a pipeline, but the stage is a pass"):
        Pipeline(light=Temporal(signal="radiance"))(NEXT, state)


def test_a_state_of_other_numbers_is_told():
    _, state = accumulating()(FRAME)
    with pytest.raises(ValueError, match=r"^the state is of frames of float32 on cpu, the frame has float64 on cpu"):
        accumulating()(NEXT.to(torch.float64), state)
    found, _ = accumulating()(NEXT.to(torch.float64), state.to(torch.float64))
    assert found.read("radiance").dtype == torch.float64


def test_stages_that_a_state_does_not_know_start_anew_and_those_it_alone_knows_are_let_go():
    one, two = accumulating(), accumulating(more=Temporal(signal="ambient"))
    frame = FRAME.replace(ambient=FRAME.radiance)
    _, state = one(frame)
    _, state = two(frame.replace(index=1), state)
    assert float(state.stages["light"].stages["accumulate"].length.max()) == 2
    assert float(state.stages["light"].stages["more"].length.max()) == 1
    _, state = one(frame.replace(index=2), state)
    assert set(state.stages["light"].stages) == {"accumulate"}


def test_a_state_of_none_of_the_stages_is_told():
    _, state = Pipeline(other=Temporal(signal="radiance"))(FRAME)
    with pytest.raises(ValueError, match=r"^the state is of a pipeline of other, but this one has light: start with"):
        accumulating()(NEXT, state)


def test_a_state_is_shown_in_a_line_for_each_history():
    _, state = accumulating()(FRAME)
    b, c, h, w = FRAME.radiance.shape
    head, row = repr(state).split("\n")
    assert head == f"PipelineState after frame 0: {w}x{h} pixels in a batch of {b}, float32 on cpu"
    assert row.startswith(f"  light.accumulate: History(mean length 1; signal {(b, c, h, w)}; ")
    handed = state.handed_over().stages["light"].stages["accumulate"]
    assert handed.take().length.numel()
    assert repr(handed) == "History(handed over)"


def two_frames(pipeline: Pipeline) -> Any:
    _, state = pipeline(FRAME)
    return pipeline(NEXT, state)[0].read("radiance")


def test_states_and_pipelines_can_be_copied_and_stored():
    pipeline = accumulating()
    want, (_, state) = two_frames(pipeline), pipeline(FRAME)
    stored = io.BytesIO()
    torch.save(state, stored)
    stored.seek(0)
    for copied in (copy.deepcopy(state), pickle.loads(pickle.dumps(state)), torch.load(stored)):
        assert torch.equal(pipeline(NEXT, copied)[0].read("radiance"), want)
    for other in (copy.deepcopy(pipeline), pickle.loads(pickle.dumps(pipeline))):
        assert torch.equal(two_frames(other), want)


def test_threads_may_share_a_pipeline():
    pipeline = accumulating()
    want = two_frames(pipeline)
    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(two_frames, [pipeline] * 8):
            assert torch.equal(found, want)
