"""What runs in a worker: the steps of a task with their files, and failures as values that can be sent."""

from __future__ import annotations

import socket
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from gbufrt import __version__

Work = Callable[[Any, Any, Path], Iterator[Any]]
LAST = (".exr", ".json")  # a frame's EXR and a unit's record say that the rest is there: they are written last
OWN = ("gbufrt", "tracer", "post")
TOLD = (FileNotFoundError, OSError, ValueError, TypeError, MemoryError, OverflowError, RuntimeError)
"""Exceptions that are raised again as what they are, the special before the general; others become RuntimeError."""


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
        if not_installed(error):
            return Failure(kind=ValueError, message=not_installed(error), trace=trace)
        kind = next((kind for kind in TOLD if isinstance(error, kind)), RuntimeError)
        message = str(error) if type(error) is kind else f"{type(error).__name__}: {error}"
        return Failure(kind=kind, message=message, trace=trace)

    def exception(self) -> Exception:
        """The exception, caused by the worker's traceback."""
        error = self.kind(self.message)
        error.__cause__ = ChildProcessError(f"in the worker:\n{self.trace}")
        return error


def not_installed(error: object) -> str:
    """What to say where a machine lacks gbufrt; empty for any other error."""
    if isinstance(error, ImportError) and (error.name or "").partition(".")[0] in OWN:
        return f"gbufrt must be installed on all machines of the cluster: {error}"
    return ""


def steps(
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
