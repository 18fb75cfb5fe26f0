"""Run a pipeline over frames, and measure the time and memory of each pass."""

from __future__ import annotations

import time
import weakref
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from gbufrt.commands.profile import around_passes
from gbufrt.frame import Frame
from gbufrt.pipeline import Pipeline

WARM = 2  # frames before times count: kernels compile, caches fill
MEGA = 1e6


@dataclass(kw_only=True)
class Run:
    """What came out of a pipeline."""

    frames: list[Frame] = field(default_factory=list)
    """The last ones, oldest first."""
    at: dict[int, Frame] = field(default_factory=dict)
    """Those asked for by their number, from 0."""
    passes: dict[str, dict[str, float]] = field(default_factory=dict)
    """Of each pass ``ms`` (median) and ``peak_mb`` (most tensor memory beyond what it was given)."""

    @property
    def last(self) -> Frame:
        """The last frame."""
        return self.frames[-1]

    @property
    def ms(self) -> float:
        """Milliseconds of all passes together."""
        return sum(cost["ms"] for cost in self.passes.values())


def run(
    pipeline: Pipeline,
    frames: Iterable[Frame],
    *,
    keep: int = 1,
    at: Collection[int] = (),
    tick: Callable[[], Any] = lambda: None,
) -> Run:
    """Send frames through a pipeline from an empty history.

    Args:
        pipeline: what to run.
        frames: in order; at least one. The last is measured for memory, not time, unless it is the only one.
        keep: how many of the last results to keep.
        at: numbers, from 0, of further results to keep.
        tick: called after each frame.
    """
    result, state, waiting = Run(), None, iter(frames)
    frame = next(waiting, None)
    if frame is None:
        raise ValueError("frames must hold at least one frame")
    spent: dict[str, list[float]] = defaultdict(list)
    held: dict[str, float] = {}
    number = 0
    while frame is not None:
        following = next(waiting, None)
        watch = _timed(pipeline, spent) if following is not None or not spent else _weighed(pipeline, held)
        with torch.no_grad(), watch:  # the last frame is measured for memory, not time: counting memory is slow
            after, state = pipeline(frame, state)
        result.frames = [*result.frames, after][-keep:]
        if number in at:
            result.at[number] = after
        number += 1
        tick()
        frame = following
    for name, times in spent.items():
        result.passes[name] = {"ms": median(times[WARM:] or times) * 1e3, "peak_mb": held.get(name, 0.0)}
    return result


def repeated(frame: Frame, count: int) -> Iterator[Frame]:
    """The same frame ``count`` times; only its index, and so the noise, changes."""
    for index in range(count):
        yield frame.replace(index=index)


@contextmanager
def _timed(pipeline: Pipeline, spent: dict[str, list[float]]) -> Iterator[None]:
    with around_passes(pipeline, lambda _: time.perf_counter(), lambda n, t: spent[n].append(time.perf_counter() - t)):
        yield


@contextmanager
def _weighed(pipeline: Pipeline, held: dict[str, float]) -> Iterator[None]:
    def begin(_: str) -> Allocations:
        watch = Allocations()
        watch.__enter__()
        return watch

    def end(name: str, watch: Allocations) -> None:
        watch.__exit__(None, None, None)
        held[name] = watch.peak / MEGA

    with around_passes(pipeline, begin, end):
        yield


class Allocations(TorchDispatchMode):
    """Counts the bytes of tensors made while it is on, and the most that were alive at once."""

    def __init__(self) -> None:
        super().__init__()
        self.live, self.peak = 0, 0
        self.known: set[int] = set()

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        """Run the operation, and count the memory behind its results once."""
        out = func(*args, **(kwargs or {}))
        given = {t.untyped_storage()._cdata for t in tree_leaves((args, kwargs)) if isinstance(t, Tensor)}
        for tensor in tree_leaves(out):
            if isinstance(tensor, Tensor):
                storage = tensor.untyped_storage()
                if storage._cdata not in self.known and storage._cdata not in given:
                    self._count(storage)
        return out

    def _count(self, storage: torch.UntypedStorage) -> None:
        size, key = storage.nbytes(), storage._cdata
        self.known.add(key)
        self.live += size
        self.peak = max(self.peak, self.live)
        weakref.finalize(storage, self._forget, key, size)

    def _forget(self, key: int, size: int) -> None:
        self.known.discard(key)
        self.live -= size
