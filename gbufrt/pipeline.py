"""Pipeline: named stages that run in order.

A pipeline is itself a temporal pass, so pipelines nest.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import groupby
from typing import Any, Literal

import torch
from torch import nn

from gbufrt.compute.memory import return_freed
from gbufrt.demands.inputs import check_frame, check_inputs, warn_if_repeated
from gbufrt.demands.results import returned
from gbufrt.frame import LIGHT, Frame
from gbufrt.gbuffer import CHANNELS
from gbufrt.history import PipelineState, let_go, size_text
from gbufrt.mending import remember, remembering
from gbufrt.names import several
from gbufrt.numeric import check_counts, check_flags
from gbufrt.passes import Branch, Stage, Stages, TemporalPass
from gbufrt.reduction import Place, Reduction
from gbufrt.specimen import specimen

NOISE_PERIOD = 4096  # frames; a multiple of every noise's, so that an index may count down past 0


class Pipeline(Branch):
    """Named stages, run in order.

    Args:
        given: signals that incoming frames already hold, beyond G-buffer channels and light.
        layer: ``"behind"`` runs the stages on ``frame.behind``, where there is one, instead of on the frame.
        reduction: runs the stages on a smaller frame, such as `post.Reduced`. Pipelines that follow one another with
            equal reductions share the smaller frame, which holds only what their stages read or write.
        stages: passes, temporal passes or pipelines by name; None leaves a stage out.

    Raises:
        TypeError: a stage is not a pass.
        ValueError: a stage reads a signal that nothing before it writes.
    """

    def __init__(
        self,
        *,
        given: str | Iterable[str] = (),
        layer: Literal["behind"] | None = None,
        reduction: Reduction | None = None,
        **stages: Stage | None,
    ) -> None:
        super().__init__(stages)
        self.given = frozenset(several("given", given, ("ao", "gi")) if given else ())
        self.place, self._told = Place(layer, reduction), False
        self._connect()

    def _connect(self) -> None:
        """Work out what the pipeline reads and writes, and check that every signal is written before it is read."""
        have, reads, optional, written = set(self.given), set(self.given), set[str](), set[str]()
        for name, stage in self._stages().items():
            for signal in sorted(stage.reads - have):
                if signal not in LIGHT and signal not in CHANNELS:
                    raise ValueError(
                        f"{name} ({type(stage).__name__}) reads {signal!r}, but no stage before it writes that: "
                        f"add one, or pass given={{{signal!r}}} if the frames hold it already"
                    )
                reads.add(signal)
            optional |= stage.optional - have
            written |= stage.writes
            have |= stage.writes
        layer = [] if self.place.layer is None else [self.place.layer]
        self.names = frozenset(layer).union(*(_names(stage) for stage in self._stages().values()))
        if not layer:  # stages on another layer do not read or write this frame's signals
            self.reads, self.optional = frozenset(reads), frozenset(optional - reads)
            self.recalls = frozenset().union(*(stage.recalls for stage in self._stages().values()))
            self.writes = self.place.returned(written)

    def __call__(
        self, frame: Frame, state: PipelineState | None = None, *, keep_graph: bool = False
    ) -> tuple[Frame, PipelineState]:
        """`forward`; each stage contains non-finite pixels itself."""
        check_frame(frame)
        check_flags(keep_graph=keep_graph)
        if not isinstance(state, PipelineState | None):
            raise TypeError(f"state must be None or what the pipeline returned with it, got {type(state).__name__}")
        check_inputs(self.reads, self.passes(), frame)
        if state is not None:
            state.check_fits(frame, self._stages())
        warn_if_repeated(frame, None if state is None else state.previous)
        self._tell_what_is_left_out(frame)
        return nn.Module.__call__(self, frame, state, keep_graph=keep_graph)

    def forward(
        self, frame: Frame, state: PipelineState | None = None, *, keep_graph: bool = False
    ) -> tuple[Frame, PipelineState]:
        """Run every stage. ``frame.previous`` is filled from the state; ``frame.cut`` resets what may not be kept.

        The state comes back detached, so that neither gradients nor memory reach past one frame. ``keep_graph`` leaves
        its graph in place, for gradients through time: memory then grows with every frame.

        Warns:
            UserWarning: the frame has the index of the one before, and so its noise, without a camera cut.
        """
        if state is not None and frame.cut is not None and bool(frame.cut.any()):
            state = state.reset(frame.cut)
        if state is not None and frame.previous is None:
            frame = frame.replace(previous=state.previous)
        return_freed(frame.gbuffer.depth)
        with remembering(frame, self.names):
            seen, inside = self.place.enter(frame, self.names), PipelineState()
            if seen is not None:
                seen, inside = self._inside(seen, state or inside, self._recalled())
                frame = self.place.leave(frame, seen, self._written())
            previous = remember(frame.as_previous(self.recalls))
        state = PipelineState(stages=inside.stages, previous=previous, saw=inside.saw)
        return frame.replace(previous=None), state if keep_graph else state.detach()

    def stream(self, frames: Iterable[Frame], *, keep_graph: bool = False) -> Iterator[Frame]:
        """Run over consecutive frames, threading the state; ``keep_graph`` as in `forward`."""
        if not isinstance(frames, Iterable):
            raise TypeError(f"frames must be frames in order, got a {type(frames).__name__}; stream([frame])")
        state = None
        for frame in frames:
            given, state = None if state is None else state.handed_over(), None
            result, state = self(frame, given, keep_graph=keep_graph)
            yield result
            del result, given  # or they would be in memory beside the next

    def settle(
        self, frame: Frame, runs: int = 4, *, tick: Callable[[], None] = lambda: None
    ) -> tuple[Frame, PipelineState]:
        """Run over a still until its history is full: as over so many frames of a world and a camera that stand still.

        Every run has its own noise, that of the frames before, and the last one the noise of ``frame``; running the
        same frame again by hand would repeat one noise, and not converge.

        Args:
            frame: the still, or the first frame of a sequence; `Frame.still` of it is what the passes see.
            runs: how many; the command line's ``--warmup`` counts those before the last.
            tick: called after each run.

        Returns:
            The finished frame, with the motion that it came with; and the state to go on from.

        Raises:
            ValueError: runs is below 1.
        """
        check_frame(frame)
        check_counts(runs=runs)
        if runs < 1:
            raise ValueError(f"runs must be at least 1, got {runs}")
        still, state, result = frame.still(), None, frame
        for before in range(runs - 1, -1, -1):
            index = (frame.index - before) % NOISE_PERIOD if before else frame.index
            given, state = None if state is None else state.handed_over(), None
            result, state = self(still.replace(index=index), given)
            tick()
        assert state is not None
        return result.moving_as(frame), state

    def compile(self, frame: Frame | None = None) -> dict[str, float]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Compile, ahead of time, all kernels that the passes run on the CPU without gradients.

        Otherwise each is compiled when it is first called. They serve every size, and are cached: where all are there,
        they are loaded in a moment. Stderr says what is compiled. To reach every kernel, the pipeline runs over a frame
        twice, without a history and with one; nothing of that is kept.

        `torch.compile` is not used: it gained nothing for a minute of compilation, and more for every further size.

        Args:
            frame: one like those to come, of any size; by default a small one with all that the tracer gives.

        Returns:
            Seconds by kernel, of those that the cache lacked.

        Raises:
            ValueError: the pipeline reads a signal that the default frame lacks.
        """
        from gbufrt.compute.cache import reported  # imports the compiler

        check_frame(given := specimen() if frame is None else frame)
        if lacking := [name for name in sorted(self.reads) if given.get(name) is None]:
            raise ValueError(f"frame must be one like those to come, because the pipeline reads {', '.join(lacking)}")
        with torch.no_grad(), reported() as seconds:
            _, state = self(given)
            self(given.replace(index=given.index + 1), state)
        return seconds

    def _tell_what_is_left_out(self, frame: Frame) -> None:
        """Warn of it, once a pipeline."""
        left_out, written = list[str](), set[str]()
        for name, stage in () if self._told else self.passes():
            left_out += [f"{name}: {what}" for what in stage.left_out(frame, written)]
            written |= stage.writes
        self._told = True
        if left_out:
            warnings.warn(f"{'; '.join(left_out)} (told once a pipeline)", stacklevel=3)

    def _written(self) -> set[str]:
        """What the stages write on the frame that they see."""
        return {signal for stage in self._stages().values() for signal in stage.writes}

    def _recalled(self, prefix: str = "") -> dict[str, str]:
        """By each signal of the frame before, the dotted name of the last pass that reads it."""
        last = dict[str, str]()
        for name, stage in self._stages().items():
            path = prefix + name
            last |= stage._recalled(f"{path}.") if isinstance(stage, Pipeline) else dict.fromkeys(stage.recalls, path)
        return last if self.place.layer is None else {}  # another layer has no frame before

    def _inside(
        self, frame: Frame, state: PipelineState, last: Mapping[str, str], prefix: str = ""
    ) -> tuple[Frame, PipelineState]:
        """Run the stages in order, each on the frame it asks for; neighbours that ask for the same one share it."""
        after, saw = dict[str, Any](), dict[str, str]()
        for place, group in groupby(self._stages().items(), key=lambda named: _place(named[1])):
            stages = dict(group)
            seen = place.enter(frame, frozenset().union(*map(_names, stages.values())))
            if seen is None:
                continue
            for name, stage in stages.items():
                before = state.of(name, seen, prefix=prefix, nested=isinstance(stage, Pipeline))
                if isinstance(stage, Pipeline):
                    seen, after[name] = stage._inside(seen, before or PipelineState(), last, f"{prefix}{name}.")
                    continue
                stage.check(seen)
                if isinstance(stage, TemporalPass):
                    seen, after[name] = returned(name, stage, stage(seen, before), temporal=True)
                else:
                    seen, _ = returned(name, stage, stage(seen), temporal=False)
                let_go(seen.previous, [signal for signal, path in last.items() if path == prefix + name])
            saw |= dict.fromkeys(stages, size_text(seen.gbuffer))
            pipelines = (stage for stage in stages.values() if isinstance(stage, Pipeline))
            frame = place.leave(frame, seen, {signal for pipeline in pipelines for signal in pipeline._written()})
        return frame, PipelineState(stages=after, saw=saw)

    def _with(self, stages: Stages) -> Pipeline:
        return Pipeline(given=self.given, layer=self.place.layer, reduction=self.place.reduction, **stages)


def _place(stage: Stage) -> Place:
    return stage.place if isinstance(stage, Pipeline) else Place()


def _names(stage: Stage) -> frozenset[str]:
    """All that a stage reads or writes, inside of it too."""
    return stage.names if isinstance(stage, Pipeline) else stage.reads | stage.optional | stage.writes
