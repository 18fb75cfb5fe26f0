"""What is timed of frames on a GPU."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import captured
from gbufrt.commands.benchmark import process
from gbufrt.commands.benchmark.frames import time_captured
from gbufrt.commands.benchmark.report import show_figures
from post import me1

RAYS = {"ms": 1.0, "mrays_per_s": 1.0}


def test_a_captured_frame_is_timed_with_its_inputs(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = list[str]()
    monkeypatch.setattr(captured, "_recordable", lambda like: True)
    monkeypatch.setattr(captured, "_record", lambda step, like: lambda: ran.append("step") or step())
    monkeypatch.setattr(process, "wait", lambda device: ran.append("wait"))
    with torch.no_grad():
        ms = time_captured(me1("low"), boxes.frame(boxes.camera((16, 24))), repeats=2)
    assert ran == ["step", "wait"] * 3
    assert ms > 0


@pytest.mark.parametrize("device", ["cpu", "cuda"])
def test_its_row_stands_where_it_was_measured(device: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = {"passes_ms": {"ao": 1.0}, "total_ms": 9.0, "peak_mb": 5.0} | (
        {"captured_ms": 3.25} if device != "cpu" else {}
    )
    show_figures({"presets": {"low": found}, "rays": RAYS, "machine": "here", "size": [4, 3], "device": device})
    out = capsys.readouterr().out
    assert ("captured" in out) == (device != "cpu")
    assert ("3.2" in out) == (device != "cpu")
