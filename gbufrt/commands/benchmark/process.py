"""Times and memory of a process, and what machine it ran on."""

from __future__ import annotations

import logging
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

MEGA = 1e6
IMPORT = (
    "import time, torch; begun = time.perf_counter(); import gbufrt, tracer, post; print(time.perf_counter() - begun)"
)
STARTS = 3  # of a process that imports; the quickest counts, because a busy machine can stall one


def timed(run: Callable[[], Any], repeats: int, device: str = "cpu") -> float:
    """Median milliseconds of ``repeats`` runs; one before them does not count."""
    seconds = []
    for _ in range(repeats + 1):
        begun = time.perf_counter()
        run()
        wait(device)
        seconds.append(time.perf_counter() - begun)
    return median(seconds[1:]) * 1e3


def wait(device: str) -> None:
    """Until a device has done its work."""
    if device != "cpu":
        import torch

        torch.cuda.synchronize(device)


def machine() -> str:
    """One line that says what the figures were measured on."""
    import os

    import torch

    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        model = lines[0].partition(":")[2].strip() if lines else model
    gpu = f", {torch.cuda.get_device_name()}" if torch.cuda.is_available() else ""
    return (
        f"{model}, {os.cpu_count()} cores, {torch.get_num_threads()} threads{gpu}; {platform.system()}, "
        f"Python {platform.python_version()}, torch {torch.__version__}"
    )


def peak_memory() -> float | None:
    """Peak memory of this process, in megabytes; None where the system does not report it."""
    status = Path("/proc/self/status")
    if status.exists():  # rusage counts the memory that the process had before it became this program: its parent's
        peak = next((line for line in status.read_text().splitlines() if line.startswith("VmHWM:")), None)
        if peak is not None:
            return int(peak.split()[1]) * 1024 / MEGA
    try:
        import resource
    except ImportError:
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / MEGA


def import_seconds() -> float:
    """Seconds that ``import gbufrt, tracer, post`` takes beyond torch, in a process of its own."""
    command = [sys.executable, "-c", IMPORT]
    return min(float(subprocess.run(command, capture_output=True, text=True, check=True).stdout) for _ in range(STARTS))


def in_own_process(run: Callable[..., Any], *arguments: Any) -> Any:
    """What a function of a module returns, run in a fresh process."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(1, get_context("spawn"), initializer=_be_quiet) as pool:
        return pool.submit(run, *arguments).result()


def _be_quiet() -> None:
    """Ctrl-C ends the child without a traceback; that kernels compile is for the parent to tell."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_DFL)
    logging.getLogger("gbufrt").setLevel(logging.ERROR)
