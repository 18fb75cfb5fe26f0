"""G-buffers of other renderers become frames by our conventions."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import torch

from gbufrt.camera import Camera
from gbufrt.files import read_gbuffer
from gbufrt.files.guard import read_parts

REAL = {
    "blender4515_cycles_multilayer.exr": ("blender", 10 * np.tan(np.radians(80 - 90))),
    "blender501_cycles_multipart.exr": ("blender", 10 * np.tan(np.radians(80 - 90))),
    "mitsuba391_aov.exr": ("mitsuba", -2.0),
}


@pytest.mark.parametrize("name", REAL)
def test_normals_of_real_files_agree_with_depth(name: str) -> None:
    folder = os.environ.get("GBUFRT_TEST_DATA")
    if folder is None:
        pytest.skip("GBUFRT_TEST_DATA is not set: no files of real renderers")
    profile, drop = REAL[name]
    fov = np.degrees(2 * np.arctan(np.tan(np.radians(25)) * 9 / 16 if profile == "mitsuba" else 18 / 50 * 9 / 16))
    camera = Camera.look_at((0, 3, 10), (0, 3 + drop, 0), size=(90, 160), fov_y=float(fov))
    frame = read_gbuffer(Path(folder) / "exr" / name, camera=camera)
    frame.validate()
    g = frame.gbuffer
    floor = (..., slice(60, 88), slice(5, 25))
    assert bool(g.hit[floor].all())
    estimate = camera.normals_from_depth(g.depth)[floor]
    if profile == "mitsuba":  # four random samples a pixel make single depths noisy
        estimate = torch.nn.functional.normalize(estimate.mean((-2, -1), keepdim=True), dim=1)
    cosine = (g.normal[floor] * estimate).sum(1).clamp(-1, 1)
    assert float(torch.rad2deg(torch.arccos(cosine)).max()) < 2
    assert (frame.radiance is None) == (profile == "mitsuba")
    assert (frame.composite is None) == (profile == "blender")


def _write(path: Path, channels: dict[str, float]) -> Path:
    planes = {name: np.full((4, 6), value, np.float32) for name, value in channels.items()}
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File(header, planes).write(str(path))
    return path


def test_motion_and_direct_light_of_blender(tmp_path: Path) -> None:
    light = {
        f"V.{n}.{c}": v for n, v in (("DiffDir", 3.0), ("DiffCol", 0.5), ("DiffInd", 9.0), ("Emit", 1.0)) for c in "RGB"
    }
    path = _write(tmp_path / "a.exr", {"V.Depth.Z": 5.0, "V.Vector.X": 2.0, "V.Vector.Y": 3.0, **light})
    frame = read_gbuffer(path, fov=40)
    assert frame.gbuffer.motion is not None
    assert frame.radiance is not None
    assert frame.gbuffer.motion[0, :, 0, 0].tolist() == [2.0, -3.0]
    assert torch.all(frame.radiance == 2.5)


def test_what_fits_no_profile_says_so(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="fits no profile"):
        read_gbuffer(_write(tmp_path / "a.exr", {"R": 1.0}), fov=40)


@pytest.mark.parametrize("name", [name for name in REAL if name.startswith("blender")])
def test_motion_of_real_files_leads_to_where_the_cube_was(name: str) -> None:
    folder = os.environ.get("GBUFRT_TEST_DATA")
    if folder is None:
        pytest.skip("GBUFRT_TEST_DATA is not set: no files of real renderers")
    path = Path(folder) / "exr" / name
    fov = float(np.degrees(2 * np.arctan(18 / 50 * 9 / 16)))
    camera = Camera.look_at((0, 3, 10), (0, 3 + REAL[name][1], 0), size=(90, 160), fov_y=fov)
    g = read_gbuffer(path, camera=camera).gbuffer
    layers = {n: c for part in read_parts(path) for n, c in part.channels.items()}
    x, y, z = (torch.from_numpy(layers[f"ViewLayer.Position.{c}"].astype(np.float32)) for c in "XYZ")
    cube = (z > 0.05) & g.hit[0, 0]
    now, before = (camera.project(camera.to_view(torch.stack([x - d, z, -y])[None])) for d in (0.0, 1.0))
    assert int(cube.sum()) > 1000
    assert g.motion is not None
    assert float((before - now - g.motion).norm(dim=1)[0][cube].max()) < 0.1
