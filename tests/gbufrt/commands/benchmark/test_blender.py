"""The comparison with Blender: what its nodes are told, and what is made of their pictures."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from gbufrt.commands.ablation.cache import Cache
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.benchmark import blender
from gbufrt.commands.benchmark.blender import Job, compare_blender, in_blender
from gbufrt.commands.cli import main
from tracer.scene.view import View
from tracer.worlds import terrain

SIZE, LARGE = (24, 40), (48, 80)
STAND_IN = """
import json, sys
from pathlib import Path
import numpy as np
folder = Path(sys.argv[-1])
jobs = json.loads((folder / "jobs.json").read_text())
for job in jobs:
    image = np.load(folder / f"{job['name']}_Image.npy")
    assert image.dtype == np.float32
    np.save(folder / f"{job['name']}.npy", image * job["settings"]["by"])
(folder / "done.json").write_text(json.dumps({"version": "0.1", "ms": [job["repeats"] for job in jobs]}))
"""


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Place:
    """Hills that a camera flies over to the right."""
    monkeypatch.setattr(blender, "SIZE", SIZE)
    monkeypatch.setattr(blender, "HD", LARGE)
    monkeypatch.setattr(blender, "SAMPLES", 2)
    view = View(eye=lambda t: (8.0 + 24 * t**2, 18.0, -4.0), target=lambda t: (8.0 + 24 * t**2, 8.0, 16.0))
    scene = replace(terrain((32, 16, 32)), views={"flight": view})
    return Place(scene=scene, world="hills", view="flight", size=SIZE, samples=2, fps=4.0, cache=Cache(tmp_path))


def test_vector_blur_is_told_of_both_motions_with_y_up(place: Place) -> None:
    effect = blender.shutter(place)
    job = effect.theirs(effect.halves[0])
    speed, hit = job.inputs["Speed"], effect.halves[0].gbuffer.hit
    motion = effect.halves[0].read("motion")
    assert torch.equal(speed[:, 0], motion[:, 0])
    assert torch.equal(speed[:, 1], -motion[:, 1])
    ratio = (speed[:, 2:3] / speed[:, 0:1])[hit]
    torch.testing.assert_close(
        ratio, torch.full_like(ratio, (0.75**2 - 0.5**2) / (0.5**2 - 0.25**2)), rtol=0.01, atol=0
    )
    assert job.settings == {"sockets": {"Samples": 32, "Shutter": 0.5}}
    depth = job.inputs["Z"]
    assert torch.equal(depth[hit], effect.halves[0].gbuffer.depth[hit])
    assert bool((depth[~hit] == 1e10).all())
    assert effect.large.gbuffer.depth.shape[-2:] == LARGE
    assert not torch.equal(effect.ours(effect.halves[0]), effect.halves[0].read("color"))


def test_defocus_gets_our_lens(place: Place) -> None:
    effect = blender.aperture(place)
    g = effect.halves[0].gbuffer
    lens = effect.theirs(effect.halves[0]).settings["lens"]
    assert lens["aperture_radius"] == blender.APERTURE
    assert lens["focal_px"] == float(g.camera.intrinsics[0, 0, 0])
    assert float(g.depth[g.hit].min()) < lens["focus_distance"] < float(g.depth[g.hit].max())
    sky = blender.APERTURE * lens["focal_px"] / lens["focus_distance"]
    assert lens["max_radius_px"] >= sky + 1, "no disc is cut"
    large = effect.theirs(effect.large).settings["lens"]
    assert large["focus_distance"] == lens["focus_distance"]
    assert large["focal_px"] == 2 * lens["focal_px"]


def test_the_better_picture_has_the_higher_psnr(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    effect = blender.aperture(place)
    asked: list[list[Job]] = []

    def half_way(jobs: list[Job], python: str) -> tuple[list[torch.Tensor], list[float], str]:
        asked.append(jobs)
        sharp = [frame.read("color") for frame in effect.halves]
        return [jobs[0].inputs["Image"], *map(torch.lerp, sharp, effect.truth, (0.5, 0.5))], [7.0, 1.0, 1.0], "5.0"

    monkeypatch.setattr(blender, "in_blender", half_way)
    found: dict[str, str] = {}
    truths = iter((effect.truth[0], effect.truth[1]))
    own = effect._replace(ours=lambda frame: frame.read("color") if frame is effect.large else next(truths))
    quality = blender.compare(own, "python", 1, found)
    assert quality["psnr"] > quality["blender_psnr"] > quality["sharp_psnr"] + 3
    assert (quality["blender_ms"], found) == (7.0, {"version": "5.0"})
    assert asked[0][0].inputs["Image"].shape[-2:] == LARGE, "the large frame is timed"


def test_pictures_go_and_come_as_they_are(tmp_path: Path) -> None:
    script = tmp_path / "stand_in.py"
    script.write_text(STAND_IN)
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{script}" "$@"\n')
    python.chmod(0o755)
    images = [torch.rand(1, 3, 4, 6), torch.rand(1, 3, 2, 5)]
    jobs = [Job("node", {"Image": image}, {"by": 2.0}, repeats) for image, repeats in zip(images, (3, 1), strict=True)]
    made, times, version = in_blender(jobs, str(python))
    assert (times, version) == ([3, 1], "0.1")
    assert all(torch.equal(found, 2 * image) for found, image in zip(made, images, strict=True))


def test_why_there_is_nothing_is_said(place: Place, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert compare_blender(None, 1) == {"error": blender.NO_BPY}
    monkeypatch.setattr("tracer.worlds.builtin", lambda: place.scene)
    monkeypatch.setattr(blender, "MOVING", "flight")
    python = tmp_path / "python"
    python.write_text('#!/bin/sh\necho "ModuleNotFoundError: no bpy here" >&2\nexit 1\n')
    python.chmod(0o755)
    for path, why in ((python, "ModuleNotFoundError: no bpy here"), (tmp_path / "none", "No such file")):
        error = compare_blender(str(path), 1)["error"]
        assert error.startswith(f"{path} could not run Blender: ")
        assert why in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--blender", sys.executable], "--blender says where --peers finds bpy; add --peers"),
        (["--peers", "--blender", "none"], "there is no 'none'"),
    ],
)
def test_the_option(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["bench", *arguments])
    assert end.value.code == 2
    assert message in capsys.readouterr().err


@pytest.mark.skipif(blender.blender_python() is None, reason="bpy is not installed")
def test_blender_has_the_conventions_that_it_is_told_by() -> None:
    """A square that moves to the right and up, and a dot out of focus."""
    image = torch.zeros(1, 3, 64, 96)
    image[..., 28:36, 44:52] = 1.0
    speed = torch.zeros(1, 4, 64, 96)
    speed[:, 0, 28:36, 44:52], speed[:, 3, 28:36, 44:52] = -20.0, -12.0  # it was left of here, and will be higher
    inputs = {"Image": image, "Speed": speed, "Z": torch.where(image[:, :1] > 0, 5.0, 9.0)}
    moved = Job("CompositorNodeVecBlur", inputs, {"sockets": {"Samples": 64, "Shutter": 1.0}})
    dot = torch.zeros(1, 3, 64, 96)
    dot[..., 32, 48] = 1.0
    lens = {"aperture_radius": 0.5, "focus_distance": 6.0, "focal_px": 100.0, "max_radius_px": 20.0}
    far = Job("CompositorNodeDefocus", {"Image": dot, "Z": torch.full((1, 1, 64, 96), 1e10)}, {"lens": lens})
    python = blender.blender_python()
    assert python is not None
    (blurred, spread), *_ = in_blender([moved, far], python)
    rows, columns = (blurred[0, 0] > 0.02).nonzero().T
    assert abs(int(columns.min()) - 34) <= 1
    assert abs(int(columns.max()) - 51) <= 1
    assert abs(int(rows.min()) - 22) <= 1
    assert abs(int(rows.max()) - 35) <= 1
    area = float(spread[0, 0].sum() / spread[0, 0].max())
    assert area == pytest.approx(torch.pi * (0.5 * 100 / 6) ** 2, rel=0.15)
