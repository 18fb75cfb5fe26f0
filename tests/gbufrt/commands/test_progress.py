"""What is told of progress: time left is that of steady steps, and compilation is named."""

from __future__ import annotations

from datetime import timedelta

import pytest

from gbufrt.commands.progress import Pace, progress
from gbufrt.compute.cache import Compilation, tell


class Clock:
    """A clock that is set by hand."""

    now = 0.0


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """The clock that progress reads."""
    clock = Clock()
    monkeypatch.setattr("time.monotonic", lambda: clock.now)
    return clock


def test_the_first_step_of_each_kind_and_compilation_do_not_count(clock: Clock):
    pace = Pace(10)
    for seconds, compiled, what, left in (
        (300.0, 280.0, "tracing frame 0", None),
        (200.0, 190.0, "passes of frame 0", None),
        (42.0, 40.0, "passes of frame 0", 2.0 * 7),  # another kernel
        (2.0, 0.0, "tracing frame 1", 2.0 * 6),  # the second of its kind
        (4.0, 0.0, "passes of frame 1", (2 + 2 + 4) / 3 * 5),
    ):
        if compiled:
            pace.compile(compiled)
        clock.now += seconds
        pace.step(what)
        assert pace.left == (None if left is None else timedelta(seconds=round(left))), what
    assert pace.kernels == 3


def test_nothing_is_told_before_the_second_step_and_at_the_end():
    pace = Pace(2)
    for _ in range(2):
        assert pace.left is None
        pace.step("passes of frame 0")
    assert pace.left is None
    pace.step("passes of frame 2")  # a history that begins anew there runs more often than was known
    assert (pace.done, pace.steps, pace.left) == (3, 3, None)


def test_a_log_names_compilation_and_tells_no_time_that_compilation_makes(
    clock: Clock, capsys: pytest.CaptureFixture[str]
):
    with progress("render", 100) as doing:
        tick = doing("tracing frame 0")
        for kernel in range(3):
            tell(Compilation(f"kernel {kernel}"))
            clock.now += 20.0
            tell(Compilation(f"kernel {kernel}", 20.0))
        tick()
        tick = doing("passes of frame 0")
        for _ in range(3):
            clock.now += 20.0
            tick()
    assert capsys.readouterr().err.splitlines() == [
        "render: compiling kernels (once on this machine)",
        "render: compiling kernels (once on this machine); 1 done in 20 s",
        "render: compiling kernels (once on this machine); 2 done in 40 s",
        "render: tracing frame 0, step 1 of 100",
        "render: passes of frame 0, step 2 of 100",
        "render: passes of frame 0, step 3 of 100, about 0:32:20 left",
        "render: passes of frame 0, step 4 of 100, about 0:32:00 left",
    ]
