"""Progress on stderr: a bar on a terminal, now and then a line in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gbufrt.compute.cache import Compilation

Tick = Callable[[], None]
LOG_SECONDS = 10.0


@contextmanager
def progress(title: str, steps: int) -> Iterator[Callable[[str], Tick]]:
    """Yield a function that takes what is being done and returns a tick, to be called after each step.

    It also reports when kernels are compiled, which slows the first step after an installation.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from gbufrt.compute.cache import COMPILING, watch

    console = Console(stderr=True)
    if not console.is_terminal:
        with watch(_log_compiling(title)):
            yield _log(title, steps)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TextColumn("left"), TimeRemainingColumn(), console=console) as bar:
        task, now = bar.add_task(title, total=steps), title

        def doing(what: str) -> Tick:
            nonlocal now
            now = f"{title}: {what}"
            bar.update(task, description=now)
            return lambda: bar.advance(task)

        def compiling(compilation: Compilation) -> None:
            bar.update(task, description=f"{title}: {COMPILING}" if compilation.seconds is None else now)

        with watch(compiling):
            yield doing


def _log_compiling(title: str) -> Callable[[Compilation], None]:
    from gbufrt.compute.cache import COMPILING

    told = False

    def compiling(_: Compilation) -> None:
        nonlocal told
        if not told:
            told = True
            print(f"{title}: {COMPILING}", file=sys.stderr, flush=True)

    return compiling


def _log(title: str, steps: int) -> Callable[[str], Tick]:
    begun = said = time.monotonic()
    done = 0

    def doing(what: str) -> Tick:
        def tick() -> None:
            nonlocal done, said
            done += 1
            now = time.monotonic()
            if now - said >= LOG_SECONDS:
                said = now
                left = timedelta(seconds=round((now - begun) / done * (steps - done)))
                print(f"{title}: {what}, step {done} of {steps}, about {left} left", file=sys.stderr, flush=True)

        return tick

    return doing
