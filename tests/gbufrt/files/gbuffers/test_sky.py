"""Skies of other renderers: how they lie, what is refused, and that no light counts twice."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from command_line import run
from mirrors import SkyAlone
from writers import foreign_exr

from gbufrt.environment import lookup_environment
from gbufrt.files.exr import read_exr
from gbufrt.files.gbuffers.profile import load_profile
from gbufrt.files.gbuffers.read import read_gbuffer
from gbufrt.files.gbuffers.sky import MOST_ROWS, read_environment, under
from post import SSR
from post.shading.sent_light import outgoing_light


def sky_file(path: Path, rows: int = 8, columns: int = 16) -> Path:
    """A sky of which each column has its own red, and each row its own green."""
    red, green = np.meshgrid(np.arange(columns), np.arange(rows), indexing="xy")
    return foreign_exr.write(path, {".RGB": np.stack([red, green, np.ones_like(red)], -1)})


def shot(path: Path, *, mirrors: bool, roughness: float = 0.1) -> Path:
    """A file of Blender's with direct light, that of mirrors among it or not."""
    found = foreign_exr.truth()
    x, y, z = np.moveaxis(found["normal"], -1, 0)
    light = np.full((*foreign_exr.SIZE, 3), 0.5, np.float32)
    layers = {
        "ViewLayer.Depth.Z": np.where(found["hit"], found["planar"], 1e10),
        "ViewLayer.Normal.XYZ": np.stack([x, -z, y], -1),
        "ViewLayer.Roughness.X": np.full(foreign_exr.SIZE, roughness),
        "ViewLayer.Metallic.X": np.ones(foreign_exr.SIZE),
        "ViewLayer.Base Color.RGB": np.ones_like(light),
        "ViewLayer.DiffDir.RGB": light,
        "ViewLayer.DiffCol.RGB": light,
    }
    if mirrors:
        layers |= {"ViewLayer.GlossDir.RGB": light, "ViewLayer.GlossCol.RGB": light}
    return foreign_exr.write(path, layers, {"BlenderMultiChannel": "Blender V2.55.1 and newer"})


def camera_file(path: Path) -> Path:
    path.write_text(f"fov = 50\nworld_from_view = {foreign_exr.CAMERA.world_from_view[0].tolist()}\n")
    return path


def test_skies_lie_as_their_renderer_has_them(tmp_path: Path):
    """In Blender +x is in the middle, and its y is our -z; other pictures have -z there."""
    path = sky_file(tmp_path / "sky.exr", 64, 128)
    blender = read_environment(path, turn=load_profile("blender").environment_turn)
    ways = torch.tensor([[1.0, 0, 0], [0, 0, -1]]).T[None, :, :, None]
    assert lookup_environment(blender, ways)[0, 0, :, 0].tolist() == pytest.approx([63.5, 31.5])
    assert lookup_environment(read_environment(path), ways)[0, 0, :, 0].tolist() == pytest.approx([95.5, 63.5])
    assert read_environment(path)[0, 1, 0, 0] == 0, "the zenith is the top row"


def test_large_skies_are_averaged(tmp_path: Path):
    sky = read_environment(sky_file(tmp_path / "sky.exr", 2 * MOST_ROWS, 4 * MOST_ROWS))
    assert sky.shape == (1, 3, MOST_ROWS, 2 * MOST_ROWS)
    assert sky[0, 0, 0, :2].tolist() == [0.5, 2.5]


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        (np.ones((8, 8, 3)), "must be a lat-long picture, twice as wide as high, got 8x8"),
        (np.full((4, 8, 3), np.nan), "must hold finite radiance"),
        (np.full((4, 8, 3), -1.0), "must hold finite radiance of at least 0"),
    ],
)
def test_other_pictures_are_refused(tmp_path: Path, pixels: np.ndarray, message: str):
    with pytest.raises(ValueError, match=message):
        read_environment(foreign_exr.write(tmp_path / "sky.exr", {".RGB": pixels}))
    with pytest.raises(ValueError, match="has no R, G and B"):
        read_environment(foreign_exr.write(tmp_path / "depth.exr", {"Depth.Z": np.ones((4, 8))}))


def test_light_that_holds_the_sky_in_mirrors_gets_no_other_one(tmp_path: Path):
    """And is not told to: the message of a frame without an environment asked for what would count twice."""
    frame = read_gbuffer(shot(tmp_path / "a.exr", mirrors=True), camera=foreign_exr.CAMERA)
    assert not frame.read("environment").any()
    assert frame.emitters_mirrored
    assert SSR().left_out(frame) == []
    alone = SkyAlone()
    assert torch.equal(*(alone(one).read("reflection") for one in (frame, replace(frame, environment=None))))
    guessed = SSR()(replace(frame, environment=None)).read("reflection")
    assert float(SSR()(frame).read("reflection").sum()) < 0.9 * float(guessed.sum()), "no sky is guessed either"
    bare = read_gbuffer(shot(tmp_path / "b.exr", mirrors=False), camera=foreign_exr.CAMERA)
    assert bare.environment is None
    assert not bare.emitters_mirrored
    assert len(SSR().left_out(bare)) == 1


def test_post_shows_a_sky_in_mirrors(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    sky, camera = sky_file(tmp_path / "sky.exr"), camera_file(tmp_path / "camera.toml")
    common = ("--camera", camera, "--preset", "low", "--warmup", 0, "--passes", "reflection")
    path = shot(tmp_path / "b_0001.exr", mirrors=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert run("post", path, *common, "--out", tmp_path / "dark") == 0
        assert run("post", path, *common, "--out", tmp_path / "lit", "--environment", sky) == 0
    dark, lit = (read_exr(tmp_path / name / "b_0001.exr") for name in ("dark", "lit"))
    assert torch.equal(lit.read("environment"), read_environment(sky, turn=90))
    gained = (lit.read("reflection") - dark.read("reflection"))[0, 0]
    assert float(gained.max()) > 1
    assert torch.equal(lit.read("radiance"), dark.read("radiance")), "it lights nothing else"
    capfd.readouterr()
    both = shot(tmp_path / "a_0001.exr", mirrors=True)
    for files, options, message in (
        (both, common, "holds the sky in mirrors already (Blender: Glossy Direct), and it would count twice"),
        (path, ("--fov", 50), "with --fov nobody knows where the camera looks"),
        (path, (*common[:-1], "ao"), "--environment is seen in reflections, which are left out"),
        (tmp_path / "lit" / "b_0001.exr", (), "files of gbufrt carry their sky"),
    ):
        assert run("post", files, *options, "--environment", sky, "--out", tmp_path / "no") == 2
        assert message in capfd.readouterr().err


@pytest.mark.parametrize("held", [True, False])
def test_mirrors_tell_whether_plain_direct_light_holds_the_sky(tmp_path: Path, held: bool):
    t = foreign_exr.truth()
    depth, normal = np.where(t["hit"], t["planar"], 0), np.where(t["hit"][..., None], t["normal"], 0)
    layers = {"depth.Z": depth, "normal.XYZ": normal}
    eye = (foreign_exr.CAMERA.rays()[1][0].double() * -1).numpy()
    sky = read_environment(sky_file(tmp_path / "sky.exr"))
    ways = torch.from_numpy(2 * (t["normal"] * eye).sum(-1, keepdims=True) * t["normal"] - eye).movedim(-1, 0)[None]
    seen = lookup_environment(sky, ways.float())[0].movedim(0, -1).numpy()
    direct = np.where(np.arange(seen.shape[1])[:, None] % 2, seen, 0.0) if held else 0.01 * seen  # half is hidden
    layers["direct.RGB"] = direct
    plain = read_gbuffer(foreign_exr.write(tmp_path / "a.exr", layers), "generic", camera=foreign_exr.CAMERA)
    with pytest.warns(UserWarning, match="cannot be told"):
        next(under([plain], sky, known=False))
    ones = np.ones(foreign_exr.SIZE)
    layers |= {"roughness.R": 0 * ones, "metallic.R": ones, "albedo.RGB": np.ones((*foreign_exr.SIZE, 3))}
    frame = read_gbuffer(foreign_exr.write(tmp_path / "b.exr", layers), "generic", camera=foreign_exr.CAMERA)
    if held:
        with pytest.raises(ValueError, match=r"as bright as the sky at 5\d% of the mirrors' pixels: it holds"):
            next(under([frame], sky, known=False))
    else:
        assert next(under([frame], sky, known=False)).environment is sky


def test_what_scripts_add_to_files_of_mitsuba_is_taken(tmp_path: Path):
    """Lamps among it, whose light mirrors show already."""
    found, one = foreign_exr.truth(), np.full(foreign_exr.SIZE, 0.25)
    grey = np.stack([one] * 3, -1)
    layers = {"far.T": np.where(found["hit"], found["ray"], 0), "nn.XYZ": found["normal"], "alb.RGB": grey}
    layers |= {"motion.XY": found["motion"], "roughness.Y": one, "metallic.Y": one}
    path = foreign_exr.write(tmp_path / "a.exr", {**layers, "emission.RGB": grey, "direct.RGB": grey})
    frame = read_gbuffer(path, "mitsuba", camera=foreign_exr.CAMERA, previous_camera=foreign_exr.BEFORE)
    g = frame.gbuffer
    assert g.roughness is not None
    assert g.metallic is not None
    assert g.motion is not None
    assert np.abs(g.motion[0].permute(1, 2, 0).numpy() - found["motion"])[found["hit"]].max() < 2e-3
    assert frame.emitters_mirrored
    assert not outgoing_light(frame)[g.hit.expand(-1, 3, -1, -1)].any()
