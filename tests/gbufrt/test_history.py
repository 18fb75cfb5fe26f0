"""States: one that is handed over is let go of stage by stage; gradients reach past frames where asked."""

from __future__ import annotations

import weakref

import boxes
import pytest
import torch

from gbufrt import Frame, History, Pass, Pipeline, PipelineState, TemporalPass
from gbufrt.tree import map_tensors
from post import temporal


class Remembers(TemporalPass):
    """Keeps a plane from frame to frame, and notes which planes it has kept."""

    reads, writes = frozenset({"depth"}), frozenset({"count"})

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[weakref.ref[torch.Tensor]] = []

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        length = torch.ones_like(frame.gbuffer.depth) if state is None else state.length + 1
        self.kept.append(weakref.ref(length))
        return frame.write("count", length.clone()), History(length=length)


class Counts(Pass):
    """Writes how many of the planes that another pass has kept are still in memory."""

    reads, writes = frozenset({"count"}), frozenset({"alive"})

    def __init__(self, other: Remembers) -> None:
        super().__init__()
        self._other = [other]

    def forward(self, frame: Frame) -> Frame:
        alive = sum(plane() is not None for plane in self._other[0].kept)
        return frame.write("alive", torch.full_like(frame.read("count"), alive))


def streamed(runs: int) -> list[tuple[float, float]]:
    first = Remembers()
    pipeline = Pipeline(inner=Pipeline(first=first), then=Counts(first))
    frames = (boxes.frame(boxes.camera((4, 6)), index=i) for i in range(runs))
    return [(float(f.read("count").max()), float(f.read("alive").max())) for f in pipeline.stream(frames)]


def test_a_stream_lets_go_of_each_old_state_once_it_has_been_read(monkeypatch) -> None:
    monkeypatch.setattr(PipelineState, "detach", lambda self: self)  # whose tensors are others
    assert streamed(3) == [(1, 1), (2, 1), (3, 1)]


def test_a_history_that_was_handed_over_is_in_memory_no_more_once_taken() -> None:
    plane, g = torch.ones(1, 1, 4, 6), boxes.frame(boxes.camera((4, 6))).gbuffer
    state = PipelineState(stages={"in": PipelineState(stages={"a": History(length=plane, signals={"b": plane + 1})})})
    alive = weakref.ref(state.stages["in"].stages["a"].signals["b"])
    handed, own = state.handed_over().stages["in"].stages["a"], state.stages["in"].stages["a"]
    assert own.take() is own, "a history that was not handed over stays"
    taken = handed.take()
    assert taken.length is plane
    assert (dict(handed.signals), handed.gbuffer, handed.length.numel()) == ({}, None, 0)
    del state, own
    assert alive() is not None
    del taken
    assert alive() is None

    lit = torch.rand(1, 3, 4, 6)
    _, before = temporal(lit, g)
    (left,) = PipelineState(stages={"a": before}).handed_over().stages.values()
    expected = temporal(lit, g, before)[0]
    assert torch.equal(temporal(lit, g, left)[0], expected)
    assert not left.signals, "temporal takes it"
    assert before.signals


def test_a_state_that_is_not_handed_over_stays_as_it_is() -> None:
    pipeline = Pipeline(inner=Pipeline(first=Remembers()))
    frames = [boxes.frame(boxes.camera((4, 6)), index=i) for i in range(3)]
    _, state = pipeline(frames[0])
    copy = map_tensors(torch.clone, state)
    once, again = (pipeline(frames[1], state)[0].read("count") for _ in range(2))
    assert torch.equal(once, again)
    handed = copy.handed_over()
    assert torch.equal(pipeline(frames[1], handed)[0].read("count"), once)
    assert torch.equal(pipeline(frames[2], copy)[0].read("count"), once)


def test_only_what_has_a_gradient_is_detached():
    plain, graph = torch.ones(1, 1, 2, 2), torch.ones(1, 1, 2, 2, requires_grad=True) * 2
    g = boxes.frame(boxes.camera((2, 2))).gbuffer
    state = PipelineState(stages={"a": History(length=plain, signals={"b": graph}, gbuffer=g)})
    kept = state.detach().stages["a"]
    assert kept.length is plain
    assert kept.gbuffer is g, "cameras and channels are neither made nor checked again"
    assert not kept.signals["b"].requires_grad
    assert torch.equal(kept.signals["b"], graph)


class Trail(TemporalPass):
    """Adds the light of all frames before, and half of what the frame before held."""

    reads, writes = frozenset({"radiance"}), frozenset({"composite"})
    recalls = writes

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        total = frame.read("radiance") + (0 if state is None else state.signals["total"])
        before = 0 if frame.previous is None else 0.5 * frame.previous.read("composite")
        state = History(length=torch.ones_like(frame.gbuffer.depth), signals={"total": total})
        return frame.replace(composite=total + before), state


@pytest.mark.parametrize("keep_graph", [False, True])
def test_gradients_reach_past_frames_only_where_asked(keep_graph):
    """The second frame holds its own light, the first's in the state, and half the first's composite."""
    pipeline, lights = Pipeline(inner=Pipeline(trail=Trail())), [torch.ones(1, 3, 6, 8) for _ in range(2)]
    blank = boxes.frame(boxes.camera((6, 8)))
    frames = [blank.replace(index=i, radiance=light.requires_grad_()) for i, light in enumerate(lights)]
    _, state = pipeline(frames[0], keep_graph=keep_graph)
    assert state.previous is not None
    tensors = [state.stages["inner"].stages["trail"].signals["total"], state.previous.read("composite")]
    assert [t.requires_grad for t in tensors] == [keep_graph] * 2
    by_hand, streamed = pipeline(frames[1], state)[0], list(pipeline.stream(frames, keep_graph=keep_graph))[1]
    for last in (by_hand, streamed):
        assert torch.equal(last.read("composite"), torch.full((1, 3, 6, 8), 2.5))
        before, now = torch.autograd.grad(last.read("composite").sum(), lights, allow_unused=True, retain_graph=True)
        assert float(now.mean()) == 1.0
        assert (before is None) if not keep_graph else float(before.mean()) == 1.5


class Recalls(Pass):
    """Reads a signal of the frame before, and tells how many of two others are still there."""

    writes, recalls = frozenset({"ao"}), frozenset({"ao"})

    def forward(self, frame: Frame) -> Frame:
        before = frame.previous
        there = 0.0 if before is None else float(before.ao is not None) + 2 * float(before.gi is not None)
        return frame.replace(ao=torch.full_like(frame.gbuffer.depth, there))


class Bounces(Pass):
    writes, recalls = frozenset({"gi"}), frozenset({"gi"})

    def forward(self, frame: Frame) -> Frame:
        assert frame.previous is None or frame.previous.gi is not None
        return frame.replace(gi=torch.zeros_like(frame.gbuffer.normal))


def test_what_is_recalled_is_let_go_once_its_last_reader_has_run() -> None:
    inner = Pipeline(first=Bounces(), again=Bounces())
    pipeline = Pipeline(inner=inner, then=Recalls(), under=Pipeline(layer="behind", gi=Bounces()))
    plain = boxes.frame(boxes.camera((4, 6)))
    frames = [plain.replace(index=i, behind=plain) for i in range(2)]
    _, state = pipeline(frames[0])
    told = [float(pipeline(frames[1], given)[0].read("ao").max()) for given in (state, state.handed_over(), state)]
    assert told == [3, 1, 3], "a state that is not handed over stays"
