"""Files with the stock names of programs without a profile of their own, and motion that they count as they like."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from writers.foreign_exr import BEFORE, CAMERA, SIZE, truth, write

from gbufrt.commands.foreign import Source
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.agreement import disagreements
from gbufrt.gbuffer import GBuffer

T = truth()
HIT, SKY = T["hit"], ~T["hit"]
PLANAR = np.where(SKY, 0, T["planar"])
GREY = np.full((*SIZE, 3), 0.5)
VIEW = (T["normal"] @ CAMERA.world_from_view[0, :3, :3].double().numpy()) * (1, -1, -1)  # y up, z to the viewer
CODED = T["normal"] / 2 + 0.5
UP = T["motion"] * (-1, 1)
NDC = UP / SIZE[::-1] * 2
FILES = {
    "redshift": {"Z.R": PLANAR, "Normals.RGB": CODED, "MotionVectors.RG": UP / 64 + 0.5, "DiffuseFilter.RGB": GREY},
    "vray": {"VRayZDepth.R": PLANAR, "VRayNormals.RGB": VIEW, "VRayVelocity.RG": UP, "VRayDiffuseFilter.RGB": GREY},
    "octane": {"Z depth.R": PLANAR, "Shading normal.RGB": CODED, "Motion vector.RG": NDC, "Diffuse filter.RGB": GREY},
    "moonray": {"Z": PLANAR, "N.XYZ": VIEW, "motionvec.XY": NDC, "albedo.RGB": GREY},
    "moonray's guide": {"depth.Z": PLANAR, "N.XYZ": VIEW, "motion_vectors.RG": NDC, "albedo.RGB": GREY},
    "solaris": {"C.rgb": GREY, "depth.z": PLANAR, "N.xyz": T["normal"], "motion.xy": UP, "albedo.rgb": GREY},
}
CAMERAS = """
intrinsics = {intrinsics}
convention = "opencv"
[[frames]]
number = 1
world_from_view = {before}
[[frames]]
number = 2
world_from_view = {now}
[[frames]]
number = 3
world_from_view = {now}
"""


def _off(g: GBuffer, name: str, true: np.ndarray) -> float:
    return float(np.abs(getattr(g, name)[0].permute(1, 2, 0).numpy() - true)[HIT].max())


@pytest.mark.parametrize("name", FILES)
@pytest.mark.filterwarnings("ignore:motion is read with")
def test_stock_names_give_the_whole_frame(name: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", {"RGB": GREY} | FILES[name])
    frame = read_gbuffer(path, camera=CAMERA, previous_camera=BEFORE)
    frame.validate()
    assert disagreements(frame) == []
    assert frame.composite is not None
    assert "normal_estimated" not in frame.extra
    for channel, true in (("depth", PLANAR[..., None]), ("normal", T["normal"]), ("motion", T["motion"])):
        assert _off(frame.gbuffer, channel, true) < 1e-4
    assert _off(frame.gbuffer, "albedo", GREY) < 1e-6


def test_motion_that_plain_names_tell_is_read_otherwise_only_where_that_fits_the_cameras(tmp_path: Path) -> None:
    layers = {"RGB": GREY, "depth.Z": PLANAR, "normal.XYZ": T["normal"]}
    movers = T["motion"].copy()
    movers[20:30, 20:30] += 3
    for told, found in ((movers, movers), (movers * (-1, 1), movers), (0 * movers + 4, 0 * movers + 4)):
        path = write(tmp_path / "a.exr", layers | {"motion.XY": told})
        g = read_gbuffer(path, camera=CAMERA, previous_camera=BEFORE).gbuffer
        assert _off(g, "motion", found) < 1e-4
        assert _off(read_gbuffer(path, camera=CAMERA).gbuffer, "motion", told) < 1e-4


@pytest.mark.filterwarnings("ignore:motion is read with")
@pytest.mark.parametrize("name", ["motionvector.RG", "velocity.RG"])
def test_motion_is_read_alike_where_the_camera_stands_again(name: str, tmp_path: Path) -> None:
    poses = {"now": CAMERA, "before": BEFORE}
    told = {key: camera.world_from_view[0].tolist() for key, camera in poses.items()}
    cameras = tmp_path / "camera.toml"
    cameras.write_text(CAMERAS.format(intrinsics=CAMERA.intrinsics[0].tolist(), **told))
    mover = np.zeros((*SIZE, 2))
    mover[20:30, 20:30] = 3, 2
    layers = {"RGB": GREY, "Z.Z": PLANAR, "N.XYZ": T["normal"], "albedo.RGB": GREY}
    files = [
        write(tmp_path / f"a.{n}.exr", layers | {name: motion * (-1, 1)})
        for n, motion in ((1, 0 * mover), (2, T["motion"]), (3, mover))
    ]
    *_, last = Source.of(files, "auto", cameras, None).frames()
    assert _off(last.gbuffer, "motion", mover) < 1e-4


def test_motion_that_fitted_as_it_was_is_not_read_otherwise_later(tmp_path: Path) -> None:
    """Frames 2 and 4 have the same cameras; all that moves in the latter goes the other way, as in a train."""
    now, before = (camera.world_from_view[0].tolist() for camera in (CAMERA, BEFORE))
    more = f"[[frames]]\nnumber = 4\nworld_from_view = {now}\n"
    poses = CAMERAS.replace("number = 3\nworld_from_view = {now}", "number = 3\nworld_from_view = {before}") + more
    cameras = tmp_path / "camera.toml"
    cameras.write_text(poses.format(intrinsics=CAMERA.intrinsics[0].tolist(), now=now, before=before))
    layers = {"RGB": GREY, "depth.Z": PLANAR, "normal.XYZ": T["normal"], "albedo.RGB": GREY}
    told = {1: 0 * T["motion"], 2: T["motion"], 3: -T["motion"], 4: T["motion"] * (-1, 1)}
    files = [write(tmp_path / f"a.{n}.exr", layers | {"motion.XY": motion}) for n, motion in told.items()]
    *_, last = Source.of(files, "auto", cameras, None).frames()
    assert _off(last.gbuffer, "motion", told[4]) < 1e-4


@pytest.mark.parametrize("unit", [0.001, 0.0254, 3.28, 100.0])
def test_depth_of_another_unit_than_the_cameras_is_told_by_motion(unit: float, tmp_path: Path) -> None:
    layers = {"RGB": GREY, "depth.Z": PLANAR / unit, "normal.XYZ": T["normal"], "motion.XY": T["motion"]}
    frame = read_gbuffer(write(tmp_path / "a.exr", layers), camera=CAMERA, previous_camera=BEFORE)
    (line,) = disagreements(frame)
    assert line.startswith(f"depth_scale times {unit:g} fits better: motion agrees with the cameras at 100%")
