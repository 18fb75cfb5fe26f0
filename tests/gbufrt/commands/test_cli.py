"""The command line, over a stand-in tracer and pipeline that are quick and remember what they did."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import boxes
import numpy as np
import OpenEXR
import pytest
import torch
from command_line import SMALL, assert_same_results, fake_render, files, install, run, spoil
from PIL import Image

from gbufrt import Frame
from gbufrt.commands.arguments.options import FileOptions
from gbufrt.commands.recipe import Recipe
from gbufrt.commands.session import save
from gbufrt.files.exr import read_exr, read_notes, write_exr
from gbufrt.noise.noise import halton_jitter


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path)


def test_render_writes_every_frame():
    assert run("render", "--frames", "2", *SMALL, "--out", "new/out", "--debug", "--light-samples", "7") == 0
    found = files("new/out")
    assert {"frame_0000.exr", "frame_0000.png", "frame_0001.exr", "frame_0001.png"} <= set(found)
    assert {"debug/frame_0001_depth.png", "debug/frame_0001_ao_length.png", "debug/frame_0000_sheet.png"} <= set(found)
    assert not [name for name in found if "part" in name]
    frame = read_exr("new/out/frame_0001.exr")
    assert frame.gbuffer.camera.size == (16, 24)
    assert frame.index == 1
    assert Image.open("new/out/frame_0001.png").size == (24, 16)
    jitter, before = frame.gbuffer.camera.jitter, frame.gbuffer.previous_camera
    assert jitter is not None
    assert jitter[0].tolist() == pytest.approx(halton_jitter(1))
    assert before is not None
    assert torch.equal(before.world_from_view, read_exr("new/out/frame_0000.exr").gbuffer.camera.world_from_view)
    notes = read_notes("new/out/frame_0000.exr")
    assert notes["render"]["samples"] == 7
    assert notes["pipeline"] == {
        "preset": "high",
        "composite": "physical",
        "without": [],
        "set": {},
        "warmup": 3,
    }


def test_a_still_is_not_jittered_and_has_its_history_filled():
    assert run("render", *SMALL, "--out", "out", "--warmup", "5") == 0
    frame = read_exr("out/frame_0000.exr")
    assert frame.gbuffer.camera.jitter is None
    assert float(frame.read("ao_length").min()) == 6
    assert float(frame.read("motion").abs().max()) > 0  # the file keeps the true motion


@pytest.mark.parametrize("extra", [(), ("--preset", "low", "--set", "speckle.radius=0.7", "--without", "display")])
def test_post_gives_what_render_gave(extra: tuple[str, ...]):
    assert run("render", "--frames", "3", *SMALL, "--out", "a", *extra) == 0
    for name in files("a"):
        if name.endswith(".exr"):
            spoil(f"a/{name}")
    assert run("post", "a", "--out", "b") == 0
    assert run("render", "--frames", "3", *SMALL, "--out", "c", *extra) == 0
    assert_same_results("b", "c")


def test_passes_see_what_the_file_holds():
    """So files of half precision give the same pictures again, to the bit; `post` keeps the files' precision."""
    assert run("render", "--frames", "2", *SMALL, "--out", "half") == 0
    assert run("render", "--frames", "2", *SMALL, "--out", "float", "--precision", "float") == 0
    half, whole = read_exr("half/frame_0001.exr"), read_exr("float/frame_0001.exr")
    for name, seen in (("radiance", half.read("radiance")), ("depth", half.read("depth"))):
        same = torch.equal(seen, whole.read(name))
        assert same == (name == "depth")
    assert torch.equal(half.read("radiance"), half.read("radiance").half().float())
    assert run("post", "float", "--out", "again") == 0
    assert_same_results("float", "again")
    assert run("post", "float", "--out", "rounded", "--precision", "half") == 0
    assert_same_results("half", "rounded")


def test_eight_bits_are_dithered_so_that_skies_have_no_bands(monkeypatch: pytest.MonkeyPatch):
    level = torch.full((1, 3, 16, 24), 100.3 / 255)
    monkeypatch.setattr("gbufrt.commands.session.write_exr", lambda *_, **__: None)
    frame = boxes.frame(boxes.camera((16, 24))).replace(image=level)
    save(Path(), "even", frame, notes={}, debug=False, files=FileOptions())
    levels = np.asarray(Image.open("even.png"))
    assert set(np.unique(levels)) == {100, 101}
    assert levels.mean() == pytest.approx(100.3, abs=0.06)
    notes = {"pipeline": Recipe(set={"encode.dither": True}).to_notes()}  # the image has it already
    save(Path(), "once", frame, notes=notes, debug=False, files=FileOptions())
    assert set(np.unique(np.asarray(Image.open("once.png")))) == {100}


def test_choices_of_files(capfd: pytest.CaptureFixture[str]):
    chosen = ("--only", "image,ao,behind.depth", "--compression", "dwaa", "--bits", "16")
    assert run("render", *SMALL, "--out", "a", *chosen) == 0
    assert "frame_0000.exr, with image, ao, behind.depth alone\n" in capfd.readouterr().out
    part = OpenEXR.File("a/frame_0000.exr", separate_channels=True, header_only=True).parts[0]
    assert part.header["compression"] == OpenEXR.DWAA_COMPRESSION
    assert read_notes("a/frame_0000.exr")["files"] == {"precision": "half"}
    with pytest.raises(ValueError, match="is no whole frame: it holds ao, image"):
        read_exr("a/frame_0000.exr")
    assert Path("a/frame_0000.png").read_bytes()[24] == 16
    assert run("post", "a", "--out", "b") == 2


def test_post_changes_the_pipeline():
    assert run("render", "--frames", "2", *SMALL, "--out", "a", "--set", "display.gain=0.5") == 0
    assert run("post", "a/frame_0000.exr", "a/frame_0001.exr", "--out", "b", "--preset", "low") == 0
    assert run("render", "--frames", "2", *SMALL, "--out", "c", "--preset", "low") == 0
    assert_same_results("b", "c")
    assert run("post", "a", "--out", "d", "--without", "display", "--set", "gain=0.1") == 0
    assert read_exr("d/frame_0000.exr").image is None
    assert read_notes("d/frame_0001.exr")["pipeline"]["set"] == {"display.gain": 0.5, "gain": 0.1}


def test_config_file(capfd: pytest.CaptureFixture[str]):
    Path("a.toml").write_text(
        'size = "24x16"\nframes = 2\npreset = "low"\nwithout = ["display"]\nview = "above"\nlight-samples = 5\n'
        '[set]\n"speckle.radius" = 0.7\n[set.mean]\nblend = 0.5\n'
    )
    assert run("render", "--config", "a.toml", "--frames", "1", "--set", "speckle.taps=9", "--out", "out") == 0
    assert [name for name in files("out") if name.endswith("exr")] == ["frame_0000.exr"]
    notes = read_notes("out/frame_0000.exr")
    assert notes["render"]["view"] == "above"
    assert notes["render"]["samples"] == 5
    assert notes["pipeline"]["preset"] == "low"
    assert notes["pipeline"]["without"] == ["display"]
    assert notes["pipeline"]["set"]["speckle.taps"] == 9
    capfd.readouterr()
    for text, message in (
        ("sighs = 3", "sighs"),
        ("size = ", "b.toml is not TOML"),
        ("frames = 'x'", "frames"),
        ("[set]\n'speckle.size' = 3", "no tunable 'speckle.size'"),
    ):
        Path("b.toml").write_text(text)
        assert run("render", "--config=b.toml", "--size", "24x16", "--out", "other") == 2
        error = capfd.readouterr().err
        assert message in error, error
        assert error.count("\n") == 1
    assert not Path("other").exists()


def test_passes_lists_the_pipeline(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "60")
    assert run("passes", "--without", "display", "--set", "radius=0.25") == 0
    shown = capfd.readouterr().out
    for text in (
        "ao.estimate",
        "Speckle, speckle.radius for short",
        "depth",
        "radius=0.25",
        "ao.mean",
        "ao_length",
        "taa",
        "color composite",
        "ao.estimate.method='bitmask'",
        "of the speckles, in [units] (Speckle() has",
    ):
        assert text in shown, text
    assert "Display" not in shown


def test_a_camera_by_eye_target_and_field_of_view():
    where = ("--eye=2,4,9", "--target", "0,1,0")
    assert run("render", *SMALL, *where, "--fov", "50", "--out", "eye") == 0
    assert run("render", *SMALL, "--view", "front", "--out", "view") == 0
    assert run("render", *SMALL, *where, "--out", "wide") == 0
    assert run("render", *SMALL, "--view", "front", "--fov", "60", "--out", "wider") == 0
    eye, view, wide, wider = (read_exr(f"{name}/frame_0000.exr").gbuffer for name in ("eye", "view", "wide", "wider"))
    assert torch.equal(eye.depth, view.depth)
    assert torch.equal(wide.depth, wider.depth)
    assert not torch.equal(eye.depth, wide.depth)
    assert eye.previous_camera is not None
    assert torch.equal(eye.previous_camera.world_from_view, eye.camera.world_from_view)


def test_a_warning_is_one_line(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.cli._config", lambda _: warnings.warn("left\n  out", stacklevel=1))
    assert run("--version") == 0
    assert capfd.readouterr().err == "gbufrt: left out\n"


def test_bench_measures(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]):
    from gbufrt.commands.benchmark import frames, process, rays

    monkeypatch.setattr(process, "in_own_process", lambda run, *a: run(*a))
    monkeypatch.setattr(rays, "time_rays", lambda *a: {"ms": 10.0, "mrays_per_s": 41.0})
    monkeypatch.setattr(
        frames, "make_frame", lambda path, size, device: write_exr(path, boxes.frame(boxes.camera(size)))
    )
    assert run("bench", "--presets", "low,high", *SMALL, "--repeats", "2", "--json", "deep/figures.json") == 0
    figures = json.loads(Path("deep/figures.json").read_text())
    assert list(figures["presets"]) == ["low", "high"]
    low = figures["presets"]["low"]
    assert list(low["passes_ms"]) == ["ao.estimate", "ao.mean", "taa", "display"]
    assert all(ms > 0 for ms in low["passes_ms"].values())
    assert low["total_ms"] >= 0.5 * sum(low["passes_ms"].values())
    assert low["peak_mb"] > 50
    assert figures["size"] == [24, 16]
    shown = capfd.readouterr().out
    assert "41.00 Mrays/s" in shown
    assert figures["machine"].split(",")[0] in " ".join(shown.split())
    assert "bars" not in shown
    assert "bars" not in figures
    assert run("bench", "--presets", "huge") == 2


def test_help_needs_no_torch():
    code = (
        "import sys, gbufrt.commands.cli\n"
        "try: gbufrt.commands.cli.main(['render', '--help'])\n"
        "except SystemExit: assert 'torch' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "--light-samples" in done.stdout


def test_a_still_in_fog_is_traced_anew_for_each_run_of_the_warm_up(monkeypatch: pytest.MonkeyPatch):
    traced: list[int] = []

    def watched(*given: Any, index: int, **more: Any) -> Frame:
        traced.append(index)
        return fake_render(*given, index=index, **more)

    monkeypatch.setattr(import_module("tracer.frames"), "render", watched)
    monkeypatch.setattr("post.presets.with_fog", lambda pipeline: pipeline)
    assert run("render", *SMALL, "--fog", "0.5", "--warmup", "2", "--out", "fog") == 0
    assert len(set(traced)) == 3, "each with noise of its own"
    traced.clear()
    assert run("render", *SMALL, "--warmup", "2", "--out", "clear") == 0
    assert traced == [0]
