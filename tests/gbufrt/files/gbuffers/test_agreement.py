"""Agreement tests: what moves by itself tells the sign and unit of motion, and little pictures tell nothing."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import boxes
import numpy as np
import pytest
import torch
from writers import foreign_exr

from gbufrt import Frame
from gbufrt.commands.foreign import Source
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.agreement import disagreements

CAMERA = boxes.camera((54, 72))
STEP = torch.tensor([2.0, 1.2, 0.5])  # of the box in the middle, from the frame before


def moved(step: torch.Tensor = STEP) -> tuple[Frame, Frame]:
    """A frame in which the box has moved, with its true motion, and the one before."""
    room = boxes.ROOM.clone()
    room[2] += step
    frame = boxes.frame(CAMERA, boxes=room)
    g = frame.gbuffer
    box = g.hit & (boxes.trace(CAMERA, room)[1] == 2)[:, None]
    now = CAMERA.to_world(CAMERA.unproject(g.depth))
    before = CAMERA.to_view(now - box * step.view(1, 3, 1, 1))
    motion = torch.where(g.hit, CAMERA.project(before) - CAMERA.project(CAMERA.to_view(now)), 0.0)
    motion_z = torch.where(g.hit, before[:, 2:] - g.depth, 0.0)
    g = g.replace(motion=motion, motion_z=motion_z, previous_camera=None)
    return frame.replace(gbuffer=g), boxes.frame(CAMERA)


@pytest.mark.parametrize(
    ("factors", "setting"),
    [
        ((1, 1), None),
        ((-1, -1), "motion_scale with both signs changed (or the other motion_target)"),
        ((1, -1), "motion_scale with the sign of y changed"),
        ((-1, 1), "motion_scale with the sign of x changed"),
        ((1 / 72, 1 / 54), 'motion_unit = "uv"'),
        ((72, 54), 'motion_unit = "pixels"'),
        ((-1 / 72, 1 / 54), 'motion_unit = "uv" and motion_scale with the sign of x changed'),
    ],
)
def test_what_moves_by_itself_tells_the_setting(factors: tuple[float, float], setting: str | None) -> None:
    frame, before = moved()
    g = frame.gbuffer
    assert g.motion is not None
    motion = g.motion * g.motion.new_tensor(factors).view(1, 2, 1, 1)
    lines = disagreements(frame.replace(gbuffer=g.replace(motion=motion)), before)
    if setting is None:
        assert lines == []
    else:
        (line,) = lines
        assert line.startswith(f"{setting} fits better: motion agrees with the frame before at ")
        share, instead = (float(word.strip("%")) for word in line.split() if word.endswith("%"))
        assert share > 80 > 60 > instead


@pytest.mark.parametrize(("length", "known"), [(1.0, False), (0.01, True)])
def test_without_the_frame_before_or_with_a_step_too_short_nothing_is_told(length: float, known: bool) -> None:
    frame, before = moved(STEP * length)
    g = frame.gbuffer
    assert g.motion is not None
    wrong = frame.replace(gbuffer=g.replace(motion=-g.motion))
    assert disagreements(wrong, before if known else None) == []


def test_a_picture_of_few_pixels_tells_nothing(tmp_path: Path) -> None:
    layers = {"V.Depth.Z": np.full((2, 2), 5.0), "V.Normal.XYZ": np.ones((2, 2, 3))}
    camera = foreign_exr.Camera.look_at((0, 0, 5), (0, 0, 0), size=(2, 2), fov_y=50)
    assert disagreements(read_gbuffer(foreign_exr.write(tmp_path / "a.exr", layers), camera=camera)) == []


def test_under_a_camera_that_is_only_taken_to_stand_still_movers_tell_no_sign() -> None:
    frame, before = moved()
    g = frame.gbuffer
    assert g.motion is not None
    wrong = frame.replace(gbuffer=g.replace(motion=-g.motion))
    assert disagreements(wrong, before) != []
    assert disagreements(wrong, before, posed=False) == []


def test_movers_before_a_camera_that_dollies_have_its_motion_of_z(tmp_path: Path) -> None:
    """That their depth did not change is wrong: they would lose their history, and their exact motion seem false."""
    truth = foreign_exr.truth()
    moves = truth["hit"] & (np.indices(foreign_exr.SIZE)[1] < 20)
    motion = truth["motion"] + np.where(moves[..., None], 5.0, 0.0)
    layers = {"depth.Y": np.where(truth["hit"], truth["planar"], 0), "normal.XYZ": truth["normal"], "motion.XY": motion}
    path = foreign_exr.write(tmp_path / "a.exr", layers)
    g = read_gbuffer(path, "generic", camera=foreign_exr.CAMERA, previous_camera=foreign_exr.BEFORE).gbuffer
    static, static_z = g.camera.static_motion(foreign_exr.BEFORE, g.depth, g.hit)
    assert g.motion is not None
    assert g.motion_z is not None
    assert float((g.motion - static).abs().amax(1)[0][torch.from_numpy(moves)].min()) > 4
    assert float(static_z.abs().max()) > 0.05
    assert torch.equal(g.motion_z, static_z)


def test_motion_of_nothing_is_no_motion_of_a_camera_that_moves(tmp_path: Path) -> None:
    """As Blender's Vector where motion blur is on."""
    path = foreign_exr.write(tmp_path / "a.exr", plain(motion_XY=np.zeros((*foreign_exr.SIZE, 2))))
    with pytest.warns(UserWarning, match="motion is 0 everywhere although the camera moves"):
        frame = read_gbuffer(path, camera=foreign_exr.CAMERA, previous_camera=foreign_exr.BEFORE)
    g = frame.gbuffer
    assert g.motion is not None
    assert torch.equal(g.motion, g.camera.static_motion(foreign_exr.BEFORE, g.depth, g.hit)[0])
    assert disagreements(frame) == []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_gbuffer(path, camera=foreign_exr.CAMERA, previous_camera=foreign_exr.CAMERA)


def plain(**changes: np.ndarray) -> dict[str, np.ndarray]:
    truth = foreign_exr.truth()
    depth = np.where(truth["hit"], truth["planar"], 0)
    layers = {"depth.Y": depth, "normal.XYZ": truth["normal"], "albedo.RGB": np.full((*foreign_exr.SIZE, 3), 0.5)}
    return layers | {name.replace("_", "."): pixels for name, pixels in changes.items()}


def test_a_camera_of_more_than_the_picture_shows_is_named(tmp_path: Path) -> None:
    """As of a border that Blender crops the picture to, without a word in the file."""
    path = foreign_exr.write(tmp_path / "a.exr", plain())
    wide = foreign_exr.CAMERA.intrinsics.clone()
    wide[:, :2, :2] *= 0.4
    (line,) = disagreements(read_gbuffer(path, camera=replace(foreign_exr.CAMERA, intrinsics=wide)))
    assert "no setting makes them; check the camera" in line


def test_normals_that_no_setting_makes_agree_are_said_with_their_share(tmp_path: Path) -> None:
    truth = foreign_exr.truth()
    assert disagreements(read_gbuffer(foreign_exr.write(tmp_path / "a.exr", plain()), camera=foreign_exr.CAMERA)) == []
    near = np.where(truth["hit"], 1 - np.clip(truth["planar"] / 40, 0, 0.9), 0)  # white is near
    path = foreign_exr.write(tmp_path / "b.exr", plain(depth_Y=near))
    lines = disagreements(read_gbuffer(path, camera=foreign_exr.CAMERA))
    assert any('depth_kind = "normalised", reversed = true fits better' in line for line in lines)
    noise = np.random.default_rng(0).uniform(0.1, 0.9, truth["hit"].shape)
    path = foreign_exr.write(tmp_path / "c.exr", plain(depth_Y=np.where(truth["hit"], near**0.2 + 0.001 * noise, 0)))
    lines = disagreements(read_gbuffer(path, camera=foreign_exr.CAMERA))
    assert any("no setting makes them; depth lies within 0 and 1, and may be normalised" in line for line in lines)


@pytest.mark.parametrize(
    ("most", "why"),
    [(128.0, "divide it if it counts to 255"), (1.4, "what is seen through another surface may add to it")],
)
def test_colours_that_are_clamped_are_told(tmp_path: Path, most: float, why: str) -> None:
    """Renderers add up what lies behind surfaces of some opacity; others count to 255."""
    path = foreign_exr.write(tmp_path / "a.exr", plain(albedo_RGB=np.full((*foreign_exr.SIZE, 3), most)))
    with pytest.warns(UserWarning, match=f"albedo reaches {most:g}, and is clamped to 1; {why}"):
        read_gbuffer(path, camera=foreign_exr.CAMERA)


def test_a_data_window_outside_the_display_window_is_named(tmp_path: Path) -> None:
    windows = {"dataWindow": ((1000, 50), (1063, 97)), "displayWindow": ((0, 0), (63, 47))}
    path = foreign_exr.write(tmp_path / "a.exr", plain(), windows)  # pyright: ignore[reportArgumentType]
    with pytest.warns(
        UserWarning, match=r"depth\.Y \(1000, 50 to 1063, 97\) lies outside the display window \(0, 0 to"
    ):
        read_gbuffer(path, camera=foreign_exr.CAMERA)


def test_a_channel_that_vanishes_is_said_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in range(1, 5):
        layers = plain() if number < 3 else {n: p for n, p in plain().items() if n != "albedo.RGB"}
        foreign_exr.write(tmp_path / f"a_{number:04d}.exr", layers)
    source = Source.named(sorted(tmp_path.glob("*.exr")), "generic", None, 50.0)
    for shot in source.shots:
        source.read(shot)
    told = capsys.readouterr().err
    assert told.count("lacks albedo") == 1
    assert "frame 3 (" in told


@pytest.mark.parametrize(
    ("turn", "setting"), [((0, 1, 2), None), ((0, 2, 1), 'up = "z" fits better: mean normals agree with depth in ')]
)
def test_normals_that_maps_tip_agree_in_the_mean(turn: tuple[int, int, int], setting: str | None) -> None:
    """By 17 degrees, over twenty pixels: hardly one normal is that of the depth."""
    frame = boxes.frame(boxes.camera((108, 144)))
    g = frame.gbuffer
    y, x = torch.meshgrid(torch.arange(108.0), torch.arange(144.0), indexing="ij")
    tip = 0.3 * torch.stack([torch.sin(2 * torch.pi * t / 20) for t in (x, y, x + y)])
    normal = torch.nn.functional.normalize(g.normal + tip * g.hit, dim=1)[:, list(turn)]
    normal[:, 1] *= -1 if setting else 1  # as a world with z up has them
    lines = disagreements(frame.replace(gbuffer=g.replace(normal=normal)))
    assert [line[: len(setting or "")] for line in lines] == ([setting] if setting else [])


def test_what_is_wrong_in_all_frames_is_said_once(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    files = []
    for n in (1, 2, 3):
        wrong = -foreign_exr.truth()["normal"]
        wrong[:n] = 0  # so that shares differ
        files.append(foreign_exr.write(tmp_path / f"a.{n}.exr", plain(normal_XYZ=wrong, RGB=wrong**2)))
    profile = tmp_path / "own.toml"
    profile.write_text('base = "generic"\nup = "y"\nnormal_space = "world"\ndepth_kind = "planar"')
    camera = tmp_path / "camera.toml"
    pose = foreign_exr.CAMERA.world_from_view[0].tolist()
    camera.write_text(f'convention = "opencv"\nup = "y"\nfov = 50.0\nworld_from_view = {pose}')
    list(Source.of(files, str(profile), camera, None).frames())
    assert capfd.readouterr().err.count("normal_scale with all signs changed fits better") == 1
