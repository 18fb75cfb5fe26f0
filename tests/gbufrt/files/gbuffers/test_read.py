"""G-buffers of other renderers become frames by our conventions."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import torch
from writers import foreign_exr

from gbufrt.camera import Camera
from gbufrt.commands.foreign import Source
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.guard import read_parts
from gbufrt.gbuffer import GBuffer
from gbufrt.validation.geometry import flat
from post.shading.sent_light import gathered_radiance

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
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a missing pass of light, which another test is about
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


@pytest.mark.parametrize("units", [1e-3, 1e3])
def test_no_unit_of_length_hides_what_a_file_shows(tmp_path: Path, units: float) -> None:
    truth = foreign_exr.truth()
    layers = {"depth.Z": np.where(truth["hit"], truth["planar"] * units, 0.0), "normal.XYZ": truth["normal"]}
    path = foreign_exr.write(tmp_path / "a.exr", {**layers, ".RGB": np.ones((*foreign_exr.SIZE, 3))})
    frame = read_gbuffer(path, "generic", fov=50)
    frame.gbuffer.validate()
    shown = frame.gbuffer.depth[frame.gbuffer.hit]
    assert frame.gbuffer.camera.near < float(shown.min())
    assert float(shown.max()) < frame.gbuffer.camera.far


@pytest.fixture(params=[name for name in REAL if name.startswith("blender")])
def shot(request: pytest.FixtureRequest) -> tuple[GBuffer, torch.Tensor, torch.Tensor]:
    """A real file's G-buffer, its true positions ``(1, 3, H, W)`` with y up, and where its cube is."""
    folder = os.environ.get("GBUFRT_TEST_DATA")
    if folder is None:
        pytest.skip("GBUFRT_TEST_DATA is not set: no files of real renderers")
    path = Path(folder) / "exr" / request.param
    fov = float(np.degrees(2 * np.arctan(18 / 50 * 9 / 16)))
    camera = Camera.look_at((0, 3, 10), (0, 3 + REAL[request.param][1], 0), size=(90, 160), fov_y=fov)
    with pytest.warns(UserWarning, match="lacks Gloss.*: its direct light is without that part; render the pass too"):
        g = read_gbuffer(path, camera=camera).gbuffer
    x, y, z = Layers(path, read_parts(path)).stack([f"ViewLayer.Position.{c}" for c in "XYZ"]).unbind(1)
    assert g.albedo is not None
    cube = g.hit & (g.albedo[:, :1] > 2 * g.albedo[:, 1:2])
    assert int(cube.sum()) > 1000
    return g, torch.stack([x, z, -y], 1), cube


def test_motion_of_real_files_leads_to_where_everything_was(shot: tuple[GBuffer, torch.Tensor, torch.Tensor]) -> None:
    """The cube moves by a metre a frame, along x."""
    g, now, cube = shot
    before = now - cube * torch.tensor([1.0, 0.0, 0.0]).view(1, 3, 1, 1)
    true = g.camera.project(g.camera.to_view(before)) - g.camera.project(g.camera.to_view(now))
    assert g.motion is not None
    assert float((true - g.motion).norm(dim=1, keepdim=True)[g.hit].max()) < 0.01


def test_depth_of_real_files_leads_to_the_true_positions(shot: tuple[GBuffer, torch.Tensor, torch.Tensor]) -> None:
    g, true, cube = shot
    found = g.camera.to_world(g.camera.unproject(g.depth))
    assert float(((found - true).norm(dim=1, keepdim=True) / g.depth)[g.hit].max()) < 1e-4
    floor = g.hit & ~cube
    assert int(floor.sum()) > 8000
    assert float((found[:, 1:2] / g.depth)[floor].abs().max()) < 1e-5


def test_normals_of_real_files_agree_with_depth_off_edges(shot: tuple[GBuffer, torch.Tensor, torch.Tensor]) -> None:
    g, _, cube = shot
    near = torch.nn.functional.max_pool2d(cube.float(), 3, 1, 1) != -torch.nn.functional.max_pool2d(
        -cube.float(), 3, 1, 1
    )
    inside = flat(g) & ~near  # the step from the cube to the floor is too small in places to count as an edge
    assert int(inside.sum()) > 10000
    assert int((inside & cube).sum()) > 900
    cosine = (g.camera.normals_from_depth(g.depth) * g.normal).sum(1, keepdim=True)[inside]
    assert float(torch.rad2deg(torch.arccos(cosine.clamp(-1, 1))).max()) < 2


def test_the_pass_of_direct_light_that_is_missing_is_named(tmp_path: Path) -> None:
    light = {f"V.{n}.{c}": v for n, v in (("DiffDir", 3.0), ("DiffCol", 0.5), ("GlossCol", 0.5)) for c in "RGB"}
    path = _write(tmp_path / "a.exr", {"V.Depth.Z": 5.0, **light})
    with pytest.warns(UserWarning, match="lacks GlossDir: its direct light is without that part") as told:
        frame = read_gbuffer(path, fov=40)
    assert len(told) == 1
    assert frame.radiance is not None
    assert torch.all(frame.radiance == 1.5)
    whole = _write(tmp_path / "b.exr", {"V.Depth.Z": 5.0, **{n: v for n, v in light.items() if "Gloss" not in n}})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_gbuffer(whole, fov=40)


def test_emission_alone_is_no_direct_light_beside_the_finished_picture(tmp_path: Path) -> None:
    layers = {f"V.{n}.{c}": v for n, v in (("Combined", 2.0), ("Emit", 0.25)) for c in "RGB"}
    for more in ({}, {f"V.DiffCol.{c}": 0.5 for c in "RGB"}):
        frame = read_gbuffer(_write(tmp_path / "a.exr", {"V.Depth.Z": 5.0, **layers, **more}), fov=40)
        assert frame.radiance is None
        assert frame.composite is not None
        assert torch.all(frame.composite == 2.0)
        assert frame.gbuffer.emission is not None


def test_the_finished_picture_is_taken_where_it_is_asked_for(tmp_path: Path) -> None:
    light = {f"V.{n}.{c}": v for n, v in (("DiffDir", 3.0), ("DiffCol", 0.5), ("Combined", 2.0)) for c in "RGB"}
    path = _write(tmp_path / "a.exr", {"V.Depth.Z": 5.0, **light})
    lit, whole = (read_gbuffer(path, fov=40, whole=whole) for whole in (False, True))
    assert lit.composite is None
    assert whole.radiance is None
    assert whole.composite is not None
    assert torch.all(whole.composite == 2.0)
    for passes, same in ((["denoise"], whole), (["ao", "denoise"], lit), ([], lit)):
        (frame,) = Source.of([path], "auto", None, 40.0, passes).frames()
        assert (frame.radiance is None) == (same.radiance is None), passes


def test_where_the_file_has_no_normal_it_is_estimated_and_flagged(tmp_path: Path) -> None:
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), size=(4, 6), fov_y=50)
    planes = {"V.Depth.Z": np.full((4, 6), 5.0), "V.Normal.XYZ": np.zeros((4, 6, 3))}
    planes["V.Normal.XYZ"][:2] = 0.0, -0.6, 0.8
    planes["V.Depth.Z"][:, 5] = 1e10
    frame = read_gbuffer(foreign_exr.write(tmp_path / "a.exr", planes), camera=camera)
    flag = frame.read("normal_estimated")[0, 0]
    assert torch.equal(flag[:, :5], torch.tensor([0.0, 0, 1, 1])[:, None].expand(4, 5))
    assert float(flag[:, 5].max()) == 0
    assert torch.allclose(frame.gbuffer.normal[0, :, 0, 0], torch.tensor([0.0, 0.8, 0.6]))
    assert torch.allclose(frame.gbuffer.normal[0, :, 3, 0], torch.tensor([0.0, 0.0, 1.0]), atol=1e-5)


def test_emission_is_told_apart_and_what_no_shader_wrote_is_rough(tmp_path: Path) -> None:
    """Else lamps in sight would light what they have lit already, and shaders without the AOV would be mirrors."""
    light = {f"V.{n}.{c}": v for n, v in (("DiffDir", 3.0), ("DiffCol", 0.5), ("Emit", 1.0)) for c in "RGB"}
    rough, color = np.zeros((4, 6)), np.zeros((4, 6, 3))
    rough[:, :2], color[:, 2:4, 1] = 0.25, 0.5
    planes = {name: np.full((4, 6), value) for name, value in light.items()}
    planes |= {"V.Depth.Z": np.full((4, 6), 5.0), "V.Roughness.X": rough}
    for more, wanted in (
        ({}, [0.25] * 2 + [1.0] * 4),
        ({"V.Base Color.RGB": color}, [0.25] * 2 + [0.0] * 2 + [1.0] * 2),
    ):
        frame = read_gbuffer(foreign_exr.write(tmp_path / "a.exr", planes | more), fov=40)
        g = frame.gbuffer
        assert g.roughness is not None
        assert g.roughness[0, 0, 0].tolist() == wanted
        assert g.emission is not None
        assert torch.all(g.emission == 1)
        assert torch.all(gathered_radiance(frame) == 1.5)
