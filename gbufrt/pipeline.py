"""Pipeline: named stages that run in order.

A pipeline is itself a temporal pass, so pipelines nest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from typing import Any, Literal

import torch
from torch import nn

from gbufrt.frame import LIGHT, Frame
from gbufrt.gbuffer import CHANNELS
from gbufrt.history import PipelineState
from gbufrt.mending import remembering
from gbufrt.passes import Pass, Stage, TemporalPass
from gbufrt.reduction import Reduction
from gbufrt.specimen import specimen


class Pipeline(TemporalPass):
    """Named stages, run in order.

    Args:
        given: signals that incoming frames already hold, beyond G-buffer channels and light.
        layer: ``"behind"`` runs the stages on ``frame.behind``, where there is one, instead of on the frame.
        reduction: runs the stages on a smaller frame, such as `post.Reduced`. Pipelines that follow one another with
            equal reductions share the smaller frame.
        stages: passes, temporal passes or pipelines by name; None leaves a stage out.

    Raises:
        TypeError: a stage is not a pass.
        ValueError: a stage reads a signal that nothing before it writes.
    """

    def __init__(
        self,
        *,
        given: Iterable[str] = (),
        layer: Literal["behind"] | None = None,
        reduction: Reduction | None = None,
        **stages: Stage | None,
    ) -> None:
        super().__init__()
        if layer not in (None, "behind"):
            raise ValueError(f'layer must be "behind" or None, got {layer!r}')
        self.given = frozenset(given)
        self.layer: Literal["behind"] | None = layer
        self.reduction = reduction
        self.stages = nn.ModuleDict()
        for name, stage in stages.items():
            if stage is None:
                continue
            if not isinstance(stage, (Pass, TemporalPass)):
                raise TypeError(f"stage {name!r} must be a Pass, TemporalPass or Pipeline, got {type(stage).__name__}")
            self.stages[name] = stage
        self._connect()

    def _connect(self) -> None:
        """Work out what the pipeline reads and writes, and check that every signal is written before it is read."""
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
        self._written = frozenset().union(*(stage.writes for _, stage in self._stages()))
        if self.reduction is not None:
            self._written = self.reduction.restored(self._written)
        if self.layer is None:  # stages on another layer do not read or write this frame's signals
            self.reads, self.optional = frozenset(reads), frozenset(optional - reads)
            self.writes = self._written

    def __call__(
        self, frame: Frame, state: PipelineState | None = None, *, keep_graph: bool = False
    ) -> tuple[Frame, PipelineState]:
        """`forward`; each stage contains non-finite pixels itself."""
        return nn.Module.__call__(self, frame, state, keep_graph=keep_graph)

    def forward(
        self, frame: Frame, state: PipelineState | None = None, *, keep_graph: bool = False
    ) -> tuple[Frame, PipelineState]:
        """Run every stage. ``frame.previous`` is filled from the state; ``frame.cut`` resets what may not be kept.

        The state comes back detached, so that neither gradients nor memory reach past one frame. ``keep_graph`` leaves
        its graph in place, for gradients through time: memory then grows with every frame.
        """
        if state is not None and frame.cut is not None and bool(frame.cut.any()):
            state = state.reset(frame.cut)
        if state is not None and frame.previous is None:
            frame = frame.replace(previous=state.previous)
        with remembering():
            frame, after = _run([("", self)], frame, {"": state})
        state = PipelineState(stages=after[""].stages, previous=frame.as_previous())
        return frame.replace(previous=None), state if keep_graph else state.detach()

    def stream(self, frames: Iterable[Frame], *, keep_graph: bool = False) -> Iterator[Frame]:
        """Run over consecutive frames, threading the state; ``keep_graph`` as in `forward`."""
        state = None
        for frame in frames:
            result, state = self(frame, state, keep_graph=keep_graph)
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
            ValueError: there is no such stage, or a remaining stage reads what a removed one wrote.
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

    def compile(self, frame: Frame | None = None) -> dict[str, float]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Compile, ahead of time, all kernels that the passes run on the CPU without gradients.

        Otherwise each is compiled when it is first called. They serve every size, and are cached: where all are there,
        they are loaded in a moment. Stderr says what is compiled. To reach every kernel, the pipeline runs over a frame
        twice, without a history and with one; nothing of that is kept.

        `torch.compile` is not used: beside the kernels it gained nothing but a quarter of motion blur, for a minute of
        compilation and a third of one for every further size.

        Args:
            frame: one like those to come, of any size; by default a small one with all that the tracer gives.

        Returns:
            Seconds by kernel, of those that the cache lacked.

        Raises:
            ValueError: the pipeline reads a signal that the default frame lacks.
        """
        from gbufrt.compute.cache import reported  # imports the compiler

        given = specimen() if frame is None else frame
        if lacking := [name for name in sorted(self.reads) if given.get(name) is None]:
            raise ValueError(f"frame must be one like those to come, because the pipeline reads {', '.join(lacking)}")
        with torch.no_grad(), reported() as seconds:
            _, state = self(given)
            self(given.replace(index=given.index + 1), state)
        return seconds

    def tunables(self) -> dict[str, Any]:
        """A pipeline has none of its own; see `all_tunables`."""
        return {}

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
        return Pipeline(given=self.given, layer=self.layer, reduction=self.reduction, **stages)


def _run(stages: Iterable[tuple[str, Stage]], frame: Frame, before: Mapping[str, Any]) -> tuple[Frame, dict[str, Any]]:
    """Run stages in order, each on the frame it asks for; neighbours that ask for the same one share it.

    Returns:
        The frame, and the states of those stages that have one, by name.
    """
    after: dict[str, Any] = {}
    for (layer, reduction), group in groupby(stages, key=_place):
        own, together = frame if layer is None else frame.behind, list(group)
        if own is None:
            after |= {name: PipelineState() for name, _ in together}
            continue
        seen = own if reduction is None else reduction.reduce(own)
        for name, stage in together:
            seen, kept = _run_one(stage, seen, before.get(name))
            after |= {} if kept is None else {name: kept}
        if reduction is not None:
            written = (stage._written for _, stage in together if isinstance(stage, Pipeline))
            seen = reduction.restore(own, seen, frozenset().union(*written))
        frame = seen if layer is None else frame.replace(behind=seen)
    return frame, after


def _run_one(stage: Stage, frame: Frame, before: Any) -> tuple[Frame, Any]:
    if isinstance(stage, Pipeline):
        frame, after = _run(stage._stages(), frame, {} if before is None else before.stages)
        return frame, PipelineState(stages=after)
    stage.check(frame)
    return stage(frame, before) if isinstance(stage, TemporalPass) else (stage(frame), None)


def _place(named: tuple[str, Stage]) -> tuple[Literal["behind"] | None, Reduction | None]:
    """The layer and the reduction that a stage runs on."""
    stage = named[1]
    return (stage.layer, stage.reduction) if isinstance(stage, Pipeline) else (None, None)


def _pipeline(name: str, stage: Any) -> Pipeline:
    if not isinstance(stage, Pipeline):
        raise ValueError(f"stage {name!r} is a {type(stage).__name__} and has no stages of its own")
    return stage
