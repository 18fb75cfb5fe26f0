"""Whether a frame has what stages read, and what to do where it has not."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Protocol

from gbufrt.frame import LIGHT, SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS
from gbufrt.names import with_article

_remedies: ContextVar[Mapping[str, str]] = ContextVar("_remedies", default={})  # noqa: B039, never written to
LARGER = frozenset(name for name, row in SIGNALS.items() if row.larger)


class Reader(Protocol):
    """The part of `gbufrt.Stage` that matters here."""

    reads: frozenset[str]


def check_frame(frame: Any) -> None:
    """Raise TypeError unless it is a frame."""
    if not isinstance(frame, Frame):
        raise TypeError(f"frame must be a gbufrt.Frame, got {type(frame).__name__}; Frame(gbuffer=..., radiance=...)")


def check_inputs(reads: Collection[str], stages: Iterable[tuple[str, Reader]], frame: Frame) -> None:
    """Raise before any stage runs if the frame lacks what the first of them would miss.

    Args:
        reads: what the frame must bring, because no stage before its reader writes it.
        stages: by dotted name, in order.
        frame: the first one.

    Raises:
        ValueError: names the stage, what it reads, and a remedy.
    """
    lacking = {name for name in reads if frame.get(name) is None}
    for path, stage in stages if lacking else ():
        for name in sorted(lacking & stage.reads):
            told, first = name in _remedies.get(), path.partition(".")[0]
            leave = "" if told else f', or leave the stage out: pipeline.without("{first}")'
            raise ValueError(lacks(f"{path} ({type(stage).__name__})", name) + leave)


def check_inputs_of(stage: Reader, frame: Frame) -> None:
    """Raise ValueError if the frame lacks something that a stage reads, or has its picture at another size."""
    who, camera = type(stage).__name__, frame.gbuffer.camera
    for name in sorted(stage.reads):
        if (tensor := frame.get(name)) is None:
            raise ValueError(lacks(who, name))
        size = tuple(tensor.shape[-2:])
        if name in LARGER and size != camera.size and (geometry := sorted(stage.reads & CHANNELS.keys())):
            raise ValueError(
                f"{who} reads {name!r} of {size[1]}x{size[0]} pixels beside {geometry[0]!r} of {camera.width}x"
                f"{camera.height}: after post.Upscale let it run in Pipeline(reduction=post.Enlarged(), ...)"
            )


def lacks(stage: str, name: str) -> str:
    """The message about a stage whose frame has no ``name``."""
    return f"{stage} reads {name!r}, which the frame lacks: {remedy(name)}"


@contextmanager
def told_with(remedies: Mapping[str, str]) -> Iterator[None]:
    """Inside, `remedy` says of these channels and signals how the one who is told comes by them, who may know no
    Python."""
    token = _remedies.set(remedies)
    try:
        yield
    finally:
        _remedies.reset(token)


def remedy(name: str) -> str:
    """How a frame comes by a channel or signal."""
    if (told := _remedies.get().get(name)) is not None:
        return told
    if name in CHANNELS:
        return f"give the GBuffer {with_article(name)} channel ({CHANNELS[name].meaning})"
    if name in SIGNALS:
        more = "" if name in LIGHT else " or run a pass that writes it"
        return f"give the Frame {name} ({SIGNALS[name].meaning}){more}"
    return "run a pass that writes it"


def warn_if_repeated(frame: Frame, previous: Frame | None) -> None:
    """Warn of a frame that has the index of the one before, where that was no camera cut; asks no GPU for its index."""
    before = None if previous is None else previous.index
    again = isinstance(before, int) and isinstance(frame.index, int) and before == frame.index
    if again and not (frame.cut is not None and bool(frame.cut.all())):
        warnings.warn(
            f"frame index {frame.index} repeats, and with it the noise, so that nothing converges: count the index up, "
            "or use pipeline.settle(frame, runs) for a still",
            stacklevel=3,  # where the pipeline is called
        )
