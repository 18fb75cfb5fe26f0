"""What renderers write besides the usual: positions in place of depth, coarse halves, losses, other motion, crops."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from writers.foreign_exr import BEFORE, CAMERA, FAR, NEAR, SIZE, truth, write

from gbufrt.camera import Camera
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.carried import carried_camera
from gbufrt.files.gbuffers.detect import detect
from gbufrt.files.gbuffers.profile import load_profile
from gbufrt.gbuffer import GBuffer

T = truth()
HIT, SKY = T["hit"], ~T["hit"]
PLANAR = np.where(SKY, 0, T["planar"])
GREY = np.full((*SIZE, 3), 0.5)
PLAIN = {"depth.Z": PLANAR, "normal.XYZ": T["normal"], "RGB": GREY}
CENTRED = {"QueueWorldDepth.R": 100 * PLANAR, "QueueMotionVectors.RG": T["motion"] / SIZE[::-1] * (-0.5, 0.5) + 0.5}


def _positions() -> np.ndarray:
    origins, directions = (t[0].double().numpy() for t in CAMERA.rays())
    return np.where(SKY[..., None], 0, origins + np.where(SKY, 0, T["ray"])[..., None] * directions)


def _halves(path: Path, layers: dict[str, np.ndarray], compression: object = OpenEXR.ZIP_COMPRESSION) -> Path:
    planes = {
        f"{base}.{c}" if base else c: np.ascontiguousarray(pixels.reshape(*SIZE, -1)[..., i], np.float16)
        for (base, _, ends), pixels in ((name.rpartition("."), pixels) for name, pixels in layers.items())
        for i, c in enumerate(ends)
    }
    OpenEXR.File({"type": OpenEXR.scanlineimage, "compression": compression}, planes).write(str(path))
    return path


def _off(g: GBuffer, name: str, true: np.ndarray) -> float:
    return float(np.abs(getattr(g, name)[0].permute(1, 2, 0).numpy() - true)[HIT].max())


def test_falcors_depth_by_raster_is_that_of_its_positions(tmp_path: Path) -> None:
    """Clip-space z: from the near plane, and longer by far / (far - near)."""
    counted = np.where(SKY, 0, (T["planar"] - NEAR) * FAR / (FAR - NEAR))
    layers = {"linearZ.R": counted, "normW.RGB": T["normal"], "color.RGB": GREY, "posW.RGB": _positions()}
    path = write(tmp_path / "a.exr", layers)
    assert detect(path).name == "falcor"
    assert _off(read_gbuffer(path, camera=CAMERA).gbuffer, "depth", T["planar"][..., None]) < 1e-4
    assert _off(read_gbuffer(path, fov=50).gbuffer, "depth", counted[..., None]) < 1e-5  # positions are of no use
    layers["posW.RGB"] = layers["posW.RGB"][::-1]
    assert _off(read_gbuffer(write(path, layers), camera=CAMERA).gbuffer, "depth", counted[..., None]) < 1e-5


def test_falcors_sky_by_rays_and_its_roughness(tmp_path: Path) -> None:
    rough = np.concatenate([0.04 * np.ones((*SIZE, 3)), np.where(SKY, 0, 0.3)[..., None]], -1)
    layers = {"linearZ.R": np.where(SKY, 1e8, PLANAR), "specRough.RGBA": rough, "emissive.RGB": GREY, "color.RGB": GREY}
    g = read_gbuffer(write(tmp_path / "a.exr", layers), camera=CAMERA).gbuffer
    assert (g.hit[0, 0].numpy() == HIT).all()
    assert g.roughness is not None
    assert np.allclose(g.roughness[0, 0].numpy(), np.where(SKY, 1, 0.3))
    assert g.emission is not None


def test_motion_to_the_next_frame_serves_where_there_is_no_other(tmp_path: Path) -> None:
    up = T["motion"] * (1, -1)
    layers = {"depth.Z": np.where(SKY, 0, 1 / T["planar"]), "forward.uv": -up, "RGB": GREY}
    found = read_gbuffer(write(tmp_path / "a.exr", layers), "nuke", camera=CAMERA).gbuffer
    assert _off(found, "motion", T["motion"]) < 1e-4
    both = read_gbuffer(write(tmp_path / "b.exr", layers | {"backward.uv": 2 * up}), "nuke", camera=CAMERA).gbuffer
    assert _off(both, "motion", 2 * T["motion"]) < 1e-4


def test_halves_round_a_half_are_coarser_than_what_cameras_know(tmp_path: Path) -> None:
    """A step of them is 0.016 to 0.06 pixels here, and up to two in a picture of 1920."""
    moves = np.zeros((*SIZE, 1))
    moves[20:30, 20:30] = 3.0
    motion = T["motion"] + moves
    coarse = {"QueueMotionVectors.RG": motion / SIZE[::-1] * (-0.5, 0.5) + 0.5}
    path = _halves(tmp_path / "a.exr", CENTRED | coarse | {"RGB": GREY})
    still = HIT & (moves[..., 0] == 0)
    found = read_gbuffer(path, camera=CAMERA, previous_camera=BEFORE).gbuffer
    rough = read_gbuffer(path, camera=CAMERA).gbuffer
    assert found.motion is not None
    assert rough.motion is not None
    off, told = (np.abs(g.motion[0].permute(1, 2, 0).numpy() - motion) for g in (found, rough))  # pyright: ignore[reportOptionalSubscript]
    assert told[still].max() > 0.01
    assert off[still].max() < 0.004  # of depth, which is in halves too
    assert off[HIT & ~still].max() < 0.1  # what moves by itself is the file's


@pytest.mark.parametrize("scale", [(1, -1), (-0.25, 0.25), (2 / SIZE[1], -2 / SIZE[0])])
def test_motion_of_unknown_units_is_read_as_it_fits_the_cameras(scale: tuple[float, float], tmp_path: Path) -> None:
    """Arnold's depends on the shutter. What moves by itself is counted in the same units."""
    motion = T["motion"].copy()
    motion[20:30, 20:30] += 3
    layers = {"Z": PLANAR, "N.XYZ": T["normal"], "albedo.RGB": GREY, "RGB": GREY}
    path = write(tmp_path / "a.exr", layers | {"motionvector.RG": motion * scale})
    assert detect(path).name == "arnold"
    with pytest.warns(UserWarning, match=r"^motion is read with motion_scale = \[.*\], by which it fits the cameras"):
        found = read_gbuffer(path, camera=CAMERA, previous_camera=BEFORE).gbuffer
    assert _off(found, "motion", motion) < 0.02
    assert read_gbuffer(path, camera=CAMERA).gbuffer.motion is None
    write(path, layers | {"motionvector.RG": np.random.default_rng(0).normal(size=(*SIZE, 2))})
    found = read_gbuffer(path, camera=CAMERA, previous_camera=BEFORE).gbuffer  # nothing fits
    assert _off(found, "motion", T["motion"]) < 1e-4


@pytest.mark.parametrize(("name", "scale"), [("backward.XY", (1, -1)), ("forward.XY", (-1, 1))])
def test_files_for_renderman_s_denoiser_are_read_with_their_motion(name: str, scale: tuple, tmp_path: Path) -> None:
    normal = T["normal"] @ CAMERA.world_from_view[0, :3, :3].double().numpy()
    guides = {"z": PLANAR, "normal.RGB": normal, "albedo.RGB": GREY, "normal_var.RGB": 0 * GREY, "mse.RGB": 0 * GREY}
    lit = {"diffuse.RGB": GREY, "specular.RGB": GREY, "RGB": GREY}
    path = write(tmp_path / "a.exr", guides | lit | {name: T["motion"] * scale})
    assert detect(path).name == "renderman"
    with pytest.warns(UserWarning, match="by which it fits the cameras"):
        found = read_gbuffer(path, camera=CAMERA, previous_camera=BEFORE).gbuffer
    assert _off(found, "motion", T["motion"]) < 1e-4
    assert _off(found, "normal", T["normal"]) < 2e-3


@pytest.mark.parametrize("previous", [None, BEFORE])
def test_motion_that_is_not_finite_is_replaced_and_told(previous: Camera | None, tmp_path: Path) -> None:
    motion = T["motion"].copy()
    motion[SIZE[0] - 4 :, :5] = np.nan
    path = write(tmp_path / "a.exr", PLAIN | {"motion.XY": motion})
    with pytest.warns(UserWarning, match="a.exr: motion of 20 pixels is not finite, and"):
        frame = read_gbuffer(path, "generic", camera=CAMERA, previous_camera=previous)
    frame.validate()
    expected = T["motion"] if previous else np.where(np.isnan(motion), 0, motion)
    assert _off(frame.gbuffer, "motion", expected) < 1e-4


def test_colours_that_are_not_finite_are_replaced_and_told(tmp_path: Path) -> None:
    albedo, normal = GREY.copy(), T["normal"].copy()
    albedo[-2:, :5], normal[-4:, :5] = np.nan, np.inf
    rough = np.full(SIZE, 0.3)
    rough[-2:, :3] = np.inf
    layers = PLAIN | {"albedo.RGB": albedo, "normal.XYZ": normal, "roughness.R": rough}
    with pytest.warns(UserWarning, match=r"a.exr: (albedo of 10|roughness of 6) pixels is not finite, and [01] there"):
        frame = read_gbuffer(write(tmp_path / "a.exr", layers), "generic", camera=CAMERA)
    frame.validate()
    g = frame.gbuffer
    assert g.albedo is not None
    assert g.roughness is not None
    assert float(g.albedo[..., -2:, :5].max()) == 0
    assert bool((g.roughness[..., -2:, :3] == 1).all())
    assert _off(g, "normal", T["normal"]) < 1e-3  # that of depth


def test_a_handful_of_pixels_settles_nothing(tmp_path: Path) -> None:
    """Some kind of depth fits any normals by chance."""
    camera = Camera.look_at((0.3, 2, 4), (0, 1.2, 0), size=(3, 3), fov_y=50)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        layers = {"depth.Z": rng.uniform(1, 3, (3, 3)), "normal.XYZ": rng.normal(size=(3, 3, 3))}
        g = read_gbuffer(write(tmp_path / "a.exr", layers), "generic", camera=camera).gbuffer
        assert np.allclose(g.depth[0, 0].numpy(), layers["depth.Z"])


@pytest.mark.parametrize("rows", [slice(40, 41), slice(None)])
def test_pictures_a_pixel_wide_are_read(rows: slice, tmp_path: Path) -> None:
    layers = {name: pixels[rows, 30:31] for name, pixels in PLAIN.items()}
    for name in (PLAIN, ("depth.Z", "RGB")):
        path = write(tmp_path / "a.exr", {key: layers[key] for key in name})
        frame = read_gbuffer(path, fov=50)
        frame.validate()
        assert (frame.gbuffer.hit[0, 0].numpy() == HIT[rows, 30:31]).all()


@pytest.mark.parametrize(
    ("packing", "lost"),
    [("DWAA", "QueueWorldDepth, Q"), ("B44", "QueueWorldDepth, Q"), ("PXR24", ""), ("ZIP", ""), ("PIZ", "")],
)
def test_packing_that_loses_is_told(packing: str, lost: str, tmp_path: Path) -> None:
    path = _halves(tmp_path / "a.exr", CENTRED | {"RGB": GREY}, getattr(OpenEXR, f"{packing}_COMPRESSION"))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        read_gbuffer(path, fov=50)
    assert [str(w.message).startswith(lost) for w in told if "losses" in str(w.message)] == [True] * bool(lost)


def test_who_uses_a_renderers_names_need_not_be_it(tmp_path: Path) -> None:
    """Nuke knows neither plain motion nor roughness; how Arnold counts motion nobody knows."""
    more = PLAIN | {"albedo.RGB": GREY, "motion.XY": T["motion"]}
    assert detect(write(tmp_path / "a.exr", more)).name == "generic"
    assert detect(write(tmp_path / "b.exr", PLAIN | {"albedo.RGB": GREY})).name == "nuke"
    assert detect(write(tmp_path / "c.exr", PLAIN | {"albedo.RGB": GREY, "roughness.R": PLANAR})).name == "generic"
    arnold = {"Z": PLANAR, "N.XYZ": T["normal"], "albedo.RGB": GREY, "RGB": GREY, "motionvector.RG": T["motion"]}
    assert detect(write(tmp_path / "d.exr", arnold)).name == "arnold"
    karma = {
        "depth.Z": PLANAR,
        "N.XYZ": T["normal"],
        "RGB": GREY,
        "directdiffuse.RGB": GREY,
        "directemission.RGB": GREY,
    }
    frame = read_gbuffer(write(tmp_path / "e.exr", karma), camera=CAMERA)
    assert frame.radiance is not None
    assert float(frame.radiance.max()) == 1.0


def test_depth_in_any_letter_is_that_of_the_first(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", {"depth.RGB": np.stack([PLANAR, 0 * PLANAR, 0 * PLANAR], -1), "RGB": GREY})
    assert _off(read_gbuffer(path, fov=50).gbuffer, "depth", PLANAR[..., None]) < 1e-5


def test_mitsubas_positions_tell_depth(tmp_path: Path) -> None:
    layers = {"pos.XYZ": _positions(), "nn.XYZ": T["normal"], "alb.RGB": GREY, "RGB": GREY}
    path = write(tmp_path / "a.exr", layers, {"generatedBy": "Mitsuba version 3.5"})
    g = read_gbuffer(path, camera=CAMERA).gbuffer
    assert g.albedo is not None
    assert _off(g, "depth", T["planar"][..., None]) < 1e-4


@pytest.mark.parametrize("before", ["camera/", "camera/FinalImage/", "layerData/rgba/"])
def test_unreals_camera_under_each_of_its_names(before: str) -> None:
    told = {"curPos/x": 100, "curPos/y": 0, "curPos/z": 50, "curRot/pitch": 0, "curRot/yaw": 0, "curRot/roll": 0}
    header = {f"unreal/{before}{key}": str(value) for key, value in (told | {"fov": 90}).items()}
    camera = carried_camera(header, load_profile("unreal"), SIZE)
    assert camera is not None
    assert np.allclose(camera.world_from_view[0, :3, 3].numpy(), (1, 0.5, 0), atol=1e-6)
