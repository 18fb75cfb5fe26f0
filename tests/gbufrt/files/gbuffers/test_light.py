"""Direct light of files that lack a part of it, or do not tell lamps from what they light."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
from writers.foreign_exr import CAMERA, SIZE, truth, write, write_parts

from gbufrt.commands.foreign import Source
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.detect import detect
from gbufrt.files.gbuffers.light import explained

T = truth()
HIT = T["hit"][..., None]
GREY = np.full((*SIZE, 3), 0.5)
LIT = np.where(HIT, GREY, 0)
LEFT = np.broadcast_to((np.arange(SIZE[1]) < SIZE[1] // 2)[None, :, None], GREY.shape)
LAMP = np.where(np.arange(SIZE[1])[:, None] < 3, 30.0, LIT)  # the three columns at the left
NAMES = {"hitPz.Z": np.where(T["hit"], T["planar"], 0), "N.XYZ": T["normal"], "albedo.RGB": GREY}


def test_a_sky_that_direct_light_lacks_is_that_of_the_finished_picture(tmp_path: Path) -> None:
    """As of Karma's directdiffuse beside its beauty."""
    path = write(tmp_path / "a.exr", NAMES | {"C.rgb": LIT + np.where(HIT, 0.1, 0.9), "directdiffuse.rgb": LIT})
    with pytest.warns(UserWarning, match=r"direct light has no sky; that of C\.r, C\.g, C\.b is taken"):
        frame = read_gbuffer(path, camera=CAMERA)
    assert frame.radiance is not None
    assert torch.equal(frame.radiance[0].permute(1, 2, 0), torch.from_numpy(np.where(HIT, LIT, 0.9)).float())


@pytest.mark.parametrize(("light", "emission", "told"), [(LAMP, None, 1), (LIT, None, 0), (LAMP, LAMP - LIT, 0)])
def test_lamps_that_no_emission_tells_are_told(
    light: np.ndarray, emission: np.ndarray | None, told: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    layers = {"depth.Z": NAMES["hitPz.Z"], "normal.XYZ": T["normal"], "albedo.RGB": GREY, "direct.RGB": light}
    layers |= {} if emission is None else {"emission.RGB": emission * HIT}
    files = [write(tmp_path / f"a.{n}.exr", layers) for n in (1, 2)]
    list(Source.of(files, "auto", None, 50.0).frames())
    assert capfd.readouterr().err.count("count their light twice: write emission too") == told


def test_stock_names_of_more_programs(tmp_path: Path) -> None:
    depth = NAMES["hitPz.Z"]
    layers = {"Z-Depth.R": depth, "Smooth normal.RGB": T["normal"] / 2 + 0.5, "HdrColor.RGB": GREY}
    frame = read_gbuffer(write(tmp_path / "a.exr", layers), camera=CAMERA)
    assert frame.composite is not None
    assert "normal_estimated" not in frame.extra
    planes = {f"normals.{c}": T["normal"][..., i] for i, c in enumerate("XYZ")} | {"distance_to_image_plane": depth}
    assert detect(write_parts(tmp_path / "e.exr", {"": planes})).reasons[0] == "depth is distance_to_image_plane"
    names = {"V.Depth.Z": np.where(T["hit"], depth, 1e10), "V.Combined.RGB": LIT, "V.Denoising Albedo.RGB": GREY}
    path = write(tmp_path / "b.exr", names, {"BlenderMultiChannel": "Blender V2.55.1 and newer"})
    assert read_gbuffer(path, camera=CAMERA).gbuffer.albedo is not None
    names = {"QueueWorldDepth.R": 100 * depth, "depth.Z": depth, "albedo.RGB": GREY, "RGB": GREY}
    assert detect(write(tmp_path / "c.exr", names)).name != "unreal"
    assert detect(write(tmp_path / "d.exr", names, {"unreal/jobDate": "2026.01.01"})).name == "unreal"


def test_normals_that_count_to_255_are_told(tmp_path: Path) -> None:
    layers = {"depth.Z": NAMES["hitPz.Z"], "normal.RGB": 255 * (T["normal"] / 2 + 0.5), "RGB": GREY}
    with pytest.warns(UserWarning, match=r"normals reach 255; write them from -1 to 1"):
        read_gbuffer(write(tmp_path / "a.exr", layers), camera=CAMERA)


def _glassy(tmp_path: Path, **layers: np.ndarray) -> Path:
    """As of Blender: on the left half glass, whose shader has the colour of the rest."""
    depth = np.where(T["hit"], T["planar"], 1e10)
    parts = {"Depth.Z": depth, "DiffDir.RGB": LIT, "Base Color.RGB": GREY, "DiffCol.RGB": np.where(LEFT, 0, GREY)}
    named = {f"V.{name}": pixels for name, pixels in (parts | layers).items()}
    return write(tmp_path / "a.exr", named, {"BlenderMultiChannel": "Blender V2.55.1 and newer"})


def test_glass_shows_the_light_that_comes_through_it_and_scatters_none(tmp_path: Path) -> None:
    through = {"TransCol.RGB": np.where(LEFT, 0.9, 0), "TransDir.RGB": 0 * GREY, "TransInd.RGB": 2 * GREY}
    frame = read_gbuffer(_glassy(tmp_path, **through), camera=CAMERA)
    g, left = frame.gbuffer, torch.from_numpy(LEFT[..., 0].copy())[None, None]
    assert frame.radiance is not None
    assert g.albedo is not None
    torch.testing.assert_close(frame.radiance[(left & g.hit).expand(-1, 3, -1, -1)].unique(), torch.tensor([0.9]))
    assert torch.all(g.albedo[(left & g.hit).expand(-1, 3, -1, -1)] == 0)
    assert torch.all(g.albedo[(~left & g.hit).expand(-1, 3, -1, -1)] == 0.5)


@pytest.mark.parametrize(("color", "told"), [(0.9, 1), (0.0, 0)])
def test_light_through_glass_is_missed_only_where_there_is_glass(color: float, told: int, tmp_path: Path) -> None:
    path = _glassy(tmp_path, **{"TransCol.RGB": np.where(LEFT, color, 0), "TransDir.RGB": 0 * GREY})
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        read_gbuffer(path, camera=CAMERA)
    assert sum("lacks TransInd: its direct light is without that part" in str(line.message) for line in seen) == told


def test_half_of_a_colour_that_lets_light_through_is_no_albedo(tmp_path: Path) -> None:
    half = {name: np.full_like(GREY, 0.25) for name in ("TransCol.RGB", "DiffCol.RGB", "TransInd.RGB", "TransDir.RGB")}
    g = read_gbuffer(_glassy(tmp_path, **half), camera=CAMERA).gbuffer
    assert g.albedo is not None
    assert torch.all(g.albedo[g.hit.expand(-1, 3, -1, -1)] == 0.25)


def _floor(shine: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Albedo and light of a grey wall beside what has none, with two pixels of both between, as filters mix them."""
    wall = torch.tensor([1.0] * 15 + [0.7, 0.2] + [0.0] * 15).expand(1, 3, 32, 32)
    return 0.4 * wall, 0.8 * wall + shine * (1 - wall)


def test_light_over_albedo_is_even_from_a_wall_to_a_mirror() -> None:
    (albedo, light), hit = _floor(0.6), torch.ones(1, 1, 32, 32, dtype=torch.bool)
    grey = explained(albedo, light, hit)
    torch.testing.assert_close(light[..., 8:24] / grey[..., 8:24], torch.full((1, 3, 32, 16), 2.0), rtol=0.1, atol=0)
    assert torch.equal(grey[..., :15], albedo[..., :15])
    soot, dim = _floor(0.004)
    assert float((explained(soot, dim, hit) - soot).abs().max()) < 0.01
    assert torch.equal(explained(albedo[..., :15], light[..., :15], hit[..., :15]), albedo[..., :15])


def test_pixels_mixed_with_the_sky_have_the_albedo_of_their_light() -> None:
    albedo, light = _floor(0.6)
    grey = explained(albedo, light, (albedo > 0)[:, :1])
    torch.testing.assert_close(light[..., :17] / grey[..., :17], torch.full((1, 3, 32, 17), 2.0), rtol=0.1, atol=0)
    assert torch.equal(grey[..., 17:], albedo[..., 17:])


def test_finished_pictures_alone_get_an_albedo_of_mirrors(tmp_path: Path) -> None:
    layers = {"dd.T": NAMES["hitPz.Z"], "nn.XYZ": T["normal"], "albedo.RGB": np.where(LEFT, GREY, 0)}
    for lit in ("img", "direct"):
        path = write(tmp_path / f"{lit}.exr", layers | {f"{lit}.RGB": np.where(LEFT, LIT, 0.9)})
        (frame,) = Source.of([path], "mitsuba", None, 50.0).frames()
        g = frame.gbuffer
        assert g.albedo is not None
        mirror = g.albedo[..., -4:][g.hit[..., -4:].expand(-1, 3, -1, -1)]
        assert (frame.radiance is None) == (lit == "img")
        assert bool((mirror > 0.5).all() if lit == "img" else (mirror == 0).all())


def test_rounding_below_zero_is_none(tmp_path: Path) -> None:
    """As in Cycles' transmission passes; what is more is left to be seen."""
    noisy = LIT.copy()
    noisy[5, 5], noisy[6, 6] = -1e-6, -0.1
    layers = {"depth.Z": NAMES["hitPz.Z"], "normal.XYZ": T["normal"], "direct.RGB": noisy}
    light = read_gbuffer(write(tmp_path / "a.exr", layers), camera=CAMERA).radiance
    assert light is not None
    assert float(light[0, 0, 5, 5]) == 0
    assert float(light[0, 0, 6, 6]) == pytest.approx(-0.1)


@pytest.mark.parametrize(("most", "tint", "told"), [(1.0, 0.6, 1), (1.0, 1.0, 0), (1.5, 0.6, 0), (0.9, 0.6, 0)])
def test_pictures_made_for_display_are_told_by_where_they_end(
    most: float, tint: float, told: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Lamps that are 1 in all channels are none."""
    light = np.where(LEFT, (most, most * tint, most * tint), 0.2)
    layers = {"depth.Z": NAMES["hitPz.Z"], "normal.XYZ": T["normal"], "albedo.RGB": GREY, "RGB": light}
    list(Source.of([write(tmp_path / f"a.{n}.exr", layers) for n in (1, 2)], "auto", None, 50.0).frames())
    assert capfd.readouterr().err.count("write linear light, without a view transform") == told


@pytest.mark.parametrize(
    ("sky", "mark", "told"), [(1e3, {}, 1), (1e10, {}, 0), (0, {}, 0), (1e3, {"cycles.V.samples": "8"}, 0)]
)
def test_mirrors_of_eevee_are_told_to_be_whole(sky: float, mark: dict[str, str], told: int, tmp_path: Path) -> None:
    layers = {"V.Depth.Z": np.where(T["hit"], T["planar"], sky), "V.Normal.XYZ": T["normal"]}
    passes = ("Diffuse Direct", "Diffuse Color", "Glossy Direct", "Glossy Color")
    layers |= {f"V.{name}.RGB": LIT for name in passes}
    path = write(tmp_path / "a.exr", layers, {"BlenderMultiChannel": "Blender V2.55.1 and newer", **mark})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read_gbuffer(path, camera=CAMERA)
    assert sum("(--without reflection)" in str(warning.message) for warning in caught) == told
