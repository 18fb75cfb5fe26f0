"""Videos: colours come back, tagged as what they are; frames are as many and as long as asked for."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from gbufrt.files.png import write_png
from gbufrt.files.video import write_video

av = pytest.importorskip("av", reason="PyAV is not installed: pip install gbufrt[video]")

COLOURS = [(0, 0, 0), (255, 255, 255), (255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 128, 128), (9, 60, 90)]


def flat_frames(folder: Path, *, bits: int = 8, size: tuple[int, int] = (48, 64)) -> list[Path]:
    paths = [folder / f"frame_{n:04d}.png" for n in range(len(COLOURS))]
    for path, colour in zip(paths, COLOURS, strict=True):
        write_png(path, (torch.tensor(colour) / 255.0).view(3, 1, 1).expand(3, *size), bits=bits)
    return paths


def shown_at(frame: Any, row: int, column: int) -> list[float]:
    """Red, green and blue of a pixel, by ITU-R BT.709-6 for limited range: libswscale would round 10 bits down."""
    bits, values = frame.format.components[0].bits, []
    for plane, part in zip(frame.planes, frame.format.components, strict=True):
        rows = np.frombuffer(bytes(plane), np.uint16 if bits > 8 else np.uint8).reshape(plane.height, -1)
        level = rows[row * part.height // frame.height, column * part.width // frame.width]
        values.append(int(level) / 2 ** (bits - 8))
    y, u, v = (values[0] - 16) / 219, (values[1] - 128) / 224, (values[2] - 128) / 224
    red, blue = y + 1.5748 * v, y + 1.8556 * u
    return [255 * red, 255 * (y - 0.2126 * red - 0.0722 * blue) / 0.7152, 255 * blue]


@pytest.mark.parametrize("ending", [".mp4", ".mov"])
@pytest.mark.parametrize("bits", [8, 16])
def test_colours_come_back(tmp_path: Path, ending: str, bits: int):
    write_video(tmp_path / f"a{ending}", flat_frames(tmp_path, bits=bits), fps=23.976)
    with av.open(str(tmp_path / f"a{ending}")) as file:
        stream = file.streams.video[0]
        assert stream.codec_context.name == {".mp4": "h264", ".mov": "prores"}[ending]
        assert stream.average_rate == Fraction(2997, 125)
        context = stream.codec_context
        assert (context.colorspace, context.color_primaries, context.color_trc, context.color_range) == (1, 1, 1, 1)
        frames = list(file.decode(stream))
    assert len(frames) == len(COLOURS)
    for frame, colour in zip(frames, COLOURS, strict=True):
        assert shown_at(frame, 7, 9) == pytest.approx(colour, abs=2)
    assert sorted(path.suffix for path in tmp_path.iterdir()) == sorted([ending, *[".png"] * len(COLOURS)])


def test_odd_sizes_keep_the_picture(tmp_path: Path):
    levels = np.tile(np.linspace(20, 230, 31).astype(np.uint8)[None, :, None], (21, 1, 3))
    Image.fromarray(levels).save(tmp_path / "a.png")
    write_video(tmp_path / "a.mov", [tmp_path / "a.png"] * 2)
    with av.open(str(tmp_path / "a.mov")) as file:
        frame = next(file.decode(video=0))
    assert (frame.height, frame.width) == (22, 32)
    for row, column in ((0, 0), (20, 30), (21, 31), (11, 16)):
        assert shown_at(frame, row, column) == pytest.approx(levels[min(row, 20), min(column, 30)], abs=3)


def test_what_is_wrong_is_told_and_nothing_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    paths = flat_frames(tmp_path)
    data = paths[3].read_bytes()
    Image.new("RGB", (10, 10)).save(tmp_path / "small.png")
    (tmp_path / "cut.png").write_bytes(data[:60])
    huge = bytearray(data)
    huge[16:24] = (100_000).to_bytes(4, "big") * 2
    (tmp_path / "huge.png").write_bytes(huge)
    before = sorted(tmp_path.iterdir())
    for name, message in (
        ("none.png", r"none\.png is missing"),
        ("small.png", r"small\.png has 10x10 pixels, .*frame_0000\.png 64x48; a video wants one size"),
        ("cut.png", r"cut\.png is (no PNG, or )?damaged; make it again"),
        ("huge.png", r"huge\.png (is no PNG, or damaged|has 100000x100000 pixels)"),
    ):
        with pytest.raises((ValueError, FileNotFoundError), match=message):
            write_video(tmp_path / "a.mp4", [*paths, tmp_path / name])
    with pytest.raises(ValueError, match=r"must be \.mp4 \(H\.264\) or \.mov \(ProRes\), got 'a\.avi'"):
        write_video(tmp_path / "a.avi", paths)
    with pytest.raises(ValueError, match="needs pictures, got none"):
        write_video(tmp_path / "a.mp4", [])
    monkeypatch.setattr("gbufrt.files.video.MAX_PIXELS", 100)
    with pytest.raises(ValueError, match="more than the limit of 100"):
        write_video(tmp_path / "a.mp4", paths)
    assert sorted(tmp_path.iterdir()) == before
