"""How bodies find their helpers, and what the machine code that is kept of them depends on."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import pytest
import torch

from gbufrt.compute.bodies import WIDTH, contracted, in_lanes, inlined, is_scalar, scalar, specialized
from gbufrt.compute.each import Each
from gbufrt.compute.fingerprint import fingerprint
from gbufrt.compute.kernel import CPU
from gbufrt.compute.target import Target

HELPERS = """
from gbufrt.compute.kernel import scalar
STEP = 2.0
@scalar
def twice(x):
    '''A docstring.'''
    return {twice}
@scalar
def unused(x):
    return {unused}
"""
BODIES = """
from gbufrt.compute.kernel import scalar
import {name}_helpers as other
from {name}_helpers import twice
@scalar
def body(i, out):
    out[i] = twice(out[i]) + other.{constant}
"""
RUN = """
import sys, torch
from gbufrt.compute.each import Each
from gbufrt.compute.kernel import CPU
from gbufrt.compute.target import Target
for folder in sys.argv[1:]:
    sys.path.insert(0, folder)
    sys.modules.pop("some_bodies", None), sys.modules.pop("some_helpers", None)
    from some_bodies import body
    each, out = Each(body), torch.arange(4.0)
    each(4, out)
    print(each.on_cpu.misses, *out.tolist())
"""


def write(folder: Path, name: str = "some", *, twice: str = "2 * x", unused: str = "x", constant: str = "STEP") -> None:
    folder.mkdir(exist_ok=True)
    (folder / f"{name}_helpers.py").write_text(HELPERS.format(twice=twice, unused=unused))
    (folder / f"{name}_bodies.py").write_text(BODIES.format(name=name, constant=constant))


def run(*folders: Path) -> list[list[float]]:
    """How often a process of its own compiled the body of each folder, and what that made of 0, 1, 2 and 3."""
    command = [sys.executable, "-c", RUN, *map(str, folders)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [[float(x) for x in line.split()] for line in done.stdout.splitlines()]


def test_a_helper_edited_in_another_file_is_compiled_anew_and_nothing_else_is(tmp_path: Path) -> None:
    seed = int.from_bytes(str(tmp_path).encode(), "big") % 10007  # nobody else's cache has this code
    first, same, other = (tmp_path / name for name in ("first", "same", "other"))
    write(first, twice=f"2 * x + {seed}")
    write(same, twice=f"2 * x + {seed}  # the same", unused="x + 1")
    write(other, twice=f"3 * x + {seed}")
    doubled = [seed + 2 * x + 2 for x in range(4)]
    assert run(first) == [[1, *doubled]]
    assert run(first, same, other) == [[0, *doubled], [0, *doubled], [1, *(seed + 3 * x + 2 for x in range(4))]]


def test_fingerprints_change_with_code_and_constants_that_are_reached() -> None:
    def made(value: Any) -> FunctionType:
        space: dict[str, Any] = {"scalar": scalar, "VALUE": value, "__name__": "made"}
        exec("@scalar\ndef body(i, out):\n    out[i] = VALUE\n", space)
        return space["body"]

    values = [1, 1.0, True, np.float32(1), (1, 2), (1, (2,)), np.arange(3), np.arange(3.0), np.arange(4), int, float]
    found = [fingerprint(made(value)) for value in values]
    assert len(set(found)) == len(values)
    assert [fingerprint(made(value)) for value in values] == found
    with pytest.raises(TypeError, match=r"made.body names .* of type dict: compiled code may name numbers"):
        fingerprint(made({}))


@scalar
def one_by_one(x):
    return 10.0 * x


@in_lanes(one_by_one)
def side_by_side(x):
    return 2.0 * x


def item(x: float) -> float:
    """Placeholder for the body below."""
    return x


@scalar
def changed(i, out):
    out[i] = item(out[i])


def test_a_target_of_one_lane_takes_the_form_that_works_alone() -> None:
    def plain(**_: Any) -> Any:
        return lambda function: function

    options: Any = {name: {} for name in ("helper", "owner", "within", "entry", "driver")}
    body = specialized(changed, side_by_side)
    for lanes, want in ((1, 30.0), (WIDTH, 6.0)):
        out = [3.0]
        Target(plain, lanes=lanes, **options).bind(body)(0, out)
        assert out == [want]
    assert body.__name__ == "side_by_side_changed"
    assert len({fingerprint(specialized(changed, form)) for form in (one_by_one, side_by_side)}) == 2


def test_fingerprints_change_with_the_form_that_works_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    body = specialized(changed, side_by_side)
    before = fingerprint(body)
    monkeypatch.setattr(one_by_one, "__code__", (lambda x: 11.0 * x).__code__)
    assert fingerprint(body) != before


def test_bodies_are_plain_functions_that_call_marked_functions_only(tmp_path: Path, monkeypatch) -> None:
    write(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    bodies, helpers = importlib.import_module("some_bodies"), importlib.import_module("some_helpers")
    out = [5.0]
    bodies.body(0, out)
    assert out == [12.0]
    assert is_scalar(helpers.twice)
    monkeypatch.setattr(bodies, "twice", lambda x: x)
    with pytest.raises(TypeError, match=r"some_bodies.body names <lambda> of type function: .* marked with @scalar"):
        fingerprint(bodies.body)


def test_a_body_must_not_close_over_anything() -> None:
    offset = 1.0

    @scalar
    def body(i, out):
        out[i] = offset

    with pytest.raises(TypeError, match="must not close over variables to be compiled, but does over offset"):
        Each(body)(1, torch.zeros(1))


@scalar
def uses_thrice(x):
    return thrice(x)


@scalar
def thrice(x):
    return 3 * x


@pytest.mark.parametrize("mark", [inlined, contracted])
def test_a_marked_helper_is_scalar_and_the_key_says_how_it_is_marked(mark, monkeypatch: pytest.MonkeyPatch) -> None:
    before = fingerprint(uses_thrice)
    monkeypatch.setitem(thrice.__dict__, f"__{mark.__name__}__", True)
    assert fingerprint(uses_thrice) != before
    assert is_scalar(mark(lambda x: x))


@scalar
def first_row(values):
    return values[0], 1.0


def sum_first_row(values, out):
    row, _ = first_row(values)
    out[0] = row.sum()


def test_a_helper_that_hands_arrays_to_a_driver_must_say_so() -> None:
    """Its machine code counts no references, so the driver would give back what it never took."""
    CPU.compile(sum_first_row, None, "uncached").compile("void(float64[:, ::1], float64[::1])")
    with pytest.raises(TypeError, match=r"first_row hands out arrays to .*sum_first_row: mark it @allocating"):
        CPU.check(sum_first_row)
