"""Background load: processes that keep cores busy, and the fair slowdown beside them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

SPIN = "import os\nwhile os.getppid() == {parent}:\n    sum(range(10000))"  # ends with its parent, however that ends


@contextmanager
def beside(count: int) -> Iterator[None]:
    """Run ``count`` busy single-threaded processes meanwhile."""
    command = [sys.executable, "-S", "-c", SPIN.format(parent=os.getpid())]
    processes = [subprocess.Popen(command) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def cores() -> int:
    """How many cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def fair_slowdown(threads: int, busy: int, cores: int) -> float:
    """How many times longer work of ``threads`` takes beside ``busy`` threads where every thread gets the same share.

    Alone it has ``min(threads, cores)`` cores; beside them ``threads / (threads + busy)`` of all, if cores are scarce.
    """
    alone = min(threads, cores)
    return max(alone * (threads + busy) / (threads * cores), 1.0)
