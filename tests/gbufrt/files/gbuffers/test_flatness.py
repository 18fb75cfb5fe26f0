"""Depth that is normalised, as compositors like it: V-Ray's ZDepth between its black and white distances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from writers.foreign_exr import CAMERA, SIZE, truth, write

from gbufrt.commands.foreign import Source
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.agreement import disagreements

T = truth()
SKY = ~T["hit"]
GREY = np.full((*SIZE, 3), 0.5)
CAMERA_FILE = "world_from_view = {pose}\nfov = 50\nconvention = 'opencv'"


def _shares(black: float, white: float) -> np.ndarray:
    share = (np.where(SKY, 1e30, T["planar"]) - black) / (white - black)
    return share.clip(0, 1).astype(np.float32)


@pytest.mark.parametrize(("black", "white"), [(0.5, 40.0), (40.0, 0.5), (2.0, 40.0)])
@pytest.mark.parametrize("normals", [True, False])
def test_normalised_depth_is_told_and_read_with_its_distances(
    black: float, white: float, normals: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    layers = {"VRayZDepth.R": _shares(black, white), "RGB": GREY} | (
        {"VRayNormals.RGB": T["normal"]} if normals else {}
    )
    path, cameras, own = (tmp_path / name for name in ("a.exr", "camera.toml", "own.toml"))
    write(path, layers)
    cameras.write_text(CAMERA_FILE.format(pose=CAMERA.world_from_view[0].tolist()))
    list(Source.of([path], "auto", cameras, None).frames())
    back, near, far = black > white, min(black, white), max(black, white)
    told = capfd.readouterr().err
    assert f'depth_kind = "normalised"{", reversed = true" if back else ""} fits better: with near' in told
    own.write_text(
        f'base = "generic"\ndepth_kind = "normalised"\nnear = {near}\nfar = {far}\nreversed = {back}'.lower()
    )
    frame = read_gbuffer(path, own, camera=CAMERA)
    between = (T["planar"] > near) & (T["planar"] < far)
    assert bool((frame.gbuffer.hit[0, 0].numpy() == between).all())
    assert np.abs(frame.gbuffer.depth[0, 0].numpy() - T["planar"])[between].max() < 1e-4
    assert disagreements(frame, depth_kind="normalised") == []


@pytest.mark.parametrize("kind", ["planar", "ray"])
def test_small_scenes_are_not_taken_for_it(kind: str, tmp_path: Path) -> None:
    """Depth in kilometres lies within 0 and 1 too."""
    path = write(
        tmp_path / "a.exr", {"depth.Z": np.where(SKY, 0, T[kind] / 1000), "normal.XYZ": T["normal"], "RGB": GREY}
    )
    assert disagreements(read_gbuffer(path, camera=CAMERA), depth_kind=kind) == []


def test_depth_that_ends_at_one_is_told(tmp_path: Path) -> None:
    """From 0 at the camera: planes are flat then, but the sky is a wall."""
    path, own = write(tmp_path / "a.exr", {"depth.Z": _shares(0.0, 40.0), "RGB": GREY}), tmp_path / "own.toml"
    (line,) = disagreements(read_gbuffer(path, camera=CAMERA))
    assert "of the surfaces, as normalised depth is where it ends; set sky = 1 in a profile" in line
    own.write_text('base = "generic"\ndepth_kind = "planar"\nsky = 1\ndepth_scale = 40\n')
    frame = read_gbuffer(path, own, camera=CAMERA)
    assert bool((frame.gbuffer.hit[0, 0].numpy() == (T["planar"] < 40)).all())
    assert disagreements(frame) == []


@pytest.mark.parametrize("posed", [True, False])
def test_panoramas_are_named_where_only_a_field_of_view_is_known(posed: bool, tmp_path: Path) -> None:
    """Their depth is often along the ray, but no kind of it makes their planes flat."""
    path = write(tmp_path / "a.exr", {"depth.Z": np.where(SKY, 0, T["ray"]), "RGB": GREY})
    (own := tmp_path / "own.toml").write_text('base = "generic"\ndepth_kind = "planar"')
    (line,) = disagreements(read_gbuffer(path, own, camera=CAMERA), posed=posed)
    assert line.startswith('depth_kind = "ray" fits better: planes bend by ')
    assert line.endswith("; panoramas and fisheyes, which are not read, look so too") != posed
