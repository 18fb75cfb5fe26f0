"""What gbufrt's own processes do about memory: large pages, and free memory given back between passes."""

import importlib
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gbufrt.commands
from gbufrt import Frame, Pipeline, TemporalPass
from gbufrt.commands import memory
from gbufrt.commands.session import Runner
from gbufrt.specimen import specimen
from post import ToneMap, Vignette

BLOCK, BLOCKS = 100_000, 1_000  # bytes, fewer than what the allocator maps by itself


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(memory._trim() is None, reason="the C library is not glibc")
def test_free_memory_amid_the_heap_goes_back_to_the_system() -> None:
    trim = memory._trim()
    assert trim is not None
    blocks = [np.ones(BLOCK, np.uint8) for _ in range(BLOCKS)]
    pins = blocks[::10]  # keep the heap from shrinking
    del blocks
    before, idle = _resident(), memory._idle()
    trim()
    assert before - _resident() > BLOCK * BLOCKS // 2
    assert idle - memory._idle() > BLOCK * BLOCKS // 2
    wanted = memory._idle()
    more = [np.ones(BLOCK, np.uint8) for _ in range(BLOCKS)]
    assert memory._idle() - wanted < BLOCK * len(more) // 2, "what is allocated is not idle"
    assert len(pins) == BLOCKS // 10


def test_every_pass_is_preceded_by_it_where_much_is_held_and_none_after(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    monkeypatch.setattr(memory, "_trim", lambda: lambda: calls.append(1))
    frame = specimen()
    frame = frame.replace(color=frame.radiance)
    monkeypatch.setattr(memory, "_idle", lambda: memory.IDLE + 1)
    pipeline = Pipeline(given={"color"}, tone_map=ToneMap(), inner=Pipeline(given={"image"}, vignette=Vignette()))
    with memory.giving_back(pipeline):
        pipeline(frame)
    assert len(calls) == 2
    pipeline(frame)
    assert len(calls) == 2


def test_little_is_left_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    monkeypatch.setattr(memory, "_idle", lambda: memory.IDLE)
    monkeypatch.setattr(memory, "_trim", lambda: lambda: calls.append(1))
    frame = specimen()
    pipeline = Pipeline(given={"color"}, tone_map=ToneMap())
    with memory.giving_back(pipeline):
        pipeline(frame.replace(color=frame.radiance))
    assert calls == []


def test_a_library_without_it_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_trim", lambda: None)
    frame = specimen()
    monkeypatch.setattr(memory, "_idle", lambda: memory.IDLE + 1)
    pipeline = Pipeline(given={"color"}, tone_map=ToneMap())
    with memory.giving_back(pipeline):
        assert pipeline(frame.replace(color=frame.radiance))[0].image is not None


@pytest.mark.parametrize(("given", "kept"), [(None, "1"), ("0", "0")])
def test_large_pages_are_asked_for_unless_the_environment_says(
    monkeypatch: pytest.MonkeyPatch, given: str | None, kept: str
) -> None:
    monkeypatch.setenv("THP_MEM_ALLOC_ENABLE", given or "")
    if given is None:
        monkeypatch.delenv("THP_MEM_ALLOC_ENABLE")
    importlib.reload(gbufrt.commands)
    assert os.environ["THP_MEM_ALLOC_ENABLE"] == kept


def test_a_runner_lets_go_of_a_state_when_it_is_read() -> None:
    held = []

    class Count(TemporalPass):
        def forward(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
            held.append((state, runner.state))
            return frame, (0 if state is None else state) + 1

    runner = Runner(Pipeline(count=Count()), warmup=0)
    still = specimen().still()
    for index in range(3):
        runner(still.replace(index=index))
    assert held == [(None, None), (1, None), (2, None)]
