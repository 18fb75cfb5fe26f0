"""Work on real Ray workers: the same frames and figures as one run's, whatever happens to a worker."""

from __future__ import annotations

import os
import secrets
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import torch

from gbufrt.commands.cli import main
from gbufrt.commands.cluster import Cluster, check_cluster
from gbufrt.commands.flight import cut
from gbufrt.commands.options import ClusterOptions
from gbufrt.files.exr import read_exr

FRAMES, LEAD_IN = 8, 2
FLIGHT = ("render", "terrain", "--size", "24x16", "--preset", "low", "--light-samples", "1", "--warmup", "1")
SHORT = ("--without", "ao.accumulate,gi.accumulate,reflection.accumulate,taa,exposure")  # histories end in two frames
HOLD = """
import sys, ray
ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
print(ray.get_runtime_context().gcs_address, flush=True)
sys.stdin.read()
"""


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as exit:
        main([str(argument) for argument in arguments])
    assert isinstance(exit.value.code, int)
    return exit.value.code


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """The address of a cluster of two cores, which ends with the tests."""
    if find_spec("ray") is None:
        pytest.skip("Ray is not installed: pip install 'gbufrt[cluster]'")
    token = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(16)}  # read when Ray is imported
    quiet = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0"}
    pipe: Any = subprocess.PIPE
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (token | quiet).items():
            patch.setenv(name, value)
        with subprocess.Popen([sys.executable, "-c", HOLD], stdin=pipe, stdout=pipe, text=True) as holder:
            assert holder.stdin is not None
            assert holder.stdout is not None
            yield holder.stdout.readline().strip()
            holder.stdin.close()


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One run without a cluster."""
    out = tmp_path_factory.mktemp("single") / "out"
    assert run(*FLIGHT, *SHORT, "--frames", FRAMES, "--out", out) == 0
    return out


@pytest.fixture(scope="module")
def spread(cluster: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same on two workers."""
    out = tmp_path_factory.mktemp("spread") / "out"
    assert on(cluster, out) == 0
    return out


def on(cluster: str, out: Path, *more: object) -> int:
    where = ("--cluster", cluster, "--workers", 2, "--lead-in", LEAD_IN)
    return run(*FLIGHT, *SHORT, "--frames", FRAMES, *where, "--out", out, *more)


def psnr(a: Path, b: Path, index: int) -> float:
    one, other = (read_exr(folder / f"frame_{index:04d}.exr").read("image").double() for folder in (a, b))
    return -10 * float(torch.log10(((one - other) ** 2).mean()))


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_two_workers_make_what_one_run_makes(single: Path, spread: Path):
    shots = cut(FRAMES, range(FRAMES), workers=2, lead_in=LEAD_IN)
    assert [shot.frames for shot in shots] == [range(0, 5), range(3, 8)]
    assert sorted(contents(spread)) == sorted(contents(single))
    for index in shots[0].wanted:
        assert psnr(single, spread, index) > 90, "the first shot begins as one run does"
    for index in shots[1].wanted:
        assert psnr(single, spread, index) > 50


def workers_at_work() -> list[int]:
    """Worker processes that run a task, on this machine."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if b"ray::_steps" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:  # it has just ended
            continue
    return found


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="finds the worker in /proc")
def test_a_lost_worker_costs_its_shot_alone(
    cluster: str, spread: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    steps: list[str] = []
    killed: list[int] = []
    whole = Cluster.run

    def disturbed(self: Cluster, *arguments: Any, **options: Any) -> Iterator[str]:
        for what in whole(self, *arguments, **options):
            steps.append(what)
            if len(steps) == 3:  # workers are at most two steps ahead of what is read: a shot of five goes on
                killed.append(workers_at_work()[0])
                os.kill(killed[0], signal.SIGKILL)
            yield what

    monkeypatch.setattr(Cluster, "run", disturbed)
    assert on(cluster, tmp_path / "out") == 0
    assert killed
    assert len(steps) == len(set(steps)) == FRAMES + LEAD_IN, "no step comes twice, although it is made twice"
    assert contents(tmp_path / "out") == contents(spread)
