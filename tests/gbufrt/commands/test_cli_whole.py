"""The command line over the real tracer and passes, at a tiny size."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

from gbufrt.commands.cli import main
from gbufrt.files.exr import read_exr
from gbufrt.files.views import debug_names, debug_view

TINY = ("--size", "40x24", "--warmup", "2", "--light-samples", "1")
RESULTS = ("ao", "gi", "reflection", "composite", "color", "image")


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as exit:
        main([str(argument) for argument in arguments])
    assert isinstance(exit.value.code, int)
    return exit.value.code


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("render") / "out"
    assert run("render", "--view", "plaza", "--frames", 2, "--preset", "low", *TINY, "--out", out, "--debug") == 0
    return out


def test_every_signal_is_there_and_finite(rendered: Path):
    for index in (0, 1):
        frame = read_exr(rendered / f"frame_{index:04d}.exr")
        frame.gbuffer.validate()
        assert set(RESULTS) <= set(frame.present)
        for name in debug_names(frame):
            assert bool(torch.isfinite(debug_view(frame, name)).all()), name
        for name in RESULTS:
            assert bool(torch.isfinite(frame.read(name)).all()), name
        image = frame.read("image")
        assert 0.05 < float(image.mean()) < 0.95
        assert float(image.std()) > 0.03
    assert (rendered / "debug" / "frame_0001_sheet.png").exists()


def assert_same(a: Path, b: Path) -> None:
    left, right = read_exr(a), read_exr(b)
    for name in RESULTS:
        assert float((left.read(name) - right.read(name)).abs().max()) <= 1e-4, name


def test_post_agrees_with_render(rendered: Path, tmp_path: Path):
    assert run("post", rendered, "--out", tmp_path) == 0
    for index in (0, 1):
        assert_same(rendered / f"frame_{index:04d}.exr", tmp_path / f"frame_{index:04d}.exr")


def test_another_preset_and_resuming(tmp_path: Path):
    low, high, again = (tmp_path / name for name in ("low", "high", "again"))
    command = ("render", "terrain", "--frames", 2, *TINY)
    assert run(*command, "--preset", "low", "--out", low) == 0
    assert run(*command, "--preset", "medium", "--out", high) == 0
    assert run("post", low, "--preset", "medium", "--out", again) == 0
    for index in (0, 1):
        assert_same(high / f"frame_{index:04d}.exr", again / f"frame_{index:04d}.exr")
    whole = (high / "frame_0001.exr").rename(tmp_path / "whole.exr")
    assert run(*command, "--preset", "medium", "--out", high, "--resume") == 0
    assert_same(whole, high / "frame_0001.exr")


def test_unknown_names_list_the_known(capfd: pytest.CaptureFixture[str], tmp_path: Path):
    for arguments, message in (
        (("--view", "moon"), "it has village"),
        (("--without", "bloom"), "it has "),
        (("atlantis",), "atlantis"),
        (("missing.vox",), "missing.vox"),
    ):
        assert run("render", *arguments, *TINY, "--out", tmp_path / "out") == 2
        error = capfd.readouterr().err
        assert message in error
        assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_ctrl_c_from_outside(tmp_path: Path):
    # a process started in the background, as tests often are, hands down an ignored SIGINT
    restore = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{restore}; from gbufrt.commands.cli import main; main()"
    command = [sys.executable, "-c", code, "render", "terrain", "--frames", "500"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    out = tmp_path / "out"
    work = subprocess.Popen(
        [*command, *TINY, "--preset", "low", "--out", str(out)], stderr=subprocess.PIPE, env=environment, text=True
    )
    deadline = time.monotonic() + 300
    while not (out / "frame_0000.exr").exists() and work.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    work.send_signal(signal.SIGINT)
    _, error = work.communicate(timeout=300)
    assert work.returncode == 130, error
    assert error.strip().splitlines()[-1].startswith("gbufrt: interrupted")
    assert "Traceback" not in error
    written = sorted(out.iterdir())
    assert not [path for path in written if path.name.endswith(".part")]
    for path in written:
        if path.suffix == ".exr":
            read_exr(path)


def test_vox_scene(tmp_path: Path):
    folder = os.environ.get("GBUFRT_TEST_DATA")
    if not folder:
        pytest.skip("GBUFRT_TEST_DATA is not set: no real .vox scenes to render")
    scene = Path(folder) / "vox" / "scene_store8.vox"
    assert run("render", scene, "--preset", "low", *TINY, "--out", tmp_path / "out") == 0
    frame = read_exr(tmp_path / "out" / "frame_0000.exr")
    materials = frame.gbuffer.material_id
    assert materials is not None
    assert len(materials.unique()) > 10
