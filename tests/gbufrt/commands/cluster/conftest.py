"""A cluster of two cores, which ends with the tests of this room."""

from __future__ import annotations

import os
import secrets
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

HOLD = """
import sys, ray
ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
print(ray.get_runtime_context().gcs_address, flush=True)
sys.stdin.read()
"""


@pytest.fixture(scope="package")
def holder() -> Iterator[subprocess.Popen[str]]:
    """The process that starts the cluster and says where."""
    if find_spec("ray") is None:
        pytest.skip("Ray is not installed: pip install 'gbufrt[cluster]'")
    token = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(16)}  # read when Ray is imported
    quiet = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0"}
    pipe: Any = subprocess.PIPE
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (token | quiet).items():
            patch.setenv(name, value)
        with subprocess.Popen([sys.executable, "-c", HOLD], stdin=pipe, stdout=pipe, text=True) as process:
            assert process.stdin is not None
            yield process
            process.stdin.close()


@pytest.fixture(scope="package")
def cluster(holder: subprocess.Popen[str]) -> str:
    """The address of the cluster."""
    assert holder.stdout is not None
    return holder.stdout.readline().strip()


@pytest.fixture
def trusted(cluster: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of the cluster, which nothing asks whether it answers: a flight over it has shown that."""
    monkeypatch.setattr("gbufrt.commands.cluster.connection._probe", lambda address: None)
    return cluster


@pytest.fixture
def left_behind() -> Callable[[], list[Path]]:
    """Finds temporary folders of the runs that this process began."""
    return lambda: list(Path(tempfile.gettempdir()).glob(f"gbufrt-{os.getpid()}-*"))
