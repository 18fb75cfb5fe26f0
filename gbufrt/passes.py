"""Pass, TemporalPass and Pipeline: how passes compose.

A pass is a function from frame to frame with its tunables. A temporal pass also takes and returns its state, a plain
value that is None on the first frame. A pipeline is a temporal pass made of named stages, so pipelines nest.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any, Literal

from torch import Tensor, nn

from gbufrt.frame import LIGHT, SIGNALS, Frame
from gbufrt.fusion import fused_kernels
from gbufrt.gbuffer import CHANNELS, to_function
from gbufrt.tree import map_tensors


class Stage(nn.Module):
    """What a pass and a temporal pass have in common: what they read and write, and their tunables.

    ``reads`` must be there, ``optional`` is used where it is there, ``writes`` comes out. Every keyword of the
    constructor is a tunable and is kept in an attribute of the same name.
    """

    reads: frozenset[str] = frozenset()
    optional: frozenset[str] = frozenset()
    writes: frozenset[str] = frozenset()

    def tunables(self) -> dict[str, Any]:
        """The constructor's keywords with their present values."""
        return {name: getattr(self, name) for name in _keywords(type(self))}

    def tuned(self, **changes: Any) -> Stage:
        """A copy with some tunables changed.

        Raises:
            ValueError: there is no such tunable.
        """
        known = self.tunables()
        for name in changes:
            if name not in known:
                raise ValueError(f"{type(self).__name__} has no tunable {name!r}; it has {', '.join(known) or 'none'}")
        return type(self)(**{**known, **changes})

    def check(self, frame: Frame) -> None:
        """Raise ValueError if the frame lacks something that this pass reads."""
        for name in sorted(self.reads):
            if frame.get(name) is None:
                raise ValueError(f"{type(self).__name__} reads {name!r}, which the frame lacks: {_remedy(name)}")

    def extra_repr(self) -> str:
        return ", ".join(f"{name}={value!r}" for name, value in self.tunables().items())


class Pass(Stage, ABC):
    """A pass whose result depends on one frame alone."""

    @abstractmethod
    def forward(self, frame: Frame) -> Frame:
        """The frame with what ``writes`` names filled in."""


class TemporalPass(Stage, ABC):
    """A pass that remembers: its state is a value that the caller keeps between frames."""

    @abstractmethod
    def forward(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
        """The frame with what ``writes`` names filled in, and the state for the next frame."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PipelineState:
    """The states of a pipeline's stages by name, and the frame before (kept by the outermost pipeline)."""

    stages: Mapping[str, Any] = field(default_factory=dict)
    previous: Frame | None = None

    def to(self, *args: Any, **kwargs: Any) -> PipelineState:
        """The state on another device; arguments as `torch.Tensor.to`."""
        return map_tensors(to_function(*args, **kwargs), self)

    def detach(self) -> PipelineState:
        """The same numbers without their gradients."""
        return map_tensors(Tensor.detach, self)

    def reset(self, mask: Tensor) -> PipelineState:
        """Forget the batch elements where ``mask`` ``(B,)`` is True."""
        stages = {name: None if state is None else state.reset(mask) for name, state in self.stages.items()}
        previous = self.previous
        if previous is not None:
            g = previous.gbuffer
            previous = previous.replace(gbuffer=g.replace(hit=g.hit & ~mask[:, None, None, None]))
        return PipelineState(stages=stages, previous=previous)


class Pipeline(TemporalPass):
    """Named stages, run in order.

    Args:
        given: signals that incoming frames already hold, beyond G-buffer channels and light.
        layer: ``"behind"`` runs the stages on ``frame.behind``, where there is one, instead of on the frame.
        stages: passes, temporal passes or pipelines by name; None leaves a stage out.

    Raises:
        TypeError: a stage is not a pass.
        ValueError: a stage reads a signal that nothing before it writes.
    """

    def __init__(
        self, *, given: Iterable[str] = (), layer: Literal["behind"] | None = None, **stages: Stage | None
    ) -> None:
        super().__init__()
        if layer not in (None, "behind"):
            raise ValueError(f'layer must be "behind" or None, got {layer!r}')
        self.given = frozenset(given)
        self.layer: Literal["behind"] | None = layer
        self.fused = False
        self.stages = nn.ModuleDict()
        for name, stage in stages.items():
            if stage is None:
                continue
            if not isinstance(stage, (Pass, TemporalPass)):
                raise TypeError(f"stage {name!r} must be a Pass, TemporalPass or Pipeline, got {type(stage).__name__}")
            self.stages[name] = stage
        self._connect()

    def _connect(self) -> None:
        """Work out what the whole reads and writes, and that every signal read inside has been written."""
        have, reads, optional = set(self.given), set(self.given), set()
        for name, stage in self._stages():
            for signal in sorted(stage.reads - have):
                if signal not in LIGHT and signal not in CHANNELS:
                    raise ValueError(
                        f"{name} ({type(stage).__name__}) reads {signal!r}, but no stage before it writes that: "
                        f"add one, or pass given={{{signal!r}}} if the frames hold it already"
                    )
                reads.add(signal)
            optional |= stage.optional - have
            have |= stage.writes
        if self.layer is None:  # what happens on another layer is not this frame's concern
            self.reads, self.optional = frozenset(reads), frozenset(optional - reads)
            self.writes = frozenset().union(*(stage.writes for _, stage in self._stages()))

    def forward(self, frame: Frame, state: PipelineState | None = None) -> tuple[Frame, PipelineState]:
        """Run every stage. ``frame.previous`` is filled from the state; ``frame.cut`` resets what may not be kept."""
        if state is not None and frame.cut is not None and bool(frame.cut.any()):
            state = state.reset(frame.cut)
        if state is not None and frame.previous is None:
            frame = frame.replace(previous=state.previous)
        with fused_kernels() if self.fused else nullcontext():
            frame, after = self._run(frame, state)
        return frame.replace(previous=None), PipelineState(stages=after.stages, previous=frame.as_previous())

    def _run(self, frame: Frame, state: PipelineState | None) -> tuple[Frame, PipelineState]:
        if self.layer == "behind":
            if frame.behind is None:
                return frame, PipelineState()
            behind, after = self._run_stages(frame.behind, state)
            return frame.replace(behind=behind), after
        return self._run_stages(frame, state)

    def _run_stages(self, frame: Frame, state: PipelineState | None) -> tuple[Frame, PipelineState]:
        before = {} if state is None else state.stages
        after: dict[str, Any] = {}
        for name, stage in self._stages():
            if isinstance(stage, Pipeline):
                frame, after[name] = stage._run(frame, before.get(name))
            elif isinstance(stage, TemporalPass):
                stage.check(frame)
                frame, after[name] = stage(frame, before.get(name))
            elif isinstance(stage, Pass):
                stage.check(frame)
                frame = stage(frame)
        return frame, PipelineState(stages=after)

    def stream(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Run over consecutive frames, threading the state."""
        state = None
        for frame in frames:
            result, state = self(frame, state)
            yield result

    def passes(self) -> Iterator[tuple[str, Stage]]:
        """Every pass that is not itself a pipeline, with its dotted name, in order."""
        for name, stage in self._stages():
            if isinstance(stage, Pipeline):
                yield from ((f"{name}.{path}", inner) for path, inner in stage.passes())
            else:
                yield name, stage

    def _stages(self) -> Iterator[tuple[str, Stage]]:
        for name, stage in self.stages.items():
            if isinstance(stage, Stage):  # always; tells the type checker what a ModuleDict cannot
                yield name, stage

    def without(self, *paths: str) -> Pipeline:
        """A copy that lacks the named stages (``"gi"``, ``"gi.accumulate"``).

        Raises:
            ValueError: there is no such stage, or a stage left in reads what a left-out one wrote.
        """
        result = self
        for path in paths:
            result = result._changed(path, lambda _: None)
        return result

    def with_stage(self, name: str, stage: Stage, *, after: str) -> Pipeline:
        """A copy with a stage of your own.

        Args:
            name: the stage's name, a dotted one to reach into a nested pipeline.
            stage: a pass, temporal pass or pipeline.
            after: the stage of the same pipeline that it follows.

        Raises:
            ValueError: there is no stage to follow, the name is taken, or an input is missing.
        """
        inner, _, last = name.rpartition(".")
        if inner:
            return self._changed(inner, lambda nested: _pipeline(inner, nested).with_stage(last, stage, after=after))
        if after not in self.stages:
            raise ValueError(f"no stage {after!r} in the pipeline; it has {', '.join(self.stages)}")
        if name in self.stages:
            raise ValueError(f"the pipeline has a stage {name!r} already; choose another name")
        stages: dict[str, Stage] = {}
        for existing, present in self._stages():
            stages[existing] = present
            if existing == after:
                stages[name] = stage
        return self._rebuilt(stages)

    def with_tunables(self, values: Mapping[str, Any]) -> Pipeline:
        """A copy with tunables set by dotted name, such as ``{"ao.estimate.radius": 2.0}``.

        A name may be shortened to any unambiguous tail, and a pass may go by its class's name in lower case
        (``gtao.radius``).

        Raises:
            ValueError: no such tunable, or a tail that fits several.
        """
        result = self
        for name, value in values.items():
            path, _, key = self.resolve(name).rpartition(".")
            result = result._changed(path, lambda stage, key=key, value=value: stage.tuned(**{key: value}))
        return result

    def all_tunables(self) -> dict[str, Any]:
        """Every tunable by its full dotted name, with its present value."""
        return {f"{path}.{key}": value for path, stage in self.passes() for key, value in stage.tunables().items()}

    def resolve(self, name: str) -> str:
        """The full dotted name of a tunable; see `with_tunables`."""
        names = {f"{path}.{key}": stage for path, stage in self.passes() for key in stage.tunables()}
        if name in names:
            return name
        found = []
        for full, stage in names.items():
            path, _, key = full.rpartition(".")
            alias = f"{type(stage).__name__.lower()}.{key}"
            if full.endswith("." + name) or name == alias or f"{path.rpartition('.')[0]}.{alias}" == name:
                found.append(full)
        if len(found) == 1:
            return found[0]
        if found:
            raise ValueError(f"tunable {name!r} is ambiguous: {', '.join(found)}")
        near = [full for full in names if full.rpartition(".")[2] == name.rpartition(".")[2]]
        raise ValueError(f"no tunable {name!r}" + (f"; did you mean {', '.join(near[:4])}?" if near else ""))

    def compile(self, *args: Any, **kwargs: Any) -> None:
        """Fuse the passes' fixed-tap functions with `torch.compile` from the next call on.

        The first call of each function takes tens of seconds; where compilation fails, eager code runs.
        """
        self.fused = True

    def extra_repr(self) -> str:
        return ""

    def _changed(self, path: str, change: Any) -> Pipeline:
        head, _, rest = path.partition(".")
        if head not in self.stages:
            known = ", ".join(self.stages)
            raise ValueError(f"no stage {head!r} in the pipeline; it has {known}")
        stages: dict[str, Any] = dict(self.stages.items())
        inner = stages[head]
        if not rest:
            stages[head] = change(inner)
        elif isinstance(inner, Pipeline):
            changed = inner._changed(rest, change)
            stages[head] = changed if len(changed.stages) else None
        else:
            raise ValueError(f"stage {head!r} is a {type(inner).__name__} and has no stages of its own ({rest!r})")
        return self._rebuilt(stages)

    def _rebuilt(self, stages: Mapping[str, Any]) -> Pipeline:
        result = Pipeline(given=self.given, layer=self.layer, **stages)
        result.fused = self.fused
        return result


def _pipeline(name: str, stage: Any) -> Pipeline:
    if not isinstance(stage, Pipeline):
        raise ValueError(f"stage {name!r} is a {type(stage).__name__} and has no stages of its own")
    return stage


def _keywords(cls: type) -> list[str]:
    if cls.__init__ is Stage.__init__ or issubclass(cls, Pipeline):
        return []
    return [p.name for p in inspect.signature(cls.__init__).parameters.values() if p.kind is p.KEYWORD_ONLY]


def _remedy(name: str) -> str:
    if name in CHANNELS:
        return f"give the GBuffer a {name} channel ({CHANNELS[name].meaning})"
    if name in SIGNALS:
        return f"give the Frame {name} ({SIGNALS[name].meaning}) or run a pass that writes it"
    return "run a pass that writes it"


__all__ = ["Pass", "Pipeline", "PipelineState", "Stage", "TemporalPass"]
