"""How passes compose: building, checking, leaving out, tuning, and state as a value."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Frame, History, Pass, Pipeline, TemporalPass


class Fill(Pass):
    """Writes a constant."""

    reads = frozenset({"depth"})

    def __init__(self, *, signal: str = "ao", value: float = 1.0) -> None:
        super().__init__()
        self.signal, self.value = signal, value
        self.writes = frozenset({signal})

    def forward(self, frame: Frame) -> Frame:
        return frame.write(self.signal, torch.full_like(frame.gbuffer.depth, self.value))


class Scale(Pass):
    """Reads a signal and scales it."""

    def __init__(self, *, signal: str = "ao", by: float = 2.0) -> None:
        super().__init__()
        self.signal, self.by = signal, by
        self.reads = self.writes = frozenset({signal})

    def forward(self, frame: Frame) -> Frame:
        return frame.write(self.signal, frame.read(self.signal) * self.by)


class Count(TemporalPass):
    """Counts the frames of each pixel, and keeps the index of the previous frame."""

    writes = frozenset({"count", "before"})

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        zero = torch.zeros_like(frame.gbuffer.depth)
        length = (zero if state is None else state.length) + 1
        before = zero + (-1 if frame.previous is None else frame.previous.index)
        return frame.write("count", length).write("before", before), History(length=length)


def small(index: int = 0, **changes) -> Frame:
    return boxes.frame(boxes.camera((6, 8)), index=index).replace(**changes)


def build() -> Pipeline:
    return Pipeline(ao=Pipeline(estimate=Fill(value=3.0), scale=Scale(), count=Count()), after=Scale(by=10.0))


def test_stages_run_in_order_and_nest():
    frame, state = build()(small())
    assert frame.read("ao").unique().tolist() == [60.0]
    frame, state = build()(small(1), state)
    assert frame.read("count").unique().tolist() == [2.0]


def test_input_frame_is_untouched():
    frame = small()
    build()(frame)
    assert frame.ao is None
    assert not frame.extra


def test_previous_frame_reaches_nested_passes_and_goes_no_further():
    pipeline = build()
    frame, state = pipeline(small(7))
    assert frame.read("before").unique().tolist() == [-1.0]
    frame, state = pipeline(small(8), state)
    assert frame.read("before").unique().tolist() == [7.0]
    assert frame.previous is None
    assert state.previous is not None
    assert state.previous.previous is None


def test_stream_threads_the_state():
    counts = [float(f.read("count").mean()) for f in build().stream(small(i) for i in range(3))]
    assert counts == [1.0, 2.0, 3.0]


def test_without_leaves_stages_out():
    pipeline = build()
    assert [path for path, _ in pipeline.without("ao.count").passes()] == ["ao.estimate", "ao.scale", "after"]
    assert [path for path, _ in pipeline.without("after", "ao.count").passes()] == ["ao.estimate", "ao.scale"]
    assert [path for path, _ in pipeline.passes()] == ["ao.estimate", "ao.scale", "ao.count", "after"]
    frame, _ = pipeline.without("ao.scale")(small())
    assert frame.read("ao").unique().tolist() == [30.0]


@pytest.mark.parametrize("path", ["gi", "ao.gi", "after.gi"])
def test_without_names_what_there_is_not(path):
    with pytest.raises(ValueError, match="'gi'"):
        build().without(path)


def test_missing_input_raises_when_built():
    with pytest.raises(ValueError, match=r"scale \(Scale\) reads 'ao'"):
        Pipeline(scale=Scale())
    with pytest.raises(ValueError, match="reads 'ao'"):
        build().without("ao.estimate")
    given = Pipeline(scale=Scale(), given={"ao"})
    frame, _ = given(small().replace(ao=torch.ones(1, 1, 6, 8)))
    assert frame.read("ao").mean() == 2
    leave = r'reads \'ao\', which the frame lacks: .*, or leave the stage out: pipeline\.without\("scale"\)'
    with pytest.raises(ValueError, match=leave):
        given(small())


def test_missing_channel_raises_per_frame():
    class NeedsThickness(Fill):
        reads = frozenset({"thickness"})

    frame = small()
    frame = frame.replace(gbuffer=frame.gbuffer.replace(thickness=None))
    with pytest.raises(ValueError, match="give the GBuffer a thickness channel"):
        Pipeline(x=NeedsThickness())(frame)


def test_tunables_by_dotted_name():
    pipeline = build().with_tunables({"ao.scale.by": 5.0, "fill.value": 2.0})
    assert pipeline.all_tunables()["ao.estimate.value"] == 2.0
    frame, _ = pipeline(small())
    assert frame.read("ao").unique().tolist() == [100.0]
    assert build().all_tunables()["ao.scale.by"] == 2.0, "the original keeps its own"
    with pytest.raises(ValueError, match=r"ambiguous: ao\.scale\.by, after\.by"):
        build().with_tunables({"by": 1.0})
    with pytest.raises(ValueError, match=r"no tunable 'after\.bye'"):
        build().with_tunables({"after.bye": 1.0})
    with pytest.raises(ValueError, match=r"did you mean ao\.estimate\.value"):
        build().with_tunables({"gtao.value": 1.0})
    with pytest.raises(ValueError, match=r"did you mean after\.by, ao\.scale\.by\?"):
        build().with_tunables({"after.bye": 1.0})
    with pytest.raises(ValueError, match=r"did you mean ao\.estimate\.value\?"):
        build().with_tunables({"valeu": 1.0})
    with pytest.raises(ValueError, match="no tunable 'size' in Fill; it has signal, value"):
        Fill().tuned(size=3)


def test_a_stage_of_your_own():
    pipeline = build().with_stage("more", Scale(by=0.5), after="ao").with_stage("ao.more", Scale(), after="estimate")
    names = [path for path, _ in pipeline.passes()]
    assert names == ["ao.estimate", "ao.more", "ao.scale", "ao.count", "more", "after"]
    assert pipeline(small())[0].read("ao").unique().tolist() == [60.0]
    for name, after, message in (
        ("x", "gi", "no stage 'gi'"),
        ("ao", "after", "already"),
        ("after.x", "y", "no stages"),
    ):
        with pytest.raises(ValueError, match=message):
            build().with_stage(name, Scale(), after=after)


def test_a_stage_before_another():
    pipeline = build().with_stage("first", Fill(), before="ao").with_stage("ao.more", Scale(), before="count")
    names = [path for path, _ in pipeline.passes()]
    assert names == ["first", "ao.estimate", "ao.scale", "ao.more", "ao.count", "after"]
    with pytest.raises(ValueError, match="reads 'ao'"):
        build().with_stage("early", Scale(), before="ao")
    for both in ({}, {"after": "ao", "before": "after"}):
        with pytest.raises(ValueError, match="give after= or before="):
            build().with_stage("x", Scale(), **both)


def test_replacing_a_stage():
    pipeline = build().replace("ao.estimate", Fill(value=1.0))
    assert [path for path, _ in pipeline.passes()] == [path for path, _ in build().passes()]
    assert pipeline(small())[0].read("ao").unique().tolist() == [20.0]
    assert build().all_tunables()["ao.estimate.value"] == 3.0, "the original keeps its own"
    with pytest.raises(ValueError, match=r"no stage 'estimat' in the pipeline \(did you mean estimate\?\)"):
        build().replace("ao.estimat", Fill())
    with pytest.raises(ValueError, match="reads 'ao'"):
        build().replace("ao.estimate", Fill(signal="gi"))
    with pytest.raises(TypeError, match="must be a Pass"):
        build().replace("ao.estimate", torch.nn.Identity())  # pyright: ignore[reportArgumentType]


def test_state_resets_by_batch_element_and_cut():
    def batch(index, **changes):
        cam = boxes.camera((6, 8))
        cam = type(cam).from_intrinsics(
            cam.intrinsics.repeat(2, 1, 1), cam.world_from_view.repeat(2, 1, 1), size=(6, 8)
        )
        return boxes.frame(cam, index=index).replace(**changes)

    pipeline = build()
    _, state = pipeline(batch(0))
    frame, state = pipeline(batch(1, cut=torch.tensor([True, False])), state)
    assert frame.read("count")[:, 0, 0, 0].tolist() == [1.0, 2.0]
    assert state.reset(torch.tensor([False, True])).stages["ao"].stages["count"].length.amax((1, 2, 3)).tolist() == [
        1,
        0,
    ]
    previous = state.reset(torch.tensor([True, False])).previous
    assert previous is not None
    assert previous.gbuffer.hit.flatten(1).any(1).tolist() == [False, True]


def test_state_is_a_plain_value(tmp_path):
    _, state = build()(small())
    torch.save(state, tmp_path / "state.pt")
    back = torch.load(tmp_path / "state.pt")
    frame, _ = build()(small(1), back.to(torch.float64).to(torch.float32).detach())
    assert frame.read("count").unique().tolist() == [2.0]


def test_layer_behind_runs_on_its_own_frame():
    behind = small()
    pipeline = Pipeline(ao=Fill(value=0.5), behind=Pipeline(layer="behind", ao=Fill(value=0.25), scale=Scale()))
    frame, _ = pipeline(small().replace(behind=behind))
    assert frame.behind is not None
    assert frame.behind.read("ao").mean() == 0.5
    assert frame.read("ao").mean() == 0.5
    assert pipeline(small())[0].behind is None
    assert pipeline.all_tunables()["behind.ao.value"] == 0.25
    assert [p for p, _ in pipeline.without("behind.scale").passes()] == ["ao", "behind.ao"]
    with pytest.raises(ValueError, match="reads 'ao'"):
        Pipeline(behind=Pipeline(layer="behind", ao=Fill()), scale=Scale())
    with pytest.raises(ValueError, match="layer must be"):
        Pipeline(layer="front")  # pyright: ignore[reportArgumentType]


def test_stages_must_be_passes():
    with pytest.raises(TypeError, match="must be a Pass"):
        Pipeline(x=torch.nn.Identity())  # pyright: ignore[reportArgumentType]
    assert Pipeline(x=None, y=Fill()).writes == {"ao"}
