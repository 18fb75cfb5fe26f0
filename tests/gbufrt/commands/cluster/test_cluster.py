"""Tasks on real Ray workers: cores, runs that are cut short, workers that are lost for good."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from gbufrt.commands.arguments.options import ClusterOptions
from gbufrt.commands.cluster.cluster import Cluster
from gbufrt.commands.cluster.connection import open_cluster


def waits(shared: None, task: int, folder: Path) -> Iterator[int]:
    yield task
    (folder / "half.exr").write_bytes(b"half")
    time.sleep(60.0)


def test_a_run_that_is_cut_short_leaves_nothing(trusted: str, left_behind: Callable[[], list[Path]], tmp_path: Path):
    with open_cluster(ClusterOptions(cluster=trusted)) as opened:
        steps: Any = opened.run(waits, [1, 2], shared=None, out=tmp_path)
        next(steps)
        assert left_behind()
        begun = time.monotonic()
        steps.close()
        assert not left_behind()
        assert time.monotonic() - begun < 10, "nobody waits for the workers"


def ends(shared: None, task: int, folder: Path) -> Iterator[int]:
    yield task
    os._exit(1)


def test_a_worker_that_is_lost_again_and_again_is_told(trusted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.cluster.cluster.RETRIES", 0)
    lost = pytest.raises(ChildProcessError, match=r"^lost 1 workers over one task")
    with open_cluster(ClusterOptions(cluster=trusted)) as opened, lost:
        list(opened.run(ends, [1], shared=None, out=tmp_path))


def test_cores_are_shared_out():
    both = Cluster(sizes=(8, 4))
    assert [(both.workers, both.threads(tasks)) for tasks in (100, 4, 1)] == [(12, 1), (12, 2), (12, 8)]
    assert Cluster(sizes=(64, 2)).threads(4) == 16, "the small machine is left out"
    assert Cluster(sizes=(2,), most=8).workers == 2, "no more than the cores allow"
    assert (Cluster(sizes=(8, 4), each=3).workers, Cluster(sizes=(8, 4), each=3).threads(100)) == (3, 3)
    assert (Cluster(sizes=(8,), most=2).workers, Cluster(sizes=(8,), most=2).threads(100)) == (2, 4)
    assert (Cluster(sizes=(2,), each=16).workers, Cluster(sizes=(2,), each=16).threads(9)) == (1, 2)
