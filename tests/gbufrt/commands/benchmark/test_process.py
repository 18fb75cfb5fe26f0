"""Times and memory of a process."""

from __future__ import annotations

import logging
import subprocess
import sys

import pytest

from gbufrt.commands.benchmark import process

HELD = 300_000_000  # bytes


def test_the_peak_of_a_process_is_not_its_parents():
    code = "from gbufrt.commands.benchmark.process import peak_memory; print(peak_memory())"
    held = bytearray(b"x") * HELD
    own = process.peak_memory()
    assert own is not None
    assert own > len(held) / 1e6
    del held
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert 5 < float(child) < HELD / 1e6


def test_seconds_of_an_import_are_those_beyond_torch(monkeypatch: pytest.MonkeyPatch):
    outputs = iter(["0.9", "0.4", "0.7"])
    monkeypatch.setattr(
        process.subprocess, "run", lambda *a, **k: subprocess.CompletedProcess(a, 0, stdout=next(outputs))
    )
    assert process.import_seconds() == 0.4
    assert process.IMPORT.index("import time, torch") < process.IMPORT.index("begun") < process.IMPORT.index("gbufrt")


def test_a_process_of_its_own_leaves_it_to_the_parent_to_tell_what_compiles():
    level = process.in_own_process(eval, "__import__('logging').getLogger('gbufrt').level")
    assert level == logging.ERROR
