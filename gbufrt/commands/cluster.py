"""Work spread over processes and machines by Ray. Only this module imports it, and only when there is work.

Work is a generator function of an installed module, called as ``work(shared, task, folder)`` in a worker process. It
writes files into ``folder``, which is temporary, and yields a value after every step. What it has written by then
travels with the value, as the machine that reads the results may share no disk with the worker.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import shorten
from typing import Any

from gbufrt.commands.busy import cores
from gbufrt.commands.options import ClusterOptions, at_least
from gbufrt.files.output import atomic

Work = Callable[[Any, Any, Path], Iterator[Any]]
MOST_WORKERS = 65536
RETRIES = 3  # of a task whose worker was lost
AHEAD = 2  # steps of a task that may wait to be read: a worker stops there, so that results do not fill the memory
SECONDS_TO_ANSWER = 5.0
SECONDS_TO_CONNECT = 30.0
START = "start Ray with `ray start --head` and give the address that it prints"
LAST = (".exr", ".json")  # a frame's EXR and a unit's record say that the rest is there: they are written last
PROBE = """
import sys, ray
try:
    ray.init(sys.argv[1], log_to_driver=False, logging_level="ERROR")
except Exception as error:
    while error.__cause__ is not None:
        error = error.__cause__
    sys.exit(str(error))
"""


def check_cluster(options: ClusterOptions, *, device: str = "cpu") -> None:
    """Check the options, and whether anything answers at the address; imports neither torch nor Ray.

    Raises:
        ValueError: they make no sense together, Ray is not installed, or nothing answers.
    """
    address = options.cluster
    if address is None:
        if options.workers is not None:
            raise ValueError("--workers is for --cluster; give --cluster local, or leave --workers out")
        return
    if options.workers is not None:
        at_least("--workers", options.workers, 1, MOST_WORKERS)
    host, _, port = address.rpartition(":")
    if address != "local" and not (host and "/" not in host and port.isdecimal() and 0 < int(port[:6]) < 65536):
        raise ValueError(f"--cluster must be local or HOST:PORT, such as 192.168.1.5:6379, got {address!r}")
    if device != "cpu":
        raise ValueError(f"--cluster computes on CPUs: leave out --device {device}")
    if find_spec("ray") is None:
        raise ValueError("--cluster needs Ray: pip install 'gbufrt[cluster]'")
    if address != "local":
        try:
            socket.create_connection((host.strip("[]"), int(port)), SECONDS_TO_ANSWER).close()
        except OSError as error:
            reason = error.strerror or str(error)
            raise ValueError(f"nothing answers at --cluster {address} ({reason}); {START}") from error


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Where tasks run.

    Args:
        sizes: cores of each machine.
        each: threads that every worker is to have, or None for an equal share of the cores.
        most: workers that there may be, or None for what the cores allow.
    """

    sizes: tuple[int, ...]
    each: int | None = None
    most: int | None = None

    @property
    def workers(self) -> int:
        """How many tasks may run at once."""
        return self.most or max(sum(size // (self.each or 1) for size in self.sizes), 1)

    def threads(self, tasks: int) -> int:
        """How many threads each worker has for so many tasks."""
        wanted = self.each or sum(self.sizes) // max(min(self.workers, tasks), 1)
        return max(min(wanted, *self.sizes), 1)  # a task that fits no machine would wait for ever

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
            ChildProcessError: the workers of one task were lost again and again.
        """
        import ray

        # The world goes through the object store: a .vox file or a seed would have to be there, and be the same, on
        # every machine, and unpickling the built-in world takes a hundredth of the time that building it does.
        given, threads = ray.put(shared), self.threads(len(tasks))
        remote = ray.remote(_steps).options(
            num_cpus=threads, num_returns="streaming", max_retries=RETRIES,
            _generator_backpressure_num_objects=AHEAD,
        )  # fmt: skip
        waiting = iter(tasks)

        def begun(count: int) -> list[Any]:
            return [remote.remote(work, given, task, threads) for task in islice(waiting, count)]

        running: list[Any] = begun(self.workers)
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
    """Value and files of a step, or the exception of its task as it was raised."""
    import ray
    from ray.exceptions import RayError, RayTaskError

    try:
        return ray.get(step)
    except RayTaskError as error:
        if isinstance(error.cause, ImportError):
            raise ValueError(f"gbufrt must be installed on all machines of the cluster: {error.cause}") from error
        raise error.cause from None
    except RayError as error:
        said = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise ChildProcessError(f"lost {RETRIES + 1} workers over one task ({said}); --resume goes on") from error


def _steps(work: Work, shared: Any, task: Any, threads: int) -> Iterator[tuple[Any, dict[str, bytes]]]:
    """Values and files of work, in a worker process."""
    import torch

    torch.set_num_threads(threads)  # kernels take no more: see gbufrt.compute.threads
    with TemporaryDirectory(prefix="gbufrt-") as name:
        folder = Path(name)
        for value in work(shared, task, folder):
            files = sorted((path for path in folder.rglob("*") if path.is_file()), key=lambda p: p.suffix in LAST)
            yield value, {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
            for path in files:
                path.unlink()
