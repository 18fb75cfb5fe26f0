"""`--pipeline minecraft-rtx`: small noisy frames traced, large pictures written, and gone on with."""

from __future__ import annotations

from pathlib import Path
from weakref import ref

import boxes
import pytest
import torch
from command_line import assert_same_results, fake_load, install, run
from PIL import Image
from torch import Tensor

from gbufrt import Camera, Frame
from gbufrt.commands.flights.job import Left
from gbufrt.commands.flights.sampling import Sampling
from gbufrt.files.exr import read_exr, read_notes
from gbufrt.noise.noise import blue_noise
from tracer.scene.scene import Scene

traced_again: list[int] = []
RTX = ("--pipeline", "minecraft-rtx", "--size", "24x16", "--warmup", "1")


def fake_samples(scene: Scene, frame: Frame, *, before: Frame | None, bounces: int) -> Frame:
    def light(of: Frame) -> Tensor:
        return boxes.frame(of.gbuffer.camera).read("radiance") * 2 * blue_noise(*of.gbuffer.camera.size, index=of.index)

    direct = boxes.frame(frame.gbuffer.camera).read("radiance")
    assert torch.equal(frame.read("radiance"), direct), "traced without light, which samples bring"
    lit = frame.replace(diffuse=light(frame), specular=0.1 * light(frame), behind=None)
    lit = lit.replace(reflection_distance=torch.ones_like(frame.gbuffer.depth))
    if before is None:
        return lit
    assert before.index == frame.index - 1
    stored = light(before).half().float()
    assert torch.equal(before.read("diffuse"), stored), "pixels are chosen by what the file holds"
    assert torch.equal(before.read("depth"), boxes.frame(before.gbuffer.camera).read("depth"))
    chosen = torch.zeros_like(frame.gbuffer.depth)
    chosen[..., 1::3, 1::3] = 1.0
    again = 0.5 * light(before)
    return lit.replace(replayed=chosen, replayed_diffuse=again, replayed_specular=0.1 * again)


def fake_cache(
    scene: Scene, frame: Frame, cache: int | None, *, before: Frame | None, bounces: int
) -> tuple[Frame, int]:
    """A cache that counts its frames."""
    lit, count = fake_samples(scene, frame, before=before, bounces=bounces), (cache or 0) + 1
    return lit.replace(cached_diffuse=torch.full_like(lit.read("diffuse"), float(count))), count


def fake_unlit(scene: Scene, camera: Camera, *, time: float = 0.0, index: int) -> Frame:
    traced_again.append(index)
    return Frame(gbuffer=boxes.frame(camera).gbuffer, index=index, time=time)


def fake_path(scene: Scene, frame: Frame, *, bounces: int) -> Frame:
    return frame.replace(
        radiance=frame.read("radiance") * 2 * blue_noise(*frame.gbuffer.camera.size, index=frame.index)
    )


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path)
    monkeypatch.setattr("tracer.paths.sampled.sampled", fake_samples)
    monkeypatch.setattr("tracer.paths.sampled.sampled_with_cache", fake_cache)
    monkeypatch.setattr("tracer.truth.one_path.one_path", fake_path)
    monkeypatch.setattr("tracer.frames.unlit", fake_unlit)
    traced_again.clear()


def test_small_frames_large_pictures_resumed_and_run_again():
    assert run("render", "--frames", "3", *RTX, "--out", "whole") == 0
    with Image.open("whole/frame_0002.png") as picture:
        assert picture.size == (24, 16)
    frame = read_exr("whole/frame_0002.exr")
    assert frame.gbuffer.camera.size == (8, 12)
    assert frame.read("image").shape[2:] == (16, 24)
    assert frame.gbuffer.camera.jitter is not None
    assert read_notes("whole/frame_0002.exr")["pipeline"]["pipeline"] == "minecraft-rtx"
    assert run("render", "--frames", "3", *RTX, "--out", "parts") == 0
    for ending in ("exr", "png"):
        Path(f"parts/frame_0002.{ending}").unlink()
    assert run("render", "--frames", "3", *RTX, "--out", "parts", "--resume") == 0
    assert_same_results("whole", "parts")
    assert traced_again == [1], "the surfaces of the frame before are kept, but not those that a file has rounded"
    assert run("post", "whole", "--out", "again") == 0
    again = read_exr("again/frame_0002.exr")
    for name in ("diffuse", "replayed_diffuse", "reflection_distance"):
        assert torch.equal(again.read(name), frame.read(name)), "noisy, as it was traced"
    assert again.read("image").shape == frame.read("image").shape
    assert read_exr("whole/frame_0000.exr").replayed is None, "no frame is before the first"


def test_one_light_for_the_other_denoiser():
    assert run("render", "--frames", "2", *RTX, "--denoiser", "denoise", "--out", "one") == 0
    frame = read_exr("one/frame_0001.exr")
    assert frame.diffuse is None
    assert read_notes("one/frame_0001.exr")["pipeline"]["denoiser"] == "denoise"
    assert run("post", "one", "--out", "again") == 0
    again = read_exr("again/frame_0001.exr")
    assert torch.equal(again.read("radiance"), frame.read("radiance")), "noisy, as it was traced"
    assert again.read("image").shape == (1, 3, 16, 24)


def test_frames_leave_light_for_those_after_them():
    assert run("render", "--frames", "3", *RTX, "--irradiance-cache", "--out", "whole") == 0
    frames = [read_exr(f"whole/frame_{number:04d}.exr") for number in range(3)]
    assert [float(frame.read("cached_diffuse").mean()) for frame in frames] == [2.0, 3.0, 4.0], "after a warm-up"
    for ending in ("exr", "png"):
        Path(f"whole/frame_0002.{ending}").rename(f"frame.{ending}")
    assert run("render", "--frames", "3", *RTX, "--irradiance-cache", "--out", "whole", "--resume") == 0
    again = read_exr("whole/frame_0002.exr")
    for name in ("cached_diffuse", "image"):
        assert torch.equal(again.read(name), frames[2].read(name))
    assert run("post", "whole", "--out", "again") == 0
    assert torch.equal(read_exr("again/frame_0002.exr").read("cached_diffuse"), again.read("cached_diffuse"))


def test_mistakes_are_told(capsys: pytest.CaptureFixture[str]):
    for options, message in (
        (("--pipeline", "minecraft"), "--pipeline must be me1 or minecraft-rtx"),
        (("--pipeline", "minecraft-rtx", "--composite", "me1"), "--composite is for me1"),
        (("--denoiser", "denoise"), "--denoiser is for minecraft-rtx"),
        (("--irradiance-cache",), "--irradiance-cache is for minecraft-rtx"),
        (("--pipeline", "minecraft-rtx", "--denoiser", "oidn"), "--denoiser must be asvgf or denoise"),
        (("--pipeline", "minecraft-rtx", "--size", "25x16"), "--size 25x16"),
    ):
        assert run("render", *options, "--out", "out") == 2
        assert message in capsys.readouterr().err
    assert not Path("out").exists()


def test_what_is_traced_of_a_picture():
    assert Sampling(ratio=3.0).rendered((270, 480)) == (90, 160)
    assert Sampling(ratio=1.5).rendered((540, 960)) == (360, 640)
    assert Sampling().rendered((73, 127)) == (73, 127)


def test_surfaces_are_kept_of_the_frame_before_and_its_own_scene():
    scene, other = fake_load("builtin"), fake_load("builtin")
    frame = boxes.frame(boxes.camera((8, 12)), index=4)
    left = Left(surfaces=(ref(scene), frame))
    assert left.seen(scene, 4) is frame
    assert left.seen(scene, 3) is None
    assert left.seen(other, 4) is None, "a window of the world that has moved shows other chunks"
    assert Left().seen(scene, 4) is None
