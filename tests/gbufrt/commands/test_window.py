"""`gbufrt render --window`: a save is flown over without being loaded, and gone on with as it was begun."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")

from command_line import SMALL, assert_same_results, install, run
from hills import save_of_hills

from gbufrt.files.exr import read_notes
from tracer.scene.scene import Scene
from tracer.worlds.regions.stream import Stream


@pytest.fixture(autouse=True)
def save(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path)
    save_of_hills(tmp_path / "save", lamps=False)


def test_a_flight_has_a_window_round_each_eye(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    eyes = list[float]()
    around = Stream.around
    monkeypatch.setattr(Stream, "around", lambda self, eye: (eyes.append(eye[2]), around(self, eye))[1])
    fly = (
        "render",
        "save",
        "--fps",
        "0.5",
        "--frames",
        "4",
        "--hour",
        "20",
        "--rain",
        "0.5",
        "--waves",
        "0.1",
        *SMALL,
        "--window",
    )
    assert run(*fly, "4", "--out", "a") == 0
    assert len(set(eyes)) == 4
    assert run(*fly, "4", "--out", "b") == 0
    (Path("b") / "frame_0002.exr").unlink()
    eyes.clear()
    assert run(*fly, "4", "--out", "b", "--resume") == 0
    assert len(eyes) == 1
    assert_same_results("a", "b")
    capsys.readouterr()
    assert run(*fly, "6", "--out", "b", "--resume") == 2
    assert "frame_0000.exr has window 4, not 6" in capsys.readouterr().err


def test_the_weather_of_a_flight_is_that_of_every_scene(monkeypatch: pytest.MonkeyPatch):
    scenes, around = list[Scene](), Stream.around
    monkeypatch.setattr(Stream, "around", lambda self, eye: (scenes.append(around(self, eye)), scenes[-1])[1])
    fly = ("render", "save", "--window", "4", *SMALL, "--out", "a", "--rain", "0.5", "--waves", "0.2")
    assert run(*fly) == 0
    assert [(s.rain and s.rain.level, s.waves and s.waves.amplitude) for s in scenes] == [(0.5, 0.2)]
    assert read_notes(Path("a") / "frame_0000.exr")["render"]["rain"] == 0.5
    assert run(*fly[:-2], "--resume") == 2


def test_what_a_window_lacks_is_told_in_a_line(capsys: pytest.CaptureFixture[str]):
    assert run("render", "save", "--window", "4", "--view", "orbit", *SMALL, "--out", "a") == 2
    assert "no view 'orbit' in world 'save'; it has flight" in capsys.readouterr().err
    assert run("render", "save", "--window", "4", "--around", "9000,0", *SMALL, "--out", "a") == 2
    assert "save has no chunks in that part" in capsys.readouterr().err
    assert not Path("a").exists()
