"""Errors of work on real Ray workers: each is told as what it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gbufrt.commands.arguments.options import ClusterOptions
from gbufrt.commands.cluster.connection import open_cluster


def fails(shared: str, task: int, folder: Path) -> Iterator[int]:
    yield task
    raise FileNotFoundError(f"{shared} does not exist")


def test_an_error_in_a_worker_is_the_users(trusted: str, tmp_path: Path):
    with open_cluster(ClusterOptions(cluster=trusted)) as opened:
        steps = opened.run(fails, [7], shared="world.vox", out=tmp_path)
        assert next(steps) == 7
        with pytest.raises(FileNotFoundError, match=r"^world.vox does not exist$"):
            next(steps)


class TwoError(Exception):
    def __init__(self, one: int, other: int) -> None:
        super().__init__(f"{one} and {other}")


class HolderError(ValueError):
    def __init__(self) -> None:
        super().__init__("holds what cannot be sent")
        self.held = lambda: None


def raises(shared: None, task: str, folder: Path) -> Iterator[int]:
    yield 1
    if task == "import":
        raise ModuleNotFoundError("no module named 'other'", name="other")
    if task == "own":
        raise ModuleNotFoundError("no module named 'tracer.new'", name="tracer.new")
    raise {"two": TwoError(1, 2), "holder": HolderError(), "key": KeyError("depth")}[task]


def test_every_error_in_a_worker_is_told_as_what_it_is(trusted: str, tmp_path: Path):
    told = {
        "two": (RuntimeError, "TwoError: 1 and 2"),
        "holder": (ValueError, "HolderError: holds what cannot be sent"),
        "key": (RuntimeError, "KeyError: 'depth'"),
        "import": (RuntimeError, "ModuleNotFoundError: no module named 'other'"),
        "own": (ValueError, "gbufrt must be installed on all machines of the cluster: no module named 'tracer.new'"),
    }
    with open_cluster(ClusterOptions(cluster=trusted)) as opened:
        for task, (kind, message) in told.items():
            steps = opened.run(raises, [task], shared=None, out=tmp_path)
            next(steps)
            with pytest.raises(kind) as error:
                next(steps)
            assert str(error.value) == message
            assert "in raises" in str(error.value.__cause__)


def test_another_version_on_a_machine_is_told(trusted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.cluster.cluster.__version__", "0.0.1")
    with open_cluster(ClusterOptions(cluster=trusted)) as opened, pytest.raises(ValueError, match=r"not 0\.0\.1"):
        list(opened.run(raises, ["key"], shared=None, out=tmp_path))
