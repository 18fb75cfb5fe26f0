"""A cluster: tasks handed to its workers, and their values and files as they come."""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from gbufrt import __version__
from gbufrt.commands.cluster.worker import Failure, Work, not_installed, steps
from gbufrt.files.output import atomic

RETRIES = 3  # of a task whose worker was lost
AHEAD = 2  # steps of a task that may wait to be read: a worker stops there, so that results do not fill the memory
SECONDS_TO_END = 5.0


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Where tasks run.

    Args:
        sizes: cores of each machine.
        each: threads that every worker is to have, or None for an equal share of the cores.
        most: workers that there may be, where the cores allow as many; None for no limit.
    """

    sizes: tuple[int, ...]
    each: int | None = None
    most: int | None = None

    @property
    def workers(self) -> int:
        """How many tasks may run at once."""
        room = sum(size // (self.each or 1) for size in self.sizes)
        return max(min(self.most or room, room), 1)

    def threads(self, tasks: int) -> int:
        """How many threads each worker has for so many tasks: as many as let all run at once, and fit a machine."""
        at_once = min(self.workers, tasks)
        sizes = range(max(self.sizes), 1, -1)
        most = next((n for n in sizes if sum(size // n for size in self.sizes) >= at_once), 1)
        return min(self.each or most, most)

    def run(self, work: Work, tasks: Sequence[Any], *, shared: Any, out: Path) -> Iterator[Any]:
        """Run every task, and yield the values of all as they come, once their files are under ``out``.

        Where a worker is lost, Ray begins its task again and leaves out the steps that have been read before: a task
        must give the same steps each time. An exception of a task ends the run.

        Args:
            work: what to do, see the head of this room.
            tasks: the third of what is given to it, one by one.
            shared: given to every task, and sent to each machine once.
            out: folder to write to.

        Raises:
            ChildProcessError: the workers of one task were lost again and again, or Ray failed.
        """
        import ray

        # The world goes through the object store: a .vox file or a seed would have to be there, and be the same, on
        # every machine, and unpickling the built-in world takes a hundredth of the time that building it does.
        given, threads = ray.put(shared), self.threads(len(tasks))
        prefix = f"gbufrt-{os.getpid()}-{secrets.token_hex(4)}-"
        remote = ray.remote(steps).options(
            num_cpus=threads, num_returns="streaming", max_retries=RETRIES,
            _generator_backpressure_num_objects=AHEAD,
        )  # fmt: skip
        waiting = iter(tasks)

        def begun(count: int) -> list[Any]:
            return [remote.remote(work, given, task, threads, prefix, __version__) for task in islice(waiting, count)]

        running: list[Any] = begun(self.workers)
        try:
            while running:
                done, running = ray.wait(running, num_returns=1)
                ready: Any = done[0]  # a generator whose next step is there
                step = next(ready, None)
                if step is None:
                    running += begun(1)
                    continue
                running.append(ready)  # behind the others, so that all advance
                value, files = _read(step)
                for name, data in files.items():
                    with atomic(out / name) as part:
                        part.write_bytes(data)
                yield value
        finally:
            _end(running, prefix)


def _read(step: Any) -> tuple[Any, dict[str, bytes]]:
    """Value and files of a step; raises the exception of its task."""
    import ray
    from ray import exceptions as e

    lost = (e.WorkerCrashedError, e.NodeDiedError, e.LocalRayletDiedError, e.OutOfMemoryError, e.ObjectLostError)
    try:
        value, files = ray.get(step)
    except e.RayTaskError as error:  # before or after its work, whose own exceptions are values
        if not_installed(error.cause):
            raise ValueError(not_installed(error.cause)) from error
        raise ChildProcessError(f"a worker failed: {type(error.cause).__name__}: {error.cause}") from error
    except e.RayError as error:
        said = (str(error).strip().splitlines() or ["no reason given"])[0]
        if isinstance(error, lost):
            raise ChildProcessError(f"lost {RETRIES + 1} workers over one task ({said}); --resume goes on") from error
        raise ChildProcessError(f"Ray failed: {type(error).__name__}: {said}") from error
    if isinstance(value, Failure):
        raise value.exception()
    return value, files


def _end(running: Sequence[Any], prefix: str) -> None:
    """End the workers of a run that was cut short, and remove folders of killed workers, which cannot do so themselves.

    Only those on this machine: on others they stay.
    """
    import ray

    try:
        for generator in running:
            ray.cancel(generator, force=True)
        if running:
            ray.wait([g.completed() for g in running], num_returns=len(running), timeout=SECONDS_TO_END)
    finally:
        for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
            shutil.rmtree(folder, ignore_errors=True)
