"""EXR files of every origin, damaged: one clear line, or a picture of the size in its header, in little memory."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import boxes
import numpy as np
import OpenEXR
import pytest
from damage import damaged

from gbufrt.files.exr import read_exr, write_exr
from gbufrt.files.guard import most_bytes, read_parts

REAL = ("blender4515_cycles_multilayer", "blender501_cycles_multipart", "mitsuba391_aov")


def survives(path: Path, data: bytes, seeds: range) -> int:
    """How many damaged copies are refused; the others are pictures within bounds."""
    before, told = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, []
    for seed in seeds:
        path.write_bytes(damaged(data, seed))
        try:
            parts = read_parts(path)
        except ValueError as error:
            told.append(str(error))
            continue
        for part in parts:
            assert all(part.channels[name].shape == part.size for name in part.names), seed
            assert sum(part.channels[name].nbytes for name in part.names) <= most_bytes()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200 << 10  # kilobytes
    assert all(str(path) in message and "\n" not in message for message in told)
    return len(told)


@pytest.mark.parametrize("name", REAL)
def test_real_files(tmp_path: Path, name: str):
    if "GBUFRT_TEST_DATA" not in os.environ:
        pytest.skip("GBUFRT_TEST_DATA is not set: it names the folder with files of other programs")
    data = (Path(os.environ["GBUFRT_TEST_DATA"]) / "exr" / f"{name}.exr").read_bytes()
    assert survives(tmp_path / "a.exr", data, range(60)) >= 25


@pytest.mark.parametrize("choices", [{"compression": "zip"}, {"compression": "dwaa"}])
def test_own_files(tmp_path: Path, choices: dict[str, str]):
    write_exr(tmp_path / "b.exr", boxes.frame(boxes.camera((16, 24))), precision="half", **choices)  # pyright: ignore[reportArgumentType]
    assert survives(tmp_path / "a.exr", (tmp_path / "b.exr").read_bytes(), range(100)) >= 70


def test_memory_is_bounded_by_what_is_allowed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "a.exr"
    OpenEXR.File({}, {f"layer{n}.X": np.zeros((512, 1024), np.float32) for n in range(8)}).write(str(path))
    monkeypatch.setenv("GBUFRT_MAX_GB", "0.01")
    with pytest.raises(ValueError, match=r"a\.exr claims 0\.0 GB of pixels, more than .* 0\.01; if true, set"):
        read_parts(path)
    monkeypatch.setenv("GBUFRT_MAX_GB", "0.02")
    assert len(read_parts(path)[0].names) == 8
    for text in ("much", "-1", "nan"):
        monkeypatch.setenv("GBUFRT_MAX_GB", text)
        with pytest.raises(ValueError, match=f"GBUFRT_MAX_GB must be a positive number of gigabytes, got '{text}'"):
            read_exr(path)


def test_deep_pixels_are_told_whatever_their_header_says_of_them(tmp_path: Path):
    """Of a standard attribute that the bindings do not read, as deep files of compositing programs have it."""
    state = b"deepImageState\0deepImageState\0\1\0\0\0\3"
    path = tmp_path / "a.exr"
    OpenEXR.File({}, {"Z": np.zeros((4, 4), np.float32)}).write(str(path))
    data = path.read_bytes()
    path.write_bytes(data[:8] + state + data[8:])
    with pytest.raises(ValueError, match="holds deep pixels, which gbufrt does not read; flatten it first"):
        read_parts(path)
