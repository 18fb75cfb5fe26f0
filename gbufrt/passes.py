"""Pass and TemporalPass: what a pipeline is made of; and Branch, the names under which it holds them.

A pass is a function from frame to frame with its tunables. A temporal pass also takes and returns its state, a plain
value that is None on the first frame.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Self

from torch import nn

from gbufrt.compute.precision import own_precision
from gbufrt.demands.inputs import check_frame, check_inputs_of, remedy
from gbufrt.demands.results import check_written
from gbufrt.frame import Frame
from gbufrt.mending import contained
from gbufrt.names import meanings, resolve, unknown
from gbufrt.validation.tunables import check_kept, check_tunable, keywords


class Stage(nn.Module):
    """What a pass and a temporal pass have in common: what they read and write, and their tunables.

    ``reads`` must be present, ``optional`` is used where present, ``writes`` is the result. Every keyword of the
    constructor is a tunable and is kept in an attribute of the same name. ``lacks`` says, by the name of an optional
    input that comes with the frame, what is missing from the result without it; a pipeline tells that once. ``recalls``
    names the signals that it reads of ``frame.previous``: a pipeline keeps no others.
    """

    reads: frozenset[str] = frozenset()
    optional: frozenset[str] = frozenset()
    writes: frozenset[str] = frozenset()
    recalls: frozenset[str] = frozenset()
    lacks: Mapping[str, str] = MappingProxyType({})

    def __setattr__(self, name: str, value: Any) -> None:
        check_kept(type(self), name, value)
        super().__setattr__(name, value)

    def tunables(self) -> dict[str, Any]:
        """The constructor's keywords with their present values."""
        return {name: getattr(self, name) for name in keywords(type(self))}

    def meanings(self) -> dict[str, str]:
        """A line on each tunable, from the docstrings of the class and of the functions that it refers to."""
        return meanings(type(self), keywords(type(self)))

    def tuned(self, **changes: Any) -> Stage:
        """A copy with some tunables changed.

        Raises:
            ValueError: there is no such tunable.
        """
        known = self.tunables()
        for name in changes:
            if name not in known:
                raise ValueError(unknown("tunable", name, type(self).__name__, known))
        return type(self)(**{**known, **changes})

    def check(self, frame: Frame) -> None:
        """Raise ValueError if the frame lacks something that this pass reads, or has its picture at another size."""
        check_inputs_of(self, frame)

    def left_out(self, frame: Frame, written: Collection[str] = ()) -> list[str]:
        """What this pass leaves out for want of an input, and the remedies, those ``written`` before it apart."""
        absent = [name for name in self.lacks if name not in written and frame.get(name) is None]
        return [f"{self.lacks[name]}, because the frame has no {name}: {remedy(name)}" for name in absent]

    def extra_repr(self) -> str:
        return ", ".join(f"{name}={value!r}" for name, value in self.tunables().items())


Stages = Mapping[str, Stage | None]
"""By name, in order; None leaves one out."""


class Pass(Stage, ABC):
    """A pass whose result depends on one frame alone."""

    def __call__(self, frame: Frame) -> Frame:
        """`forward` over a frame in which no pixel can spread NaN or infinity, see `gbufrt.mending.contained`."""
        check_frame(frame)
        given = contained(frame, self.reads | self.optional)
        with own_precision(frame.gbuffer.depth):
            result = super().__call__(given)
        check_written(self, given, result)
        return result

    @abstractmethod
    def forward(self, frame: Frame) -> Frame:
        """The frame with what ``writes`` names filled in."""


class TemporalPass(Stage, ABC):
    """A pass with history: its state is a value that the caller keeps between frames."""

    def __call__(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
        """`forward` over a frame in which no pixel can spread NaN or infinity, see `gbufrt.mending.contained`."""
        check_frame(frame)
        given = contained(frame, self.reads | self.optional)
        with own_precision(frame.gbuffer.depth):
            result = super().__call__(given, state)
        check_written(self, given, result[0] if isinstance(result, tuple) and result else None)
        return result

    @abstractmethod
    def forward(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
        """The frame with what ``writes`` names filled in, and the state for the next frame."""


class Branch(TemporalPass, ABC):
    """Named stages, and copies of it with some of them changed; `gbufrt.Pipeline` says how they run.

    Raises:
        TypeError: a stage is not a pass.
        ValueError: a name has a dot.
    """

    def __init__(self, stages: Stages) -> None:
        super().__init__()
        self.stages = nn.ModuleDict()
        for name, stage in stages.items():
            if stage is None:
                continue
            if not name or "." in name:
                raise ValueError(f"a stage's name must hold no dot, which reaches into pipelines, got {name!r}")
            if not isinstance(stage, (Pass, TemporalPass)):
                kind = type(stage).__name__
                got = f"the class {stage.__name__}; write {stage.__name__}()" if isinstance(stage, type) else kind
                raise TypeError(f"stage {name!r} must be a Pass, TemporalPass or Pipeline, got {got}")
            self.stages[name] = stage

    def _stages(self) -> dict[str, Stage]:
        return {name: stage for name, stage in self.stages.items() if isinstance(stage, Stage)}  # every one is

    def passes(self) -> Iterator[tuple[str, Stage]]:
        """Every pass that is not itself a pipeline, with its dotted name, in order."""
        for name, stage in self._stages().items():
            if isinstance(stage, Branch):
                yield from ((f"{name}.{path}", inner) for path, inner in stage.passes())
            else:
                yield name, stage

    def without(self, *paths: str) -> Self:
        """A copy that lacks the named stages (``"gi"``, ``"gi.accumulate"``).

        Raises:
            ValueError: there is no such stage, or a remaining stage reads what a removed one wrote.
        """
        result = self
        for path in paths:
            result = result.replace(path, None)
        return result

    def replace(self, path: str, stage: Stage | None) -> Self:
        """A copy with another stage in the place of the named one, such as ``"ao.estimate"``.

        Raises:
            TypeError: the new stage is not a pass.
            ValueError: there is no such stage, or a later one reads what only the old one wrote.
        """
        return self._edited(path, lambda stages, name: {**stages, name: stage})

    def with_stage(self, name: str, stage: Stage, *, after: str | None = None, before: str | None = None) -> Self:
        """A copy with a stage of your own.

        Args:
            name: the stage's name, a dotted one to reach into a nested pipeline.
            stage: a pass, temporal pass or pipeline.
            after: the stage of the same pipeline that it follows; or
            before: the stage of the same pipeline that it precedes.

        Raises:
            ValueError: there is no stage to follow or to precede, the name is taken, or an input is missing.
        """
        if (after is None) == (before is None):
            raise ValueError(f"give after= or before=, one of them, to say where stage {name!r} goes")
        beside = str(after or before)

        def insert(stages: Stages, place: str) -> Stages:
            order = list(stages)
            at = order.index(place) + (after is not None)
            if own in stages:
                raise ValueError(f"the pipeline has a stage {own!r} already; choose another name, or use replace()")
            return {key: stage if key == own else stages[key] for key in [*order[:at], own, *order[at:]]}

        if not isinstance(name, str):
            raise TypeError(f"name of the new stage must be a text such as 'fog', got {type(name).__name__}")
        inner, _, own = name.rpartition(".")
        return self._edited(f"{inner}.{beside}" if inner else beside, insert)

    def with_tunables(self, values: Mapping[str, Any]) -> Self:
        """A copy with tunables set by dotted name, such as ``{"ao.estimate.radius": 2.0}``.

        A name may be shortened to any unambiguous tail, and a pass may go by its class's name in lower case
        (``gtao.radius``).

        Raises:
            ValueError: no such tunable, a tail that fits several, or a value that is neither a number nor a 0-dim
                tensor where the present one is a number.
        """
        if not isinstance(values, Mapping):
            raise TypeError(f'values must be a mapping such as {{"gtao.radius": 2.0}}, got {type(values).__name__}')
        result, stages, told = self, dict(self.passes()), dict[str, dict[str, Any]]()
        for name, value in values.items():
            path, _, key = self.resolve(name).rpartition(".")
            check_tunable(name, value, stages[path].tunables()[key])
            told.setdefault(path, {})[key] = value
        for path, tunables in told.items():
            result = result.replace(path, stages[path].tuned(**tunables))
        return result

    def all_tunables(self) -> dict[str, Any]:
        """Every tunable by its full dotted name, with its present value."""
        return {f"{path}.{key}": value for path, stage in self.passes() for key, value in stage.tunables().items()}

    def resolve(self, name: str) -> str:
        """The full dotted name of a tunable; see `with_tunables`."""
        return resolve(name, {f"{path}.{key}": type(p).__name__ for path, p in self.passes() for key in p.tunables()})

    def tunables(self) -> dict[str, Any]:
        """A pipeline has none of its own; see `all_tunables`."""
        return {}

    def _edited(self, path: str, change: Callable[[Stages, str], Stages]) -> Self:
        """A copy in which ``change`` made other stages of those around the named one; empty pipelines are left out."""
        if not isinstance(path, str):
            raise TypeError(f"a stage is named by text such as 'gi.accumulate', several one by one; got {path!r}")
        head, _, rest = path.partition(".")
        stages: Stages = dict(self._stages())
        if head not in stages:
            raise ValueError(unknown("stage", head, "the pipeline", stages))
        inner = stages[head]
        if not rest:
            stages = change(stages, head)
        elif isinstance(inner, Branch):
            changed = inner._edited(rest, change)
            stages[head] = changed if len(changed.stages) else None
        else:
            raise ValueError(f"stage {head!r} ({type(inner).__name__}) has no stages of its own ({rest!r})")
        return self._with(stages)

    @abstractmethod
    def _with(self, stages: Stages) -> Self:
        """A copy with these stages in place of its own."""
