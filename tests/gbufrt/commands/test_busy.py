"""Busy neighbours, and what is fair beside them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gbufrt.commands import busy
from gbufrt.commands.busy import beside, fair_slowdown


def test_fair_shares():
    assert fair_slowdown(2, 5, 2) == pytest.approx(3.5)  # 2 of 7 threads
    assert fair_slowdown(1, 5, 2) == pytest.approx(3.0)  # 1 of 6, on two cores
    assert fair_slowdown(4, 4, 4) == pytest.approx(2.0)
    assert fair_slowdown(2, 0, 2) == fair_slowdown(2, 3, 8) == 1.0
    assert fair_slowdown(8, 1, 2) == pytest.approx(9 / 8)


def test_neighbours_are_busy_and_end():
    def spent() -> float:
        times = os.times()
        return times.children_user + times.children_system

    before = spent()
    with beside(2):
        time.sleep(0.5)
    assert spent() - before > 0.05


def test_neighbours_end_with_a_parent_that_is_killed():
    code = (
        "import os, time\nfrom gbufrt.commands import busy\n"
        "started = []\nopen_ = busy.subprocess.Popen\n"
        "busy.subprocess.Popen = lambda *a: started.append(open_(*a)) or started[-1]\n"
        "with busy.beside(1):\n    print(started[0].pid, flush=True)\n    time.sleep(0.2)\n    os._exit(1)"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(busy.__file__).parents[2])}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    place = Path(f"/proc/{int(run.stdout)}/cmdline")
    for _ in range(100):
        if not place.exists() or not place.read_bytes():
            return
        time.sleep(0.1)
    raise AssertionError("the neighbour is still busy")
