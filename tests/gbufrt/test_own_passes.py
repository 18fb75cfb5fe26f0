"""What users give to passes, and what their own passes return."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Pass, Pipeline, TemporalPass
from post import GTAO, me1


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
