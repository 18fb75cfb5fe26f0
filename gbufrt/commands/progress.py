"""Progress on stderr: a bar on a terminal, now and then a line in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta

Tick = Callable[[], None]
LOG_SECONDS = 10.0


@contextmanager
def progress(title: str, steps: int) -> Iterator[Callable[[str], Tick]]:
    """Gives a function that takes what is being done and returns a tick, to be called after each step."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _log(title, steps)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TextColumn("left"), TimeRemainingColumn(), console=console) as bar:
        task = bar.add_task(title, total=steps)

        def doing(what: str) -> Tick:
            bar.update(task, description=f"{title}: {what}")
            return lambda: bar.advance(task)

        yield doing


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
