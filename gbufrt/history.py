"""The state that a temporal pass or a pipeline carries from one frame to the next, as a plain value.

A pass leaves the autograd graph in its state; a pipeline detaches it unless told to keep it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.frame import SIGNALS, Frame
from gbufrt.gbuffer import GBuffer, to_function
from gbufrt.numeric import check_kind
from gbufrt.tree import map_tensors, without_graph


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class History:
    """Accumulated signals, how many frames each pixel has accumulated, and the geometry they belong to.

    Args:
        signals: by name, ``(B, C, H, W)``: accumulated values and whatever else the pass needs again (moments...).
        length: ``(B, 1, H, W)`` float: frames accumulated; 0 means nothing here may be used.
        gbuffer: geometry of the frame that the signals belong to, to tell where they are still valid.
    """

    length: Tensor
    signals: Mapping[str, Tensor] = field(default_factory=dict)
    gbuffer: GBuffer | None = None

    def __repr__(self) -> str:
        """Names and shapes in one line: two dozen pictures in full would fill a notebook."""
        length = f"mean length {float(self.length.mean()):.3g}" if self.length.numel() else "handed over"
        return f"History({'; '.join([length, *(f'{name} {tuple(t.shape)}' for name, t in self.signals.items())])})"

    def take(self) -> History:
        """This history, for a pass that reads it once; see `PipelineState.handed_over`."""
        return self

    def to(self, *args: Any, **kwargs: Any) -> History:
        """The history on another device; arguments as `torch.Tensor.to`."""
        return map_tensors(to_function(*args, **kwargs), self)

    def detach(self) -> History:
        """The same numbers without their gradients."""
        return map_tensors(without_graph, self)

    def reset(self, mask: Tensor) -> History:
        """Forget the batch elements where ``mask`` ``(B,)`` is True."""
        _check_mask(mask, len(self.length))
        return replace(self, length=torch.where(mask[:, None, None, None], 0.0, self.length))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PipelineState:
    """The states of a pipeline's stages by name, and the frame before (kept by the outermost pipeline)."""

    stages: Mapping[str, Any] = field(default_factory=dict)
    previous: Frame | None = None
    saw: Mapping[str, str] = field(default_factory=dict)
    """Size and batch of the frames that stages saw, in words."""

    def __repr__(self) -> str:
        """The frame before, and a line for each stage that keeps something, under its dotted name."""
        head = "PipelineState"
        if self.previous is not None:
            g = self.previous.gbuffer
            head += f" after frame {int(self.previous.index)}: {size_text(g)}, {_kind_text(g)}"
        return "\n  ".join([head, *_rows(self.stages)])

    def handed_over(self) -> PipelineState:
        """The same state for a caller that does not need it again: every stage's is let go of once it has been read.

        Old state and new are then not in memory together, nor what is remembered of the frame before and its successor.
        """
        stages = _Once({name: _handed_over(state) for name, state in self.stages.items()})
        return replace(self, stages=stages, previous=None if self.previous is None else _handed_frame(self.previous))

    def check_fits(self, frame: Frame, stages: Collection[str]) -> None:
        """Raise ValueError where the state is of other stages, or of frames of another size, batch, kind or device."""
        if self.saw and not any(name in self.saw for name in stages):
            theirs, ours = ", ".join(self.saw), ", ".join(stages) or "no stages"
            raise ValueError(f"the state is of a pipeline of {theirs}, but this one has {ours}: start with state=None")
        if self.previous is None or not _has_pixels(self.stages):
            return
        before, now = self.previous.gbuffer, frame.gbuffer
        for told, remedy in ((size_text, "start with state=None"), (_kind_text, "convert it with state.to()")):
            if told(before) != told(now):
                raise ValueError(f"the state is of frames of {told(before)}, the frame has {told(now)}; {remedy}")

    def of(self, name: str, frame: Frame, *, prefix: str, nested: bool) -> Any:
        """The state of a stage, None where there is none.

        Args:
            name: of the stage.
            frame: what it is to see.
            prefix: of its name in messages.
            nested: whether it is a pipeline.

        Raises:
            TypeError: the state is of a pipeline and the stage is none, or the other way round.
            ValueError: the stage saw frames of another size or batch, as those of another preset may.
        """
        state, before, now = self.stages.get(name), self.saw.get(name, ""), size_text(frame.gbuffer)
        whose = f"the state of stage {prefix + name!r}"
        if state is not None and isinstance(state, PipelineState) != nested:
            kinds = "a pass, but the stage is a pipeline" if nested else "a pipeline, but the stage is a pass"
            raise TypeError(f"{whose} is of {kinds}: it came from another pipeline; start with state=None")
        if not nested and before not in ("", now) and _has_pixels({name: state}):
            raise ValueError(
                f"{whose} is of frames of {before}, but it sees {now}: another pipeline or preset made it; "
                "start with state=None"
            )
        return state

    def to(self, *args: Any, **kwargs: Any) -> PipelineState:
        """The state on another device; arguments as `torch.Tensor.to`."""
        return map_tensors(to_function(*args, **kwargs), self)

    def detach(self) -> PipelineState:
        """The same numbers without their gradients."""
        return map_tensors(without_graph, self)

    def reset(self, mask: Tensor) -> PipelineState:
        """Forget the batch elements where ``mask`` ``(B,)`` is True."""
        _check_mask(mask, None if self.previous is None else self.previous.gbuffer.camera.batch)
        stages = {name: None if state is None else state.reset(mask) for name, state in self.stages.items()}
        previous = self.previous
        if previous is not None:
            g = previous.gbuffer
            previous = previous.replace(gbuffer=g.replace(hit=g.hit & ~mask[:, None, None, None]))
        return replace(self, stages=stages, previous=previous)


def _check_mask(mask: Any, batch: int | None) -> None:
    if not isinstance(mask, Tensor) or mask.dtype != torch.bool or mask.ndim != 1:
        got = f"{tuple(mask.shape)} {mask.dtype}" if isinstance(mask, Tensor) else type(mask).__name__
        raise TypeError(f"mask must be a (B,) bool tensor, got {got}")
    if len(mask) != (batch or len(mask)):
        raise ValueError(f"mask must be ({batch},) bool, one for each picture, got ({len(mask)},)")


# Plain values of tensors, so that `torch.load` reads states and frames without being told to trust the file.
torch.serialization.add_safe_globals([PipelineState, History, Frame, GBuffer, Camera])


def check_history(gbuffer: Any, history: Any, *signals: str) -> None:
    """Raise unless a function over time was given a G-buffer, and None or a history that its like made.

    Args:
        gbuffer: of this frame.
        history: what the function returned for the frame before.
        signals: what it then holds.

    Raises:
        TypeError: one of them is something else.
        ValueError: the history lacks a signal, so that another function made it.
    """
    check_kind(GBuffer, "gbuffer", gbuffer, "; frame.gbuffer is one")
    if history is None:
        return
    check_kind(History, "history", history, "; pass on what came back beside the result, None on the first frame")
    lacking = [name for name in signals if name not in history.signals]
    if history.gbuffer is not None and lacking:
        held = ", ".join(history.signals) or "nothing"
        raise ValueError(f"history must hold {lacking[0]!r}, got {held}: another pass made it; start with state=None")


class _Handed(History):
    """A history that `take` empties, so that what still refers to it, as all callers of a pass do, keeps no memory."""

    def take(self) -> History:
        taken = History(length=self.length, signals=self.signals, gbuffer=self.gbuffer)
        vars(self).update(length=self.length.new_empty(0), signals={}, gbuffer=None)
        return taken


class _HandedFrame(Frame):
    """A frame before of which `let_go` drops signals, so that all who refer to it keep no memory."""


def _handed_frame(previous: Frame) -> Frame:
    handed = object.__new__(_HandedFrame)  # as `gbufrt.tree.changed`: its fields are checked already
    vars(handed).update(vars(previous))
    return handed


def let_go(previous: Frame | None, names: Collection[str]) -> None:
    """Drop the signals called ``names`` of a frame before that was handed over with its state; of others, nothing."""
    if isinstance(previous, _HandedFrame):
        known = {name: None for name in names if name in SIGNALS}
        extra = {name: tensor for name, tensor in previous.extra.items() if name not in names}
        vars(previous).update(known, extra=extra)


def size_text(g: GBuffer) -> str:
    """Size and batch of a G-buffer, for messages."""
    return f"{g.camera.width}x{g.camera.height} pixels in a batch of {g.batch}"


def _rows(stages: Mapping[str, Any], prefix: str = "") -> list[str]:
    """What stages keep, a line for each of them."""
    rows = list[str]()
    for name, state in stages.items():
        if isinstance(state, PipelineState):
            rows += _rows(state.stages, f"{prefix}{name}.")
        elif state is not None:
            rows.append(f"{prefix}{name}: {state!r}")
    return rows


def _kind_text(g: GBuffer) -> str:
    return f"{str(g.depth.dtype).removeprefix('torch.')} on {g.depth.device}"


def _has_pixels(states: Mapping[str, Any]) -> bool:
    """Whether a stage keeps geometry, and so a history by pixels."""
    return any(
        _has_pixels(state.stages)
        if isinstance(state, PipelineState)
        else isinstance(state, History) and state.gbuffer is not None
        for state in states.values()
    )


def _handed_over(state: Any) -> Any:
    if type(state) is History:
        return _Handed(length=state.length, signals=state.signals, gbuffer=state.gbuffer)
    return state.handed_over() if isinstance(state, PipelineState) else state


class _Once(dict[str, Any]):
    """Entries that `get` removes."""

    def get(self, key: str, default: Any = None) -> Any:
        return self.pop(key, default)
