"""Progress on stderr: a bar on a terminal, now and then a line in a log."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gbufrt.compute.cache import Compilation

Tick = Callable[[], None]
LOG_SECONDS = 10.0


class Pace:
    """How long the steps that are left will take, by those that were done.

    The first step of each kind does not count, as it imports, compiles and fills caches, nor does the time in which
    kernels are compiled later. Steps of one kind differ by their numbers alone, such as ``passes of frame 3``.

    Args:
        steps: how many there will be.
    """

    def __init__(self, steps: int) -> None:
        self.steps, self.done, self.kernels, self.compiled = steps, 0, 0, 0.0
        self._last, self._compiled = time.monotonic(), 0.0
        self._kinds: set[str] = set()
        self._taken, self._counted = 0.0, 0

    def compile(self, seconds: float) -> None:
        """A kernel has been compiled."""
        self.kernels += 1
        self.compiled += seconds

    def step(self, what: str) -> None:
        """A step is done."""
        now, kind = time.monotonic(), re.sub(r"\d+", "", what)
        if kind in self._kinds:
            self._taken += max(now - self._last - (self.compiled - self._compiled), 0.0)
            self._counted += 1
        self._kinds.add(kind)
        self._last, self._compiled, self.done = now, self.compiled, self.done + 1
        self.steps = max(self.steps, self.done)  # gaps in a sequence add some

    @property
    def left(self) -> timedelta | None:
        """Time until the end; None there, and while nothing tells it."""
        if not self._counted or self.done >= self.steps:
            return None
        return timedelta(seconds=round(self._taken / self._counted * (self.steps - self.done)))


@contextmanager
def progress(title: str, steps: int) -> Iterator[Callable[[str], Tick]]:
    """Yield a function that takes what is being done and returns a tick, to be called after each step.

    It also reports when kernels are compiled, which slows the first steps after an installation.
    """
    from rich.console import Console

    from gbufrt.compute.cache import watch

    console, pace = Console(stderr=True), Pace(steps)
    if not console.is_terminal:
        log = _Log(title, pace)
        with watch(log.compiling):
            yield log.doing
        return
    with _bar(console) as bar:
        task, now = bar.add_task(title, total=steps, left=""), title

        def doing(what: str) -> Tick:
            nonlocal now
            now = f"{title}: {what}"
            bar.update(task, description=now)

            def tick() -> None:
                pace.step(what)
                bar.update(task, advance=1, left="" if pace.left is None else f"left {pace.left}")

            return tick

        def compiling(compilation: Compilation) -> None:
            if compilation.seconds is not None:
                pace.compile(compilation.seconds)
            bar.update(task, description=f"{now}: {_compiling(pace)}" if compilation.seconds is None else now)

        with watch(compiling):
            yield doing


def _bar(console: Any) -> Any:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, TextColumn("{task.fields[left]}"), console=console)


def _compiling(pace: Pace) -> str:
    from gbufrt.compute.cache import COMPILING

    return f"{COMPILING}; {pace.kernels} done in {pace.compiled:.0f} s" if pace.kernels else COMPILING


class _Log:
    """Lines in a log, one in `LOG_SECONDS` at most, but at once for the first kernel that is compiled."""

    def __init__(self, title: str, pace: Pace) -> None:
        self.title, self.pace = title, pace
        self.said = time.monotonic()
        self.told = False

    def doing(self, what: str) -> Tick:
        def tick() -> None:
            self.pace.step(what)
            left = "" if self.pace.left is None else f", about {self.pace.left} left"
            self._say(f"{what}, step {self.pace.done} of {self.pace.steps}{left}")

        return tick

    def compiling(self, compilation: Compilation) -> None:
        if compilation.seconds is not None:
            self.pace.compile(compilation.seconds)
        else:
            self._say(_compiling(self.pace), at_once=not self.told)
            self.told = True

    def _say(self, line: str, *, at_once: bool = False) -> None:
        now = time.monotonic()
        if at_once or now - self.said >= LOG_SECONDS:
            self.said = now
            print(f"{self.title}: {line}", file=sys.stderr, flush=True)
