"""Frames of a pipeline as one CUDA graph: the host then launches a frame at once, instead of thousands of kernels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import torch
from torch import Tensor

from gbufrt.compute.resident import number
from gbufrt.demands.inputs import check_frame
from gbufrt.frame import Frame
from gbufrt.pipeline import Pipeline
from gbufrt.tree import map_tensors

T = TypeVar("T")
RUNS = 3  # before the capture: from the third frame on, states have the form that they keep


class Captured:
    """A pipeline for frames of one form, captured as a CUDA graph. It keeps the history itself.

    Frames of other numbers, cameras, indices and times are replayed. The first one and those with a camera cut run
    without the graph, because passes take more samples where nothing is known. Tensors of a result hold until the next
    call: clone those that are needed for longer. Passes must not be changed afterwards: their tunables are part of the
    graph. There are no gradients.

    Args:
        pipeline: what is captured. It runs over the frame four times.
        frame: one like those to come, on a GPU.

    Raises:
        TypeError: one of them is something else.
        ValueError: the frame is not on a GPU.
    """

    def __init__(self, pipeline: Pipeline, frame: Frame) -> None:
        if not isinstance(pipeline, Pipeline):
            raise TypeError(f"pipeline must be a Pipeline, got {type(pipeline).__name__}")
        check_frame(frame)
        if not _recordable(frame.gbuffer.depth):
            device = frame.gbuffer.depth.device
            raise ValueError(
                f"frame must be on a GPU to be captured, but is on {device}: use the pipeline itself there"
            )
        self.pipeline = pipeline
        self._frame = _copy(_timed(frame.replace(cut=None, previous=None)))
        with torch.no_grad():
            state = None
            for _ in range(RUNS):
                _, state = pipeline(self._frame, state)
            self._state = _copy(state)
            self._replay = _record(self._step, frame.gbuffer.depth)
        self._first = True

    def __call__(self, frame: Frame) -> Frame:
        """The frame after all passes, with the history of those before.

        Raises:
            ValueError: it has another size, batch or device, other channels, or other constants than the one that was
                captured: names the first difference.
        """
        check_frame(frame)
        given = _timed(frame.replace(previous=None))
        _check_alike(given.replace(cut=None), self._frame, "frame")
        with torch.no_grad():
            if self._first or (frame.cut is not None and bool(frame.cut.any())):
                result, after = self.pipeline(given, None if self._first else self._state)
                _write(after, self._state)
                self._first = False
            else:
                _write(given.replace(cut=None), self._frame)
                result = self._replay()
        return result.replace(index=frame.index, time=frame.time, cut=frame.cut)

    def stream(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Each frame after all passes; see `__call__`."""
        return map(self, frames)

    def reset(self) -> None:
        """Forget the history: the next frame is a first one."""
        self._first = True

    def _step(self) -> Frame:
        """What is captured: memory of the inputs and of the state has the same place in every frame."""
        result, after = self.pipeline(self._frame, self._state)
        _write(after, self._state)
        return result


def _recordable(like: Tensor) -> bool:
    """Whether a graph can be captured where a tensor lies."""
    return like.is_cuda


def _record(step: Callable[[], Frame], like: Tensor) -> Callable[[], Frame]:
    """Capture a step where a tensor lies; what is returned repeats it."""
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.device(like.device), torch.cuda.graph(graph):
        result = step()

    def replay() -> Frame:
        with torch.cuda.device(like.device):
            graph.replay()
        return result

    return replay


def _timed(frame: Frame) -> Frame:
    """The frame with its index and time on its device, where a graph reads them anew."""
    whole, real = (frame.gbuffer.depth.new_empty((), dtype=dtype) for dtype in (torch.int64, torch.float64))
    behind = None if frame.behind is None else _timed(frame.behind)
    return frame.replace(index=number(frame.index, whole), time=number(frame.time, real), behind=behind)


def _copy(value: T) -> T:
    """The value with tensors of its own; those that are one tensor stay one."""
    made: dict[int, Tensor] = {}
    return map_tensors(lambda tensor: made.setdefault(id(tensor), tensor.clone()), value)


def _tensors(value: Any) -> list[Tensor]:
    found = list[Tensor]()
    map_tensors(lambda tensor: (found.append(tensor), tensor)[1], value)
    return found


def _write(values: Any, places: Any) -> None:
    """Write the numbers of a value into the tensors of another one of the same form."""
    pairs = {id(place): (value, place) for value, place in zip(_tensors(values), _tensors(places), strict=True)}
    own = {place.untyped_storage().data_ptr() for _, place in pairs.values()}
    moved = [(value, place) for value, place in pairs.values() if value is not place]
    # what lies in the tensors that are written to is saved first
    saved = [value.clone() if value.untyped_storage().data_ptr() in own else value for value, _ in moved]
    for value, (_, place) in zip(saved, moved, strict=True):
        place.copy_(value, non_blocking=True)


def _check_alike(given: Any, known: Any, name: str) -> None:
    """Raise ValueError where a frame differs from the captured one in more than its numbers."""
    if isinstance(known, Tensor) and isinstance(given, Tensor):
        if (given.shape, given.dtype, given.device) != (known.shape, known.dtype, known.device):
            forms = (f"{tuple(x.shape)} {x.dtype} on {x.device}" for x in (known, given))
            raise ValueError(f"{name} must be {' as captured, got '.join(forms)}: capture the pipeline again")
    elif is_dataclass(known) and type(given) is type(known):
        for part in fields(known):
            _check_alike(getattr(given, part.name), getattr(known, part.name), f"{name}.{part.name}")
    elif isinstance(known, dict) and isinstance(given, dict) and known.keys() == given.keys():
        for key, value in known.items():
            _check_alike(given[key], value, f"{name}.{key}")
    elif isinstance(known, Tensor) or isinstance(given, Tensor) or given != known:
        told = ("a tensor" if isinstance(x, Tensor) else repr(x) for x in (known, given))
        raise ValueError(f"{name} must be {' as captured, got '.join(told)}: capture the pipeline again")
