"""`gbufrt video` and --video: every frame once, in order, also of a run that was gone on with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import SMALL, install, run
from PIL import Image

av = pytest.importorskip("av", reason="PyAV is not installed: pip install gbufrt[video]")


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path)


def frames_of(path: str) -> tuple[list[np.ndarray], float]:
    with av.open(path) as file:
        stream = file.streams.video[0]
        frames = [frame.reformat(format="rgb24", src_colorspace="ITU709") for frame in file.decode(stream)]
        return [frame.to_ndarray().astype(int) for frame in frames], float(stream.average_rate)


def assert_shows(video: str, pictures: list[str], fps: float) -> None:
    shown, rate = frames_of(video)
    assert rate == fps
    assert len(shown) == len(pictures)
    for frame, picture in zip(shown, pictures, strict=True):
        expected = np.asarray(Image.open(picture)).astype(int)
        assert np.abs(frame.mean((0, 1)) - expected.mean((0, 1))).max() < 4  # libswscale rounds 10 bits down


def test_render_and_post_make_videos(capsys: pytest.CaptureFixture[str]):
    assert run("render", "--frames", "3", *SMALL, "--out", "a", "--fps", "12", "--video", "v/a.mov") == 0
    pictures = [f"a/frame_000{n}.png" for n in range(3)]
    assert_shows("v/a.mov", pictures, 12)
    assert "wrote 3 frames at 12 a second to v/a.mov" in capsys.readouterr().out
    Path(pictures[1]).unlink()
    again = ("render", "--frames", "3", *SMALL, "--out", "a", "--fps", "12", "--resume", "--video")
    for name in ("b.mov", "c.mov"):  # one frame made again, then none
        assert run(*again, name) == 0
        assert_shows(name, pictures, 12)
    assert run("post", "a", "--out", "p", "--set", "gain=0.5", "--video", "p.mov") == 0
    assert_shows("p.mov", [f"p/frame_000{n}.png" for n in range(3)], 12)


def test_pictures_that_are_there(capfd: pytest.CaptureFixture[str]):
    Path("a").mkdir()
    for n in (2, 0, 1):
        Image.new("RGB", (24, 16), (40 + 80 * n, 90, 90)).save(f"a/frame_000{n}.png")
    assert run("video", "a", "--out", "a.mov", "--fps", "25") == 0
    assert_shows("a.mov", [f"a/frame_000{n}.png" for n in range(3)], 25)
    assert run("video", "a/frame_0002.png", "a/frame_0000.png", "--out", "b.mov") == 0
    assert_shows("b.mov", ["a/frame_0002.png", "a/frame_0000.png"], 24)
    capfd.readouterr()
    assert run("video", "a/frame_0002.png", "--out", "one.mov") == 0
    assert "wrote 1 frame at 24 a second to one.mov" in capfd.readouterr().out
    Path("a/frame_0001.png").unlink()
    Path("empty").mkdir()
    capfd.readouterr()
    for arguments, message in (
        (("video", "a", "--out", "c.mp4"), "a lacks frame_0001.png between others; make it (render --resume)"),
        (("video", "empty", "--out", "c.mp4"), "empty holds no frame_*.png"),
        (("video", "--out", "c.mp4"), "a video needs pictures, got none"),
        (("video", "a/frame_0001.png", "--out", "c.mp4"), "frame_0001.png is missing"),
        (("video", "a", "--out", "c.avi"), "a video must be .mp4 (H.264) or .mov (ProRes), got 'c.avi'"),
        (("video", "a", "--out", "a"), "--out must be a file"),
        (("video", "a", "--out", "c.mp4", "--fps", "0"), "--fps must be"),
        (("render", *SMALL, "--out", "d", "--video", "c.gif"), "--video must be .mp4 (H.264) or .mov (ProRes)"),
    ):
        assert run(*arguments) == 2, arguments
        error = capfd.readouterr().err
        assert message in error, error
        assert error.count("\n") == 1, error
    assert not list(Path().glob("*c.*"))
    assert not Path("d").exists()


def test_what_post_makes_of_other_renderers_frames_is_a_folder_of_one_sequence(capfd: pytest.CaptureFixture[str]):
    Path("a").mkdir()
    for n in (10, 9, 11):
        for name in (f"shot a.{n}", f"shot a.{n}_ao"):
            Image.new("RGB", (24, 16), (20 * n, 90, 90)).save(f"a/{name}.png")
        Path(f"a/shot a.{n}.exr").touch()
    pictures = [f"a/shot a.{n}.png" for n in (9, 10, 11)]
    assert run("video", "a", "--out", "a.mov") == 0
    assert_shows("a.mov", pictures, 24)
    assert run("video", "a/shot a.##.png", "--out", "b.mov") == 0
    assert_shows("b.mov", pictures, 24)
    Path("a/shot a.10.png").unlink()
    capfd.readouterr()
    assert run("video", "a", "--out", "c.mov") == 2
    assert "a lacks number 10 of shot a.####.png; give files to leave it out" in capfd.readouterr().err
    for n in (9, 11):
        Path(f"a/shot a.{n}.exr").unlink()
    assert run("video", "a", "--out", "c.mov") == 2
    assert "a holds several sequences; give one of them, such as a/shot a.####.png" in capfd.readouterr().err
    assert not Path("c.mov").exists()
