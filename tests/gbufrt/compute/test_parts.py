"""Helpers become machine code as part of their driver, and other users of numba get what they always got."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from llvmlite.binding import get_host_cpu_features
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary

from gbufrt.compute.kernel import driver, scalar
from gbufrt.compute.parts import _Whole
from gbufrt.compute.target import Target


@scalar
def _twice(x: float) -> float:
    return 2.0 * x


@scalar
def _shifted(x: float) -> float:
    return _twice(x) + 1.0


def _fill(out: np.ndarray, threads: int) -> None:
    for t in numba.prange(threads):
        for i in range(t, len(out), threads):
            out[i] = _shifted(float(i))


def test_all_that_a_driver_calls_becomes_machine_code_once(monkeypatch):
    made = []
    of_numba = JITCodeLibrary._finalize_specific  # ends with machine code

    def finalized(library):
        if library.name != "nrt":  # numba's own, once a process
            made.append(library.name)
        of_numba(library)

    monkeypatch.setattr(JITCodeLibrary, "_finalize_specific", finalized)
    out = np.zeros(5)
    kernel = driver(_fill)
    monkeypatch.setattr(kernel.dispatcher, "_cache", NullCache())  # keeps nothing
    kernel(out, 2)
    assert out.tolist() == [1.0, 3.0, 5.0, 7.0, 9.0]
    assert len(made) == 1
    assert "_fill" in made[0]


def _double(rows: np.ndarray, threads: int) -> None:
    for t in numba.prange(threads):
        row = rows[t]
        for i in range(row.shape[0]):
            row[i] = row[i] + row[i]


def test_loops_become_the_widest_vectors_of_the_cpu(monkeypatch):
    if not get_host_cpu_features().get("avx512vbmi2"):
        pytest.skip("not a CPU for which LLVM takes half of its vectors")
    code, of_numba = [], _Whole._finalize_specific

    def finalized(library):
        code.append(str(library._final_module))
        of_numba(library)

    monkeypatch.setattr(_Whole, "_finalize_specific", finalized)
    kernel, rows = driver(_double), np.ones((1, 64), np.float32)
    monkeypatch.setattr(kernel.dispatcher, "_cache", NullCache())
    kernel(rows, 1)
    assert "<16 x float>" in code[0]
    assert (rows == 2).all()


def test_functions_compiled_after_a_driver_can_be_called():
    driver(_fill)(np.zeros(5), 1)
    assert numba.njit(lambda x: max(x, 1.0) + abs(x))(-2.0) == 3.0


def test_machine_code_of_an_older_compiler_is_not_taken_from_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def name(rounds: int) -> str:
        source = f"from numba.core.compiler import Compiler\n\nclass Rounds(Compiler):\n    ROUNDS = {rounds}\n"
        Path(tmp_path, "rounds.py").write_text(source)
        importlib.invalidate_caches()
        monkeypatch.delitem(sys.modules, "rounds", raising=False)
        options = {"pipeline_class": importlib.import_module("rounds").Rounds}
        target = Target(numba.njit, helper=options, owner={}, within={}, entry={}, driver={})
        return target.compile(_fill, None, "fill").py_func.__qualname__

    monkeypatch.syspath_prepend(tmp_path)
    assert name(1) != name(22)
