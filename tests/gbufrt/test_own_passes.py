"""What users give to passes, and what their own passes return."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Frame, Pass, Pipeline, TemporalPass
from post import (
    GTAO,
    SSGI,
    SSR,
    TAA,
    Bilateral,
    DepthOfField,
    MotionBlur,
    Reduced,
    Temporal,
    Upscale,
    me1,
    taa,
)


class Forgets(Pass):
    """Returns what ``answer`` says in place of a frame."""

    writes = frozenset({"ao"})
    answer: object = None

    def forward(self, frame):  # pyright: ignore[reportIncompatibleMethodOverride]
        return self.answer


class ForgetsItsState(TemporalPass):
    """Returns a frame alone."""

    writes = frozenset({"ao"})

    def forward(self, frame, state=None):  # pyright: ignore[reportIncompatibleMethodOverride]
        return frame


@pytest.mark.parametrize(("answer", "what"), [(None, "NoneType"), (torch.zeros(1), "Tensor"), ((), "tuple")])
def test_a_pass_that_returns_no_frame_is_named(answer, what):
    stage = Forgets()
    stage.answer = answer
    with pytest.raises(TypeError, match=rf"mine \(Forgets\) must return a Frame.*got {what}"):
        Pipeline(mine=stage)(boxes.frame(boxes.camera()))
    with pytest.raises(TypeError, match=r"mine \(ForgetsItsState\) must return a Frame and its state, got Frame"):
        Pipeline(mine=ForgetsItsState())(boxes.frame(boxes.camera()))


class Graded(Pass):
    """Has a table of colours for a tunable."""

    writes = frozenset({"ao"})

    def __init__(self, *, table: torch.Tensor) -> None:
        super().__init__()
        self.table = table

    def forward(self, frame):
        return frame


def test_a_tensor_may_replace_a_tensor():
    stage = Pipeline(graded=Graded(table=torch.zeros(3))).with_tunables({"graded.table": torch.ones(3)})
    assert torch.equal(stage.all_tunables()["graded.table"], torch.ones(3))


@pytest.mark.parametrize(
    ("value", "message"),
    [(torch.ones(1), r"0-dim tensor, got a tensor of shape \(1,\)"), ("2", r"must be a number \(it is 2.0 now\)")],
)
def test_tunables_that_are_no_numbers_are_refused(value, message):
    with pytest.raises(ValueError, match=message):
        me1("low").with_tunables({"ao.estimate.radius": value})
    assert Pipeline(ao=GTAO()).with_tunables({"ao.radius": torch.tensor(3.0)}).all_tunables()["ao.radius"] == 3.0


class Writes(Pass):
    """Writes what ``answer`` maps, and says that it writes ``ao``."""

    writes = frozenset({"ao"})
    answer: dict[str, torch.Tensor]

    def forward(self, frame: Frame) -> Frame:
        for name, tensor in self.answer.items():
            frame = frame.write(name, tensor)
        return frame


class WritesLate(TemporalPass):
    """Writes another signal than it says, beside its state."""

    writes = frozenset({"ao"})

    def forward(self, frame: Frame, state: int | None = None) -> tuple[Frame, int]:
        return frame.write("haze", frame.gbuffer.depth), 1


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("ao", "haze"), "Writes wrote 'haze', which its `writes` does not name"),
        (("ao", "ambient"), "Writes wrote 'ambient', which"),
        ((), r"Writes did not write 'ao', which.*return what frame\.write\('ao', tensor\) gives"),
    ],
)
def test_what_a_pass_writes_is_what_it_says(names, message):
    frame, stage = boxes.frame(boxes.camera((8, 12))), Writes()
    shown = {"ao": 0.5 * torch.ones_like(frame.gbuffer.depth), "haze": frame.gbuffer.depth}
    stage.answer = {name: shown.get(name, torch.rand(1, 3, 8, 12)) for name in names}
    with pytest.raises(ValueError, match=message):
        Pipeline(mine=stage)(frame)
    stage.answer = {"ao": shown["ao"]}
    broken = frame.replace(radiance=frame.read("radiance") / 0)  # which is mended before a pass sees it
    assert torch.equal(Pipeline(mine=stage)(broken)[0].read("ao"), shown["ao"])
    with pytest.raises(ValueError, match="WritesLate wrote 'haze'"):
        Pipeline(mine=WritesLate())(frame)


def test_what_the_frame_lacks_is_told_before_a_stage_runs():
    frame, ran = boxes.frame(boxes.camera((8, 12))), list[bool]()

    class Noted(Writes):
        def forward(self, frame: Frame) -> Frame:
            ran.append(True)
            return super().forward(frame)

    stage = Noted()
    stage.answer = {"ao": torch.ones_like(frame.gbuffer.depth)}
    pipeline = Pipeline(mine=stage, gi=Pipeline(gather=SSGI()))
    with pytest.raises(ValueError, match=r"gi\.gather \(SSGI\) reads 'albedo'.*give the GBuffer an albedo channel"):
        pipeline(frame.replace(gbuffer=frame.gbuffer.replace(albedo=None)))
    assert not ran
    with pytest.raises(ValueError, match="lacks: give the GBuffer a roughness channel"):
        SSR().check(frame.replace(gbuffer=frame.gbuffer.replace(roughness=None)))


def test_a_state_of_another_size_is_told_at_the_size_of_the_frames():
    gi = Pipeline(reduction=Reduced(), gather=SSGI(directions=1), accumulate=Temporal(signal="gi"))
    pipeline = Pipeline(gi=gi)
    state = pipeline(boxes.frame(boxes.camera((16, 24))))[1]
    with pytest.raises(ValueError, match="of frames of 24x16 pixels in a batch of 1, the frame has 36x16 pixels"):
        pipeline(boxes.frame(boxes.camera((16, 36)), index=1), state)
    sizeless = Pipeline(given={"color"}, dof=DepthOfField())  # keeps a distance, which fits every size
    small, large = (boxes.frame(boxes.camera(size)) for size in ((16, 24), (16, 36)))
    state = sizeless(small.replace(color=small.radiance))[1]
    sizeless(large.replace(color=large.radiance, index=1), state)


@pytest.mark.parametrize("stage", [DepthOfField(), MotionBlur(), TAA(), Bilateral(signal="color"), Upscale()])
def test_a_larger_picture_beside_the_gbuffer_names_enlarged(stage):
    frame = boxes.frame(boxes.camera((16, 24)))
    frame = frame.replace(color=torch.rand(1, 3, 32, 48))
    with pytest.raises(ValueError, match=r"reads 'color' of 48x32 pixels beside 'depth' of 24x16.*post\.Enlarged"):
        Pipeline(given={"color"}, stage=stage)(frame)
    with pytest.raises(ValueError, match=r"color must be \(1,3,16,24\)"):
        taa(frame.read("color"), frame.gbuffer)


class Fills(Pass):
    """Writes a constant into signals."""

    def __init__(self, *, names: tuple[str, ...]) -> None:
        super().__init__()
        self.names, self.writes = names, frozenset(names)

    def forward(self, frame: Frame) -> Frame:
        for name in self.names:
            frame = frame.write(name, torch.full_like(frame.gbuffer.depth, 3.0))
        return frame


class Recalls(Pass):
    """Adds what it finds of some signals in the frame before."""

    writes = frozenset({"found"})

    def __init__(self, *, names: tuple[str, ...]) -> None:
        super().__init__()
        self.names, self.recalls = names, frozenset(names)

    def forward(self, frame: Frame) -> Frame:
        found = [frame.previous.read(name) for name in self.names] if frame.previous is not None else []
        return frame.write("found", sum(found, torch.zeros_like(frame.gbuffer.depth)))


def test_only_what_passes_recall_is_kept_of_the_frame_before():
    frame, recall = boxes.frame(boxes.camera((6, 8))), Recalls(names=("ao", "own"))
    plain = Pipeline(fill=Fills(names=("ao", "own", "sky_visibility")))
    nested = Pipeline(all=plain, after=Pipeline(recall=recall))
    geometry = frame.as_previous(()).present
    for built, kept in ((plain, geometry), (nested, (*geometry, "ao", "own"))):
        _, state = built(frame)
        assert state.previous is not None
        assert state.previous.present == kept
    _, state = nested(frame)
    assert nested(frame.replace(index=1), state)[0].read("found").unique().tolist() == [6.0]
    assert Pipeline(layer="behind", recall=recall).recalls == frozenset(), "the layer behind has no frame before"
