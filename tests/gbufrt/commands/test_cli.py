"""The command line, over a stand-in tracer and pipeline that are quick and remember what they did."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import types
from dataclasses import replace
from pathlib import Path
from typing import Any

import boxes
import OpenEXR
import pytest
import torch
from PIL import Image

from gbufrt import Frame, Pass, Pipeline, TemporalPass
from gbufrt.commands.cli import main
from gbufrt.commands.session import Recipe, Runner, bare
from gbufrt.files.exr import read_exr, read_notes, write_exr
from gbufrt.noise.noise import blue_noise, halton_jitter
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene, View
from tracer.scene.world import World

SMALL = ("--size", "24x16")


class Speckle(Pass):
    """A noisy signal, as an estimator makes it."""

    reads, writes = frozenset({"depth"}), frozenset({"ao"})

    def __init__(self, *, radius: float = 0.5, taps: int = 3, method: str = "bitmask", soft: bool = True) -> None:
        super().__init__()
        self.radius, self.taps, self.method, self.soft = radius, taps, method, soft

    def forward(self, frame: Frame) -> Frame:
        if self.radius <= 0:
            raise ValueError(f"radius must be positive, in world units, got {self.radius}")
        noise = blue_noise(*frame.gbuffer.camera.size, index=frame.index)[None]
        return frame.replace(ao=(noise * self.radius).clamp(0, 1))


class Mean(TemporalPass):
    """A running mean that follows motion only as far as to notice it."""

    reads, writes = frozenset({"ao", "motion"}), frozenset({"ao", "ao_length"})

    def __init__(self, *, blend: float = 0.9) -> None:
        super().__init__()
        self.blend = blend

    def forward(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
        ao, motion = frame.read("ao"), frame.read("motion").norm(dim=1, keepdim=True)
        count = torch.ones_like(ao)
        if state is not None:
            mean, length = state
            count = torch.where(motion > 4.0, count, length + 1)
            ao = mean + (ao - mean) / count.clamp_max(10.0)
        return frame.replace(ao=ao).write("ao_length", count), (ao, count)


class TAA(Pass):
    """Named as the one that wants a jittered camera."""

    reads, writes = frozenset({"radiance", "ao"}), frozenset({"composite", "color"})

    def forward(self, frame: Frame) -> Frame:
        lit = frame.read("radiance") * frame.read("ao")
        return frame.replace(composite=lit, color=lit)


class Display(Pass):
    """What ends in a picture."""

    reads, writes = frozenset({"color"}), frozenset({"image"})

    def __init__(self, *, gain: float = 1.0) -> None:
        super().__init__()
        self.gain = gain

    def forward(self, frame: Frame) -> Frame:
        return frame.replace(image=(frame.read("color") * self.gain).clamp(0, 1))


def fake_me1(preset: str = "high", *, composite: str = "physical") -> Pipeline:
    if composite not in ("physical", "me1"):
        raise ValueError(f"composite must be physical or me1, got {composite!r}")
    if preset not in ("low", "high"):
        raise ValueError(f"preset must be low or high, got {preset!r}")
    ao = Pipeline(
        estimate=Speckle(taps=2 if preset == "low" else 3, radius=0.4 if preset == "low" else 0.8), mean=Mean()
    )
    return Pipeline(ao=ao, taa=TAA(), display=Display())


def fake_render(
    scene: Scene, camera: Any, *, previous_camera: Any, time: float, previous_time: float, index: int, light_samples=4
) -> Frame:
    frame = boxes.frame(camera, previous=previous_camera, index=index)
    behind = boxes.frame(camera, previous=previous_camera, index=index)
    return frame.replace(time=time, radiance=frame.read("radiance") * (1 + light_samples / 100), behind=behind)


def fake_load(name: str) -> Scene:
    if name not in ("builtin", "hollow"):
        raise FileNotFoundError(f"{name} does not exist; check the path")
    voxels = torch.zeros(2, 2, 2, dtype=torch.int16)
    voxels[0] = name == "builtin"
    world = World.from_dense(voxels, MaterialTable.of([Material(name="stone")]))
    front = View(eye=lambda t: (2.0 + 0.3 * t, 4.0, 9.0), target=lambda t: (0.3 * t, 1.0, 0.0), fov_y=50.0)
    return Scene(world=world, views={"front": front, "above": replace(front, fov_y=80.0)})


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    for name, attribute, value in (("post.presets", "me1", fake_me1), ("tracer.frames", "render", fake_render)):
        module = types.ModuleType(name)
        setattr(module, attribute, value)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr("tracer.worlds.load", fake_load)
    monkeypatch.setattr("gbufrt.commands.checks.WORLDS", {"builtin": ("front", "above"), "hollow": ()})
    monkeypatch.chdir(tmp_path)


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as exit:
        main(arguments)
    assert isinstance(exit.value.code, int)
    return exit.value.code


def files(folder: str) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*") if p.is_file())


def assert_same_results(a: str, b: str) -> None:
    assert files(a) == files(b)
    for name in (n for n in files(a) if n.endswith(".exr")):
        left, right = read_exr(f"{a}/{name}"), read_exr(f"{b}/{name}")
        assert left.present == right.present
        for signal in left.present:
            assert torch.equal(left.read(signal), right.read(signal)), (name, signal)


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


def spoil(path: str) -> None:
    """Overwrite what passes stored, as another program would, keeping the header."""
    frame, results = read_exr(path), {"ao", "ao_length", "composite", "color", "image"}
    assert results & set(frame.present)
    file = OpenEXR.File(path, separate_channels=True)
    for name, channel in file.parts[0].channels.items():
        if name in "RGB" or name.partition(".")[0] in results:
            channel.pixels[:] = 123.0
    file.write(path + ".new")
    os.replace(path + ".new", path)
    assert float(read_exr(path).read("ao").min()) == 123.0


def test_post_changes_the_pipeline():
    assert run("render", "--frames", "2", *SMALL, "--out", "a", "--set", "display.gain=0.5") == 0
    assert run("post", "a/frame_0000.exr", "a/frame_0001.exr", "--out", "b", "--preset", "low") == 0
    assert run("render", "--frames", "2", *SMALL, "--out", "c", "--preset", "low") == 0
    assert_same_results("b", "c")
    assert run("post", "a", "--out", "d", "--without", "display", "--set", "gain=0.1") == 0
    assert read_exr("d/frame_0000.exr").image is None
    assert read_notes("d/frame_0001.exr")["pipeline"]["set"] == {"display.gain": 0.5, "gain": 0.1}


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
    for name, changes in (("index", {"index": 10**30}), ("time", {"time": float("inf")}), ("index", {"index": 1.5})):
        write_exr("e.exr", frame.replace(**changes))
        assert run("post", "e.exr", "--out", "out") == 2
        assert f"e.exr is damaged: its {name} must be a number of at most" in capsys.readouterr().err


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
        (("--set", "speckle.radius=-1"), "radius must be positive, in world units, got -1.0"),
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


def test_bad_folders_and_files(capfd: pytest.CaptureFixture[str]):
    Path("file").write_text("")
    Path("empty").mkdir()
    Path("bad.exr").write_bytes(b"nothing")
    assert run("render", *SMALL, "--out", "good") == 0
    whole = Path("good/frame_0000.exr").read_bytes()
    Path("cut.exr").write_bytes(whole[: len(whole) // 2])
    capfd.readouterr()
    for arguments, message in (
        (("render", "--out", "file"), "--out file must be a folder"),
        (("render", "--out", "file/deeper"), "but file is a file"),
        (("post", "missing.exr", "--out", "b"), "missing.exr does not exist"),
        (("post", "empty", "--out", "b"), "empty holds no frame_*.exr"),
        (("post", "--out", "b"), "no files given"),
        (("post", "bad.exr", "--out", "b"), "bad.exr is not an OpenEXR file"),
        (("post", "cut.exr", "--out", "b"), "cut.exr is damaged or cut short"),
        (("post", "good", "good/frame_0000.exr", "--out", "b"), "several inputs are called frame_0000"),
        (("post", "good", "--out", "good"), "would be overwritten; choose another folder"),
        (("render",), "--out"),
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


def test_post_lacks_what_a_pass_reads(capfd: pytest.CaptureFixture[str]):
    frame = boxes.frame(boxes.camera((16, 24)))
    write_exr("a.exr", frame.replace(gbuffer=frame.gbuffer.replace(motion=None)))
    assert run("post", "a.exr", "--out", "b") == 2
    assert "Mean reads 'motion', which the frame lacks" in capfd.readouterr().err
    assert not Path("b").exists()


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
        "Speckle",
        "depth",
        "radius=0.25",
        "ao.mean",
        "ao_length",
        "taa",
        "color composite",
        "ao.estimate.method='bitmask'",
    ):
        assert text in shown, text
    assert "Display" not in shown


def test_runner_starts_anew_where_frames_do_not_follow():
    runner = Runner(fake_me1(), warmup=3)
    first = boxes.frame(boxes.camera((16, 24)), index=5)
    follower = boxes.frame(boxes.camera((16, 24), dx=0.1), previous=boxes.camera((16, 24)), index=6)
    stranger = boxes.frame(boxes.camera((16, 24), dx=9.0), index=7)
    lengths = [float(runner(frame).read("ao_length").max()) for frame in (first, follower, stranger)]
    assert lengths == [4, 5, 4]
    cut = follower.replace(index=8, cut=torch.tensor([True]))
    assert float(runner(cut).read("ao_length").max()) == 4


def test_warm_up_takes_the_noise_of_the_frames_before():
    frame = boxes.frame(boxes.camera((16, 24)), index=1)
    mean = torch.stack([blue_noise(16, 24, index=index) for index in (-2, -1, 0, 1)]).mean(0)
    assert torch.allclose(Runner(fake_me1(), warmup=3)(frame).read("ao")[0], mean * 0.8, atol=1e-5)


def test_bare_frames_hold_no_results():
    frame = boxes.frame(boxes.camera((16, 24)))
    full = frame.replace(
        ao=frame.gbuffer.roughness, behind=frame.replace(ao=frame.gbuffer.roughness), extra={"x": frame.gbuffer.depth}
    )
    clean = bare(full)
    assert clean.behind is not None
    assert clean.present == clean.behind.present == frame.present


def test_bench_measures(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]):
    from gbufrt.commands import bench

    monkeypatch.setattr(bench, "_in_own_process", lambda *a: bench.time_passes(*a))
    monkeypatch.setattr(bench, "time_rays", lambda *a: {"ms": 10.0, "mrays_per_s": 41.0})
    monkeypatch.setattr(bench, "make_frame", lambda folder, size, device: stored(folder, size))
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
    assert run("bench", "--presets", "huge") == 2


def stored(folder: Path, size: tuple[int, int]) -> Path:
    write_exr(folder / "frame.exr", boxes.frame(boxes.camera(size)))
    return folder / "frame.exr"


def test_help_needs_no_torch():
    code = (
        "import sys, gbufrt.commands.cli\n"
        "try: gbufrt.commands.cli.main(['render', '--help'])\n"
        "except SystemExit: assert 'torch' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "--light-samples" in done.stdout
