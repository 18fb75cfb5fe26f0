"""`gbufrt render --resume`: what is whole stays, what is not is made anew, and sequences stay sequences."""

from __future__ import annotations

import contextlib
import signal
import sys
from pathlib import Path
from typing import Any

import pytest
from command_line import SMALL, assert_same_results, fake_render, files, install, run

from gbufrt import Frame
from gbufrt.files.exr import read_exr, read_notes


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path)


def test_resume_continues_exactly(capsys: pytest.CaptureFixture[str]):
    assert run("render", "--frames", "4", *SMALL, "--out", "whole") == 0
    assert run("render", "--frames", "4", *SMALL, "--out", "parts") == 0
    for index in (2, 3):
        Path(f"parts/frame_000{index}.exr").unlink()
        Path(f"parts/frame_000{index}.png").unlink()
    stamp = Path("parts/frame_0001.exr").stat().st_mtime_ns
    assert run("render", "--frames", "4", *SMALL, "--out", "parts", "--resume") == 0
    assert Path("parts/frame_0001.exr").stat().st_mtime_ns == stamp
    assert_same_results("whole", "parts")
    capsys.readouterr()
    assert run("render", "--frames", "4", *SMALL, "--out", "parts", "--resume") == 0
    assert "already" in capsys.readouterr().out
    assert run("render", "--frames", "4", "--size", "20x16", "--out", "parts", "--resume") == 2
    assert "has size [24, 16]" in capsys.readouterr().err.replace("[16, 24]", "[24, 16]")
    Path("parts/frame_0002.exr").write_bytes(b"rubbish")
    assert run("render", "--frames", "4", *SMALL, "--out", "parts", "--resume") == 0
    assert_same_results("whole", "parts")


def sequence(folder: str, *, frames: int = 4, code: int = 0, **options: str) -> None:
    extra = [part for name, value in options.items() for part in (f"--{name}", value)]
    assert run("render", "--frames", str(frames), *SMALL, "--out", folder, "--resume", *extra) == code


@pytest.mark.parametrize("index", [0, 1, 3])
@pytest.mark.parametrize("damage", ["cut short", "no picture", "half a picture"])
def test_resume_makes_damaged_frames_anew(index: int, damage: str, capsys: pytest.CaptureFixture[str]):
    sequence("whole")
    sequence("parts")
    kept = {n: Path(f"parts/frame_{n:04d}.exr").stat().st_mtime_ns for n in range(4) if n != index}
    exr, png = Path(f"parts/frame_{index:04d}.exr"), Path(f"parts/frame_{index:04d}.png")
    data, picture = exr.read_bytes(), png.read_bytes()
    if damage == "cut short":
        exr.write_bytes(data[: len(data) * 3 // 4])
        assert read_notes(exr)  # the header alone does not tell
    elif damage == "no picture":
        png.unlink()
    else:
        png.write_bytes(picture[: len(picture) // 2])
    capsys.readouterr()
    sequence("parts")
    assert f"wrote {Path('parts') / f'frame_{index:04d}.png'}" in capsys.readouterr().out
    assert_same_results("whole", "parts")
    assert png.read_bytes() == picture
    assert kept == {n: Path(f"parts/frame_{n:04d}.exr").stat().st_mtime_ns for n in kept}


def test_a_still_is_no_beginning_of_a_sequence(capsys: pytest.CaptureFixture[str]):
    sequence("out", frames=1)
    before = files("out"), Path("out/frame_0000.exr").read_bytes()
    capsys.readouterr()
    sequence("out", frames=3, code=2)
    error = capsys.readouterr().err
    assert "frame_0000.exr is a still, without the jitter of a sequence; use another --out" in error
    assert before == (files("out"), Path("out/frame_0000.exr").read_bytes())
    sequence("other", frames=3)
    capsys.readouterr()
    sequence("other", frames=1, code=2)
    assert "part of a jittered sequence, not a still" in capsys.readouterr().err
    sequence("plain", frames=1, without="display,taa")
    sequence("plain", frames=2, without="display,taa")  # no pass wants jitter: a still is a beginning like any other


def test_interruption_leaves_whole_frames(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    def interrupted(*arguments: Any, **options: Any) -> Frame:
        if options["index"] == 2:
            raise KeyboardInterrupt
        return fake_render(*arguments, **options)

    monkeypatch.setattr(sys.modules["tracer.frames"], "render", interrupted)
    assert run("render", "--frames", "4", *SMALL, "--out", "out") == 130
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("gbufrt: interrupted")
    assert files("out") == ["frame_0000.exr", "frame_0000.png", "frame_0001.exr", "frame_0001.png"]
    for name in ("frame_0000", "frame_0001"):
        assert read_exr(f"out/{name}.exr").index == int(name[-1])


def test_an_interrupt_that_an_import_hides_is_told_too(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    def half_imported(*arguments: Any, **options: Any) -> Frame:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise AttributeError("module 'numpy' has no attribute 'nonzero'")

    monkeypatch.setattr(sys.modules["tracer.frames"], "render", half_imported)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # tests in the background ignore it
    try:
        assert run("render", *SMALL, "--out", "a") == 130
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert capfd.readouterr().err.strip().splitlines()[-1].startswith("gbufrt: interrupted")
