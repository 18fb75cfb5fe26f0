"""Long compilations are told in the log: soon, once, and not where others tell."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gbufrt.compute import cache, kernel, notice
from gbufrt.compute.notice import Notice

SLOW = """
import logging, time
import numba, numpy as np
from gbufrt.compute import cache
from gbufrt.compute.cache import kept, notice, watch

notice.due = 0.01

def squares(out):
    for i in range(len(out)):
        out[i] = i * i

def compiled(kind):
    squares_of = kept(numba.njit(squares))
    with watch(print) if kind == "watched" else watch_nothing():
        squares_of(np.zeros(5, np.float32))

from contextlib import nullcontext as watch_nothing
import sys
compiled(sys.argv[1])
"""


def lines(caplog: pytest.LogCaptureFixture) -> list[tuple[str, str]]:
    return [(record.levelname, record.getMessage()) for record in caplog.records if record.name == "gbufrt"]


def wait_for(condition, seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)


def test_a_single_kernel_that_takes_long_is_told_while_it_compiles(caplog: pytest.LogCaptureFixture):
    caplog.set_level(logging.INFO, "gbufrt")
    notes = Notice(patience=0.05)
    end = notes.begin()
    wait_for(lambda: bool(lines(caplog)))
    ((level, line),) = lines(caplog)
    end()
    assert level == "WARNING"
    assert "compiles kernels, once on this machine" in line
    assert "pipeline.compile()" in line


def test_quick_kernels_are_not_told_but_add_up(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(notice, "LOADED", 0.01)
    notes = Notice(patience=0.2)
    with notes.compiling():
        time.sleep(0.15)
    assert not lines(caplog)
    with notes.compiling():
        wait_for(lambda: bool(lines(caplog)), 0.19)
        assert lines(caplog), "the second takes less than the patience, both together more"


def test_what_is_read_from_a_cache_does_not_count():
    notes = Notice()
    for _ in range(3):
        with notes.compiling():
            pass
    assert (notes.kernels, notes.seconds) == (0, 0.0)


def test_further_lines_are_information_and_rare(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch):
    caplog.set_level(logging.INFO, "gbufrt")
    monkeypatch.setattr(notice, "LOADED", 0.0)
    monkeypatch.setattr(notice, "AGAIN", 0.05)
    notes = Notice(patience=0.0)
    with notes.compiling():
        wait_for(lambda: len(lines(caplog)) == 1)
        time.sleep(0.1)
    with notes.compiling():
        wait_for(lambda: len(lines(caplog)) == 2)
    assert [level for level, _ in lines(caplog)] == ["WARNING", "INFO"]
    assert "1 kernels done" in lines(caplog)[1][1]


def test_where_others_tell_nothing_is_logged(caplog: pytest.LogCaptureFixture):
    notes = Notice(patience=0.0, quiet=lambda: bool(cache._watchers))
    with cache.watch(lambda _: None), notes.compiling():
        time.sleep(0.05)
    assert not lines(caplog)


@pytest.mark.parametrize(("kind", "count"), [("plain", 1), ("watched", 0)])
def test_a_process_without_logging_shows_it_on_stderr(tmp_path: Path, kind: str, count: int):
    (tmp_path / "slow.py").write_text(SLOW)
    env = os.environ | {"PYTHONPATH": str(Path(cache.__file__).parents[2]), "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, str(tmp_path / "slow.py"), kind]
    first, second = (subprocess.run(command, env=env, capture_output=True, text=True, check=True) for _ in range(2))
    assert first.stderr.count("gbufrt compiles kernels") == count
    assert first.stderr.count("\n") == count
    assert second.stderr == "", "from the cache"


def test_kernels_of_gpus_are_counted_when_they_are_first_launched(monkeypatch: pytest.MonkeyPatch):
    told: list[str] = []

    class Launched(dict):
        def __missing__(self, grid: object):
            return lambda *arguments: told.append("launched")

    begun: list[object] = []
    monkeypatch.setattr(kernel, "notice", Notice())
    monkeypatch.setattr(kernel.notice, "begin", lambda: begun.append(1) or (lambda: None))
    one = kernel.Kernel(lambda: None, kernel.CPU)
    one.__dict__["dispatcher"] = Launched()
    for _ in range(3):
        one(grid=(1, 1))
    assert (len(told), len(begun)) == (3, 1)
