"""Camera cuts in sequences of other renderers: found by what is in view, or told by the camera file."""

from __future__ import annotations

import math
from pathlib import Path

import boxes
import numpy as np
import pytest
import torch
from writers import foreign_exr

from gbufrt import Camera
from gbufrt.commands.foreign import Source
from gbufrt.files.gbuffers.cameras import load_cameras
from gbufrt.files.gbuffers.cuts import cut_between

SIZE = (54, 72)
EYE = torch.tensor([0.0, 1.5, 3.0])


def shot(turn: float, eye: torch.Tensor = EYE) -> Camera:
    """A camera that looks along -z, turned by degrees to the right."""
    angle = math.radians(turn)
    return Camera.look_at(eye, eye + torch.tensor([math.sin(angle), -0.1, -math.cos(angle)]), size=SIZE, fov_y=60)


@pytest.mark.parametrize("turn", [0.0, 5.0, 15.0, 30.0])
def test_fast_pans_are_no_cuts(turn: float) -> None:
    assert cut_between(boxes.frame(shot(0)), boxes.frame(shot(turn))) == ""


@pytest.mark.parametrize("step", [(0.5, 0.0, 0.0), (0.0, 0.0, -0.8), (0.0, 0.5, 0.0)])
def test_fast_dollies_are_no_cuts(step: tuple[float, float, float]) -> None:
    assert cut_between(boxes.frame(shot(0)), boxes.frame(shot(0, EYE + torch.tensor(step)))) == ""


def test_another_place_or_direction_is_a_cut() -> None:
    before = boxes.frame(shot(0))
    assert cut_between(before, boxes.frame(shot(60))).startswith("the camera turns by ")
    behind = boxes.frame(shot(20, EYE + torch.tensor([0.0, -1.0, -20.0])))  # behind the box
    assert cut_between(before, behind) == "the frame before shows 0% of what is in view"


def test_what_moves_before_a_still_camera_is_no_cut() -> None:
    gone = boxes.ROOM.clone()
    gone[:, :, 1] -= 0.5  # all of it has moved
    assert cut_between(boxes.frame(shot(0)), boxes.frame(shot(0), boxes=gone)) == ""


def sequence(folder: Path, frames: str) -> Source:
    """Two files of one picture, before cameras of two frames."""
    truth = foreign_exr.truth()
    layers = {"depth.Y": np.where(truth["hit"], truth["planar"], 0), "normal.XYZ": truth["normal"]}
    layers |= {"RGB": np.full((*foreign_exr.SIZE, 3), 0.5), "motion.XY": truth["motion"]}
    paths = [foreign_exr.write(folder / f"a_{n:04d}.exr", layers) for n in (1, 2)]
    (folder / "c.toml").write_text(f"fov = 50\n{frames}")
    return Source.named(paths, "generic", folder / "c.toml", None)


def table(number: int, camera: Camera, more: str = "") -> str:
    return f"[[frames]]\nnumber = {number}\n{more}world_from_view = {camera.world_from_view[0].tolist()}\n"


@pytest.mark.parametrize("told", [False, True])
def test_a_camera_file_may_tell_of_a_cut(tmp_path: Path, told: bool) -> None:
    both = table(1, foreign_exr.BEFORE) + table(2, foreign_exr.CAMERA, "cut = true\n" if told else "")
    _, second = sequence(tmp_path, both).frames()
    g = second.gbuffer
    assert (g.previous_camera is None) == told
    assert (g.motion is None) == told
    assert (second.cut is not None and bool(second.cut.all())) == told


def test_a_cut_that_is_found_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    back = Camera.look_at((0, 2, 4), (0, 1.2, 8), size=foreign_exr.SIZE, fov_y=50)
    _, second = sequence(tmp_path, table(1, back) + table(2, foreign_exr.CAMERA)).frames()
    assert second.cut is not None
    assert second.gbuffer.previous_camera is None
    assert "degrees in one frame: taken for a cut, histories begin anew" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["fov = 50\ncut = true\n", "fov = 50\n" + "[[frames]]\nnumber = 1\ncut = 1\n"])
def test_cuts_are_true_or_false_and_of_frames(tmp_path: Path, text: str) -> None:
    (tmp_path / "c.toml").write_text(text.replace("fov", "location = [0, 0, 0]\nrotation = [0, 0, 0]\nfov"))
    with pytest.raises(ValueError, match=r"cut must be true or false, under \[\[frames\]\]"):
        load_cameras(tmp_path / "c.toml")
