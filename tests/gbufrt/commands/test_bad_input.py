"""What is wrong is told in one line, and light that is not finite is mended."""

from __future__ import annotations

import os
from pathlib import Path

import boxes
import pytest
import torch
from command_line import SMALL, install, run

from gbufrt import Frame
from gbufrt.commands.cli import main
from gbufrt.commands.recipe import Recipe
from gbufrt.files.exr import read_exr, write_exr


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path)


def bad_frame(**changes: tuple[float, int]) -> Frame:
    """A frame whose channels hold a bad value in so many pixels."""
    frame = boxes.frame(boxes.camera((16, 24)))
    for name, (value, count) in changes.items():
        tensor = frame.read(name).clone()
        tensor.flatten(2)[:, :, 100 : 100 + count] = value
        known = name in ("depth", "normal", "albedo", "emission")
        frame = frame.replace(gbuffer=frame.gbuffer.replace(**{name: tensor})) if known else frame.write(name, tensor)
    return frame


def test_post_mends_light_and_tells(capsys: pytest.CaptureFixture[str]):
    write_exr("good.exr", boxes.frame(boxes.camera((16, 24))))
    frame = bad_frame(radiance=(torch.nan, 3), ambient=(torch.inf, 1), emission=(-torch.inf, 2))
    write_exr("a.exr", frame.replace(behind=bad_frame(environment=(torch.nan, 2))))
    assert run("post", "good.exr", "--out", "b", "--strict") == 0
    assert "mended" not in capsys.readouterr().err
    assert run("post", "a.exr", "--out", "b") == 0
    told = [line for line in capsys.readouterr().err.splitlines() if "mended" in line]
    assert told == [
        "gbufrt: a.exr: mended emission: 2 pixels (2 infinite to 0); radiance: 3 pixels (3 NaN to 0); "
        "ambient: 1 pixel (1 infinite to 0.4); behind.environment: 2 pixels (2 NaN to 0)"
    ]
    found = read_exr("b/a.exr")
    found.validate()
    picture, clean = read_exr("b/a.exr").read("image"), read_exr("b/good.exr").read("image")
    assert int(((picture - clean).abs().amax(1) > 1e-6).sum()) == 3
    assert run("post", "a.exr", "--out", "c", "--strict") == 2
    error = capsys.readouterr().err
    assert "a.exr: emission must be finite, but 2 pixels are not, such as -inf at" in error
    assert error.count("\n") == 1
    assert not Path("c").exists()


@pytest.mark.parametrize(("name", "value"), [("depth", torch.nan), ("normal", torch.inf), ("albedo", torch.nan)])
def test_post_refuses_geometry(name: str, value: float, capsys: pytest.CaptureFixture[str]):
    write_exr("a.exr", bad_frame(**{name: (value, 5)}))
    for extra in ((), ("--strict",)):
        assert run("post", "a.exr", "--out", "b", *extra) == 2
        error = capsys.readouterr().err
        assert error.startswith(f"gbufrt: a.exr: {name} must be finite, but 5 pixels are not")
        assert error.count("\n") == 1
    assert not Path("b").exists()


def test_post_bounds_what_notes_ask_for(capsys: pytest.CaptureFixture[str]):
    frame = boxes.frame(boxes.camera((16, 24)))
    recipe = Recipe().to_notes()
    for name, changes, message in (
        ("a", {"warmup": 10**12}, "a.exr asks for more warm-up runs than 4096; say how many with --warmup"),
        ("b", {"warmup": -1}, "b.exr asks for more"),
        ("c", {"set": {"speckle.taps": 10**12}}, "--set speckle.taps must be a whole number of at most 1048576"),
    ):
        write_exr(f"{name}.exr", frame, notes={"pipeline": {**recipe, **changes}})
        assert run("post", f"{name}.exr", "--out", "out") == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
    assert not Path("out").exists()
    assert run("post", "a.exr", "--out", "out", "--warmup", "2") == 0
    write_exr("d.exr", frame, notes={"pipeline": {**recipe, "warmup": float("inf")}})
    assert run("post", "d.exr", "--out", "out") == 0  # no number at all: as if nothing had been said
    for name, changes in (("index", {"index": 10**30}), ("time", {"time": float("inf")})):
        write_exr("e.exr", frame.replace(**changes))
        assert run("post", "e.exr", "--out", "out") == 2
        assert f"e.exr is damaged: its {name} must be a number of at most" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--size", "0x10"), "--size must be WIDTHxHEIGHT, both at least 1, such as 960x540; got '0x10'"),
        (("--size", "ax10"), "--size must be"),
        (("--size", "99999x99999"), "choose a smaller one"),
        (("--frames", "0"), "--frames must be 1 or more, got 0"),
        (("--frames", "two"), "--frames"),
        (("--fps", "nan"), "--fps must be"),
        (("--light-samples", "0"), "--light-samples must be 1 or more"),
        (("--warmup", "-1"), "--warmup must be 0 or more"),
        (("--without", "bloom"), "no stage 'bloom' in the pipeline; it has ao, taa, display"),
        (("--without", "ao.blur"), "no stage 'blur'"),
        (("--without", "taa"), "display (Display) reads 'color', but no stage before it writes that"),
        (("--set", "speckle.size=3"), "no tunable 'speckle.size'"),
        (("--set", "speckle.radius"), "--set must be NAME=VALUE"),
        (("--set", "speckle.radius=wide"), "--set speckle.radius must be a number (it is 0.8 now), got 'wide'"),
        (("--set", "speckle.taps=2.5"), "must be a whole number"),
        (("--set", "speckle.soft=1"), "must be true or false"),
        (("--set", "speckle.radius=-1"), "--set speckle.radius=-1: radius must be positive, in world units, got -1.0"),
        (("--preset", "huge"), "preset must be low, medium, high or ultra, got 'huge'"),
        (("--composite", "both"), "composite must be physical or me1, got 'both'"),
        (("--view", "below"), "no view 'below' in world 'builtin'; it has front, above"),
        (("missing.vox",), "missing.vox does not exist; check the path"),
        (("hollow",), "world 'hollow' is empty"),
        (("missing.vox", "--seed", "3"), "--seed is for built-in worlds"),
        (("--device", "tpu"), "--device must be cpu or cuda, got 'tpu'"),
        (("--device", "cpu:3"), "--device must be cpu or cuda, got 'cpu:3'"),
        (("--device", "cpu:"), "--device must be cpu or cuda"),
        (("--device", "cuda:9999999999999"), "--device must be cpu or cuda"),
        (("--frames", "1.5"), "--frames: must be a whole number, got '1.5'"),
        (("--frames", "1e2"), "--frames: must be a whole number"),
        (("--frames", "9" * 30), "--frames: must be at most 9223372036854775807"),
        (("--frames", str(2**62)), "--frames must be at most 1000000"),
        (("--light-samples", "9" * 5000), "--light-samples: must be at most 9223372036854775807"),
        (("--light-samples", "2.5"), "--light-samples: must be a whole number"),
        (("--warmup", "1000000000000"), "--warmup must be at most 4096"),
        (("--warmup", "2.5"), "--warmup: must be a whole number"),
        (("--seed", str(2**70)), "--seed: must be at most"),
        (("--set", f"speckle.taps={2**80}"), "--set speckle.taps must be a whole number of at most 1048576"),
        (("--set", f"speckle.taps={2**40}"), "got 1099511627776"),
        (("--set", f"speckle.radius={10**400}"), "--set speckle.radius must be a number"),
        (("--set", "speckle.radius=1e999"), "--set speckle.radius must be a number"),
        (("--device", "cuda:99"), "there is no such CUDA device here; use --device cpu"),
        (("--config", "missing.toml"), "missing.toml does not exist"),
        (("--colour",), "--colour"),
        (("--precision", "double"), "--precision must be half or float, got 'double'"),
        (("--compression", "piz"), "--compression must be zip or dwaa, got 'piz'"),
        (("--bits", "12"), "--bits must be 8 or 16, got 12"),
        (("--only", "image,aoo"), "--only must be albedo, ambient, ao, ao_length,"),
        (("--only", "image", "--resume"), "--resume reads the G-buffer and light of finished frames again; leave out"),
    ],
)
def test_bad_input_is_one_line(arguments: tuple[str, ...], message: str, capfd: pytest.CaptureFixture[str]):
    size = () if "--size" in arguments else SMALL
    assert run("render", *arguments, *size, "--out", "out") == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith("gbufrt: ")
    assert message in error
    assert not list(Path().iterdir())


def test_settings_are_tried_before_a_world_is_loaded(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    def load(*_: object, **__: object) -> None:
        raise AssertionError("loaded")

    monkeypatch.setattr("tracer.worlds.load", load)
    bad = ("--set", "speckle.radius=-1", "--set", "speckle.taps=4")
    assert run("render", *SMALL, *bad, "--set", "blend=0.5", "--out", "out") == 2
    assert capfd.readouterr().err.startswith("gbufrt: --set speckle.radius=-1: radius must be positive")
    write_exr("a.exr", boxes.frame(boxes.camera((16, 24))))
    assert run("post", "a.exr", *bad, "--out", "out") == 2
    assert capfd.readouterr().err.startswith("gbufrt: --set speckle.radius=-1: radius must be positive")
    with pytest.raises(AssertionError, match="loaded"):  # what is left out is not tried
        main(["render", *SMALL, *bad, "--without", "display,taa,ao", "--out", "out"])


def test_bad_folders_and_files(capfd: pytest.CaptureFixture[str]):
    Path("file").write_text("")
    Path("empty").mkdir()
    Path("bad.exr").write_bytes(b"nothing")
    Path("bad.vox").write_bytes(b"VOX ")
    assert run("render", *SMALL, "--out", "good") == 0
    whole = Path("good/frame_0000.exr").read_bytes()
    Path("cut.exr").write_bytes(whole[: len(whole) // 2])
    capfd.readouterr()
    for arguments, message in (
        (("render", "--out", "file"), "--out file must be a folder"),
        (("render", "--out", "file/deeper"), "but file is a file"),
        (("post", "missing.exr", "--out", "b"), "missing.exr does not exist"),
        (("post", "empty", "--out", "b"), "empty holds no EXR files; give files"),
        (("post", "--out", "b"), "no files given"),
        (("post", "bad.exr", "--out", "b"), "bad.exr is not an OpenEXR file"),
        (("post", "bad.vox", "--out", "b"), "bad.vox is a world, which `gbufrt render bad.vox` shows"),
        (("post", "cut.exr", "--out", "b"), "cut.exr is damaged or cut short"),
        (("post", "good", "good/frame_0000.exr", "--out", "b"), "several inputs are called frame_0000"),
        (("post", "good", "--out", "good"), "would be overwritten; choose another folder"),
        (("video", "good"), "--out"),
    ):
        assert run(*arguments) == 2, arguments
        error = capfd.readouterr().err
        assert message in error, error
        assert error.count("\n") == 1, error
    assert not Path("b").exists()


def test_post_refuses_a_mixture(capfd: pytest.CaptureFixture[str]):
    assert run("render", *SMALL, "--out", "a", "--preset", "low") == 0
    assert run("render", *SMALL, "--out", "b") == 0
    os.rename("b/frame_0000.exr", "b/other.exr")
    capfd.readouterr()
    assert run("post", "a/frame_0000.exr", "b/other.exr", "--out", "c") == 2
    assert "different pipelines" in capfd.readouterr().err
    assert run("post", "a/frame_0000.exr", "b/other.exr", "--out", "c", "--preset", "low") == 0
    assert float(read_exr("c/other.exr").read("ao_length").min()) == Recipe().warmup + 1  # a history of its own


def test_post_refuses_gaps_and_mixed_sizes(capfd: pytest.CaptureFixture[str]):
    for number, size in ((0, (16, 24)), (2, (16, 24)), (3, (8, 24))):
        write_exr(f"a/frame_{number:04d}.exr", boxes.frame(boxes.camera(size), index=number))
    for given, message in (
        (("a",), "a lacks frame_0001.exr between others; make it (render --resume), or give files"),
        (("a/frame_0002.exr", "a/frame_0003.exr"), "frame_0003.exr has 24x8 pixels, a/frame_0002.exr 24x16; run them"),
    ):
        assert run("post", *given, "--out", "b") == 2
        error = capfd.readouterr().err
        assert message in error
        assert error.count("\n") == 1
    assert not Path("b").exists()
    assert run("post", "a/frame_0000.exr", "a/frame_0002.exr", "--out", "b") == 0  # named one by one, they are stills


def test_post_lacks_what_a_pass_reads(capfd: pytest.CaptureFixture[str]):
    frame = boxes.frame(boxes.camera((16, 24)))
    write_exr("a.exr", frame.replace(gbuffer=frame.gbuffer.replace(motion=None)))
    assert run("post", "a.exr", "--out", "b") == 2
    error = capfd.readouterr().err
    assert (
        "ao.mean (Mean) reads 'motion', which the frame lacks: render it too, or leave the stage out with --" in error
    )
    assert not Path("b").exists()
