"""Files of unknown origin with plain names: the pixels tell the kind of depth and the space of normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from writers.foreign_exr import CAMERA, SIZE, truth, write

from gbufrt.commands.foreign import Source
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.detect import detect
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.named import Named
from gbufrt.files.gbuffers.profile import load_profile
from gbufrt.files.gbuffers.settle import found_settings, settled
from gbufrt.files.guard import read_parts

T = truth()
SKY = ~T["hit"]
X, Y, Z = (T["normal"][..., i] for i in range(3))
VIEW = T["normal"] @ CAMERA.world_from_view[0, :3, :3].double().numpy()
DEPTHS = {"planar": T["planar"], "ray": T["ray"], "reciprocal": 1 / T["planar"]}
NORMALS = {
    ("world", "y"): T["normal"],
    ("world", "z"): np.stack([X, -Z, Y], -1),
    ("opengl", "y"): VIEW * (1, -1, -1),
    ("opencv", "y"): VIEW,
    ("pbrt", "y"): VIEW * (1, -1, 1),
}


def plain(kind: str, way: tuple[str, str], *, coded: bool) -> dict[str, np.ndarray]:
    """Layers of plain names; the sky holds 0, as far as the kind of depth has no number for it."""
    normal = np.where(SKY[..., None], 0.0, NORMALS[way])
    return {"depth.Y": np.where(SKY, 0, DEPTHS[kind]), "normal.RGB": (normal + 1) / 2 if coded else normal}


@pytest.mark.parametrize("coded", [False, True])
@pytest.mark.parametrize("way", NORMALS)
@pytest.mark.parametrize("kind", DEPTHS)
def test_settings_are_found(tmp_path: Path, kind: str, way: tuple[str, str], coded: bool):
    path = write(tmp_path / "a.exr", plain(kind, way, coded=coded))
    assert detect(path).name == "generic"
    named = Named(Layers(path, read_parts(path)), load_profile("generic"))
    found = settled(named, CAMERA).profile
    assert (found.depth_kind, found.normal_space, found.up) == (kind, *way)
    assert found_settings(named.profile, found) == f'depth_kind = "{kind}", normal_space = "{way[0]}", up = "{way[1]}"'
    g = read_gbuffer(path, camera=CAMERA).gbuffer
    assert (g.hit[0, 0].numpy() == T["hit"]).all()
    for read, true in ((g.depth, T["planar"][..., None]), (g.normal, T["normal"])):
        assert np.abs(read[0].permute(1, 2, 0).numpy() - true)[T["hit"]].max() < 2e-3


def test_many_edges_hide_no_setting(tmp_path: Path):
    """Foliage: most normals are those of no surface that depth knows. In the middle of the picture a ray is about as
    long as planar depth, so that normals on the rest tell the kinds apart by little."""
    leaves = np.random.default_rng(0).normal(size=(*SIZE, 3))
    bare = (np.arange(SIZE[0])[:, None] // 8 % 2 == 0) & (np.indices(SIZE)[1] >= 0)
    normal = np.where(bare[..., None], T["normal"], leaves / np.linalg.norm(leaves, axis=-1, keepdims=True))
    middle = np.zeros(SIZE, bool)
    middle[12:36, 16:48] = True
    depth = np.where(SKY | ~middle, 0, T["planar"])
    path = write(tmp_path / "a.exr", {"depth.Y": depth, "normal.RGB": normal})
    found = settled(Named(Layers(path, read_parts(path)), load_profile("generic")), CAMERA).profile
    assert (found.depth_kind, found.normal_space, found.up) == ("planar", "world", "y")


def test_curved_surfaces_are_taken_to_be_planar_depth(tmp_path: Path):
    """Nothing flat: no kind is far flatter than another."""
    y, x = np.indices(SIZE) / 8
    path = write(tmp_path / "a.exr", {"depth.Y": 3 + np.sin(x) * np.cos(y)})
    assert (
        settled(Named(Layers(path, read_parts(path)), load_profile("generic")), CAMERA).profile.depth_kind == "planar"
    )


def test_one_setting_serves_a_sequence(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """A second frame that shows nothing flat is read as the first one is."""
    first = write(
        tmp_path / "a_0001.exr", plain("ray", ("opengl", "y"), coded=False) | {"beauty.RGB": T["normal"] ** 2}
    )
    bumpy = plain("ray", ("opengl", "y"), coded=False) | {"depth.Y": T["ray"] * (1 + 0.1 * np.sin(np.indices(SIZE)[0]))}
    write(tmp_path / "a_0002.exr", bumpy | {"beauty.RGB": T["normal"] ** 2})
    source = Source.named([first, tmp_path / "a_0002.exr"], "auto", None, 50.0)
    second = [source.read(shot)[0] for shot in source.shots][1].gbuffer
    planar = read_gbuffer(tmp_path / "a_0002.exr", fov=50.0).gbuffer
    assert bool((second.depth[second.hit] < 0.999 * planar.depth[second.hit]).any())
    told = capsys.readouterr().err
    assert told.count('by its pixels depth_kind = "ray", normal_space = "opengl", up = "y"\n') == 1


@pytest.mark.parametrize("way", NORMALS)
def test_without_a_pose_normals_count_in_the_cameras_space_alone(tmp_path: Path, way: tuple[str, str]):
    """Those of the world are estimated from depth, as nobody knows how the camera is turned."""
    path = write(tmp_path / "a.exr", plain("planar", way, coded=False))
    frame = read_gbuffer(path, fov=50.0)
    estimated = frame.extra.get("normal_estimated")
    assert (estimated is None) == (way[0] != "world")
    if estimated is None:
        wanted = VIEW * (1, -1, -1)  # of a camera that looks along -z
        off = np.abs(frame.gbuffer.normal[0].permute(1, 2, 0).numpy() - wanted)[T["hit"]]
        assert off.max() < 2e-3


def test_a_profile_in_the_cameras_space_needs_no_pose(tmp_path: Path):
    channels = 'depth = ["depth.*"]\nnormal = ["normal"]\n'
    (tmp_path / "own.toml").write_text(f'normal_space = "opengl"\n[channels]\n{channels}')
    noisy = VIEW * (1, -1, -1) + np.random.default_rng(0).normal(0, 0.3, VIEW.shape)  # no depth tells it
    path = write(tmp_path / "a.exr", {"depth.Y": np.where(SKY, 0, T["planar"]), "normal.RGB": noisy})
    assert "normal_estimated" not in read_gbuffer(path, tmp_path / "own.toml", fov=50.0).extra


@pytest.mark.parametrize(("profile", "name"), [("generic", "depth.Y"), ("arnold", "Z.Z"), ("renderman", "z.Z")])
def test_depth_may_count_down(tmp_path: Path, profile: str, name: str):
    path = write(tmp_path / "a.exr", {name: np.where(SKY, 0, -T["planar"])})
    depth = read_gbuffer(path, profile, camera=CAMERA).gbuffer.depth[0, 0].numpy()
    assert np.abs(depth - T["planar"])[T["hit"]].max() < 1e-4


def test_nukes_normals_may_lie_in_the_cameras_space(tmp_path: Path):
    layers = {"depth.Z": np.where(SKY, 0, 1 / T["planar"]), "N.XYZ": VIEW * (1, -1, -1)}
    frame = read_gbuffer(write(tmp_path / "a.exr", layers), "nuke", camera=CAMERA)
    assert np.abs(frame.gbuffer.normal[0].permute(1, 2, 0).numpy() - T["normal"])[T["hit"]].max() < 2e-3


@pytest.mark.parametrize("background", [None, 0.0, 0.5, 1.0])
def test_a_sky_over_most_of_the_picture_decides_nothing(tmp_path: Path, background: float | None):
    """Nothing was hit there: its value is no normal, whether normals are encoded (with that background) or not."""
    few = (Y > 0) & (np.indices(SIZE)[0] >= SIZE[0] * 3 // 4)  # of the floor, which has no negative number
    assert few.mean() < 0.3
    raw = np.where(few[..., None], T["normal"] if background is None else (T["normal"] + 1) / 2, background or 0.0)
    path = write(tmp_path / "a.exr", {"depth.Y": np.where(few, T["planar"], 0), "normal.RGB": raw})
    g = read_gbuffer(path, camera=CAMERA).gbuffer
    assert (g.hit[0, 0].numpy() == few).all()
    for read, true in ((g.depth, T["planar"][..., None]), (g.normal, T["normal"])):
        assert np.abs(read[0].permute(1, 2, 0).numpy() - true)[few].max() < 2e-3


@pytest.mark.parametrize("value", [0.0, 0.5, 1.0])
def test_a_layer_of_normals_that_nobody_wrote_counts_as_absent(tmp_path: Path, value: float):
    layers = {"depth.Y": np.where(SKY, 0, T["planar"]), "normal.RGB": np.full((*SIZE, 3), value)}
    with pytest.warns(
        UserWarning, match=f"normals are {value:g}, {value:g}, {value:g} everywhere, and count as absent"
    ):
        frame = read_gbuffer(write(tmp_path / "a.exr", layers), camera=CAMERA)
    g = frame.gbuffer
    assert torch.equal(frame.extra["normal_estimated"] > 0, g.hit)
    assert np.abs(g.depth[0, 0].numpy() - T["planar"])[T["hit"]].max() < 1e-4
    assert torch.equal(g.normal, torch.where(g.hit, CAMERA.normals_from_depth(g.depth), 0.0))


def test_normals_that_fit_by_no_reading_tell_no_kind_of_depth(tmp_path: Path):
    """Planes tell it then."""
    noise = np.random.default_rng(0).normal(size=(*SIZE, 3))
    layers = {
        "depth.Y": np.where(SKY, 0, T["ray"]),
        "normal.RGB": noise / np.linalg.norm(noise, axis=-1, keepdims=True),
    }
    path = write(tmp_path / "a.exr", layers)
    found = settled(Named(Layers(path, read_parts(path)), load_profile("generic")), CAMERA)
    assert found.profile.depth_kind == "ray"
