"""Starting Ray on this machine, or connecting to a cluster that runs."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from textwrap import shorten
from typing import Any

from gbufrt.commands.arguments.checks import START
from gbufrt.commands.arguments.options import ClusterOptions
from gbufrt.commands.busy import cores
from gbufrt.commands.cluster.cluster import Cluster

SECONDS_TO_CONNECT = 30.0

PROBE = """
import sys, ray
try:
    ray.init(sys.argv[1], log_to_driver=False, logging_level="ERROR")
except Exception as error:
    while error.__cause__ is not None:
        error = error.__cause__
    sys.exit(str(error))
"""


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
