"""Work spread over processes and machines by Ray. Only this module imports it, and only when there is work.

Work is a generator function of an installed module, called as ``work(shared, task, folder)`` in a worker process. It
writes files into ``folder``, which is temporary, and yields a value after every step. What it has written by then
travels with the value, as the machine that reads the results may share no disk with the worker.
"""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import shorten
from typing import Any

from gbufrt import __version__
from gbufrt.commands.arguments.checks import START
from gbufrt.commands.arguments.options import ClusterOptions
from gbufrt.commands.busy import cores
from gbufrt.files.output import atomic

Work = Callable[[Any, Any, Path], Iterator[Any]]
RETRIES = 3  # of a task whose worker was lost
AHEAD = 2  # steps of a task that may wait to be read: a worker stops there, so that results do not fill the memory
SECONDS_TO_CONNECT = 30.0
SECONDS_TO_END = 5.0
LAST = (".exr", ".json")  # a frame's EXR and a unit's record say that the rest is there: they are written last
OWN = ("gbufrt", "tracer", "post")
TOLD = (FileNotFoundError, OSError, ValueError, TypeError, MemoryError, OverflowError, RuntimeError)
"""Exceptions that are raised again as what they are, the special before the general; others become RuntimeError."""
PROBE = """
import sys, ray
try:
    ray.init(sys.argv[1], log_to_driver=False, logging_level="ERROR")
except Exception as error:
    while error.__cause__ is not None:
        error = error.__cause__
    sys.exit(str(error))
"""


@dataclass(frozen=True, kw_only=True)
class Failure:
    """An exception of work as plain values: some cannot be pickled, or not be made again from what pickle keeps."""

    kind: type[Exception]
    message: str
    trace: str

    @staticmethod
    def of(error: Exception) -> Failure:
        """The values of an exception that is being handled."""
        trace = traceback.format_exc()
        if _not_installed(error):
            return Failure(kind=ValueError, message=_not_installed(error), trace=trace)
        kind = next((kind for kind in TOLD if isinstance(error, kind)), RuntimeError)
        message = str(error) if type(error) is kind else f"{type(error).__name__}: {error}"
        return Failure(kind=kind, message=message, trace=trace)

    def exception(self) -> Exception:
        """The exception, caused by the worker's traceback."""
        error = self.kind(self.message)
        error.__cause__ = ChildProcessError(f"in the worker:\n{self.trace}")
        return error


def _not_installed(error: object) -> str:
    """What to say where a machine lacks gbufrt; empty for any other error."""
    if isinstance(error, ImportError) and (error.name or "").partition(".")[0] in OWN:
        return f"gbufrt must be installed on all machines of the cluster: {error}"
    return ""


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
            work: what to do, see the head of this module.
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
        remote = ray.remote(_steps).options(
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


@contextmanager
def open_cluster(options: ClusterOptions) -> Iterator[Cluster]:
    """Start Ray here, or connect to it; what was started ends with the block.

    By default there is a worker for every ``OMP_NUM_THREADS`` cores, or for every core.

    Raises:
        ValueError: there is no Ray at the address, or this machine is not part of it.
    """
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if options.cluster != "local":
        _probe(str(options.cluster))
    import ray

    if options.cluster == "local":
        os.environ.setdefault("RAY_worker_niceness", "0")  # 15 by default: beside other processes, workers would starve
        ray.init("local", num_cpus=cores(), include_dashboard=False, **quiet)
    else:
        ray.init(options.cluster, **quiet)
    try:
        sizes = [int(node["Resources"].get("CPU", 0)) for node in ray.nodes() if node["Alive"]]
        wish = os.environ.get("OMP_NUM_THREADS", "")
        each = max(int(wish[:4]), 1) if wish.isdecimal() else None
        yield Cluster(sizes=tuple(size for size in sizes if size) or (1,), each=each, most=options.workers)
    finally:
        ray.shutdown()


def _probe(address: str) -> None:
    """Connect in a process of its own: to what is not Ray, Ray tries for minutes and cannot be interrupted."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", PROBE, address], capture_output=True, text=True, timeout=SECONDS_TO_CONNECT
        )
    except subprocess.TimeoutExpired as error:
        raise ValueError(f"what answers at --cluster {address} is not Ray; {START}") from error
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        said = shorten(said, 300)
        raise ValueError(f"cannot use --cluster {address} from this machine, which must be part of it: {said}")


def _read(step: Any) -> tuple[Any, dict[str, bytes]]:
    """Value and files of a step; raises the exception of its task."""
    import ray
    from ray import exceptions as e

    lost = (e.WorkerCrashedError, e.NodeDiedError, e.LocalRayletDiedError, e.OutOfMemoryError, e.ObjectLostError)
    try:
        value, files = ray.get(step)
    except e.RayTaskError as error:  # before or after its work, whose own exceptions are values
        if _not_installed(error.cause):
            raise ValueError(_not_installed(error.cause)) from error
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


def _steps(
    work: Work, shared: Any, task: Any, threads: int, prefix: str, version: str
) -> Iterator[tuple[Any, dict[str, bytes]]]:
    """Values and files of work, and at last a `Failure` if it fails; its temporary folder begins with ``prefix``."""
    try:
        if version != __version__:
            here = f"{socket.gethostname()} has {__version__}, not {version}"
            raise ValueError(f"all machines of the cluster need the same gbufrt: {here}")
        import torch

        torch.set_num_threads(threads)  # kernels take no more: see gbufrt.compute.threads
        with TemporaryDirectory(prefix=prefix) as name:
            folder = Path(name)
            for value in work(shared, task, folder):
                files = sorted((path for path in folder.rglob("*") if path.is_file()), key=lambda p: p.suffix in LAST)
                yield value, {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
                for path in files:
                    path.unlink()
    except Exception as error:
        yield Failure.of(error), {}
