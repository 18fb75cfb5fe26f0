"""`gbufrt inspect`: what files hold, what they are taken for, and whether their channels agree."""

from __future__ import annotations

import os
from pathlib import Path

import boxes
import numpy as np
import pytest
from command_line import run
from nbtlib import Compound, File, Int
from PIL import Image
from writers import foreign_exr, region, vox

from gbufrt.files.exr import write_exr
from gbufrt.files.gbuffers.profile import SHIPPED

FOUND = foreign_exr.truth()
GREY = np.full((*foreign_exr.SIZE, 3), 0.5, np.float32)
HEADER = {"BlenderMultiChannel": "Blender V2.55.1 and newer"}
LAYERS = {
    "V.Depth.Z": np.where(FOUND["hit"], FOUND["planar"], 1e10),
    "V.Normal.XYZ": FOUND["normal"][..., [0, 2, 1]] * (1, -1, 1),
    "V.Vector.XY": FOUND["motion"] * (1, -1),
    "V.DiffDir.RGB": GREY,
    "V.DiffCol.RGB": GREY,
    "V.GlossDir.RGB": GREY,
    "V.Combined.RGB": GREY,
}


def pose(camera: foreign_exr.Camera) -> str:
    return f"world_from_view = {camera.world_from_view[0].tolist()}\n"


@pytest.fixture
def cameras(tmp_path: Path) -> Path:
    path = tmp_path / "camera.toml"
    frames = [f"[[frames]]\nnumber = {n}\n{pose(c)}" for n, c in ((6, foreign_exr.BEFORE), (7, foreign_exr.CAMERA))]
    path.write_text("fov = 50\n" + "".join(frames))
    return path


def told(capfd: pytest.CaptureFixture[str], *arguments: object, code: int = 0) -> str:
    assert run("inspect", *arguments) == code
    output = capfd.readouterr()
    return " ".join((output.err if code else output.out).split())


def test_a_file_of_another_renderer(tmp_path: Path, capfd, cameras: Path) -> None:
    light = GREY.copy()
    light[3, 4:7] = np.nan
    path = foreign_exr.write(tmp_path / "a_0007.exr", LAYERS | {"V.Combined.RGB": light}, HEADER)
    text = told(capfd, path, "--camera", cameras)
    assert "a_0007.exr: 64x48, 1 part, ZIP" in text
    assert "V.Combined R G B float32 0.5 3 " in text
    assert "V.Depth Z float32" in text
    assert "taken for blender, 87% sure: the header has BlenderMultiChannel" in text
    assert "normal V.Normal.XYZ (world space, z up)" in text
    assert "motion V.Vector.XY (pixels to the previous frame)" in text
    assert "roughness absent: no reflections, unless --passes asks" in text
    assert "radiance V.DiffDir.RGB x V.DiffCol.RGB without GlossCol, which should be rendered too" in text
    assert text.endswith("agrees: depth with normals, motion with the cameras")


def test_what_disagrees_is_told_with_its_setting(tmp_path: Path, capfd, cameras: Path) -> None:
    wrong = LAYERS | {"V.Normal.XYZ": FOUND["normal"], "V.Vector.XY": FOUND["motion"]}
    text = told(capfd, foreign_exr.write(tmp_path / "a_7.exr", wrong, HEADER), "--camera", cameras)
    assert 'disagrees: up = "y" fits better: normals agree with depth at' in text
    assert "disagrees: motion_scale with the sign of y changed fits better: motion agrees with the cameras" in text
    assert "agrees:" not in text.replace("disagrees:", "")


def test_without_a_pose_less_can_be_told(tmp_path: Path, capfd) -> None:
    path = foreign_exr.write(tmp_path / "a_7.exr", LAYERS, HEADER)
    text = told(capfd, path, "--fov", "50")
    assert "normal V.Normal.XYZ (not used without --camera)" in text
    assert text.endswith("agrees: the kind of depth with planes")
    assert told(capfd, path).endswith("whether the channels agree can be told with --camera, in part with --fov")
    ray = LAYERS | {"V.Depth.Z": np.where(FOUND["hit"], FOUND["ray"], 1e10)}
    assert 'disagrees: depth_kind = "ray" fits' in told(
        capfd, foreign_exr.write(tmp_path / "a.exr", ray, HEADER), "--fov", "50"
    )


def test_frames_that_count_on_test_each_other(tmp_path: Path, capfd) -> None:
    """Under a camera that stands still, motion is that of movers, and found again in the frame before."""
    still = LAYERS | {"V.Vector.XY": FOUND["motion"] * 0}
    paths = [foreign_exr.write(tmp_path / f"a_{n}.exr", still, HEADER) for n in (7, 8, 10)]
    text = told(capfd, *paths, "--fov", "50")
    assert [line.split()[0] for line in text.split(".exr: ")[1:]] == ["64x48,"] * 3
    assert text.count("agrees: the kind of depth with planes, motion with the cameras") == 1


def test_a_folder_or_pattern_stands_for_its_files(tmp_path: Path, capfd) -> None:
    (folder := tmp_path / "shot").mkdir()
    for number in (10, 9):
        foreign_exr.write(folder / f"a.{number}.exr", {"RGB": GREY})
    for named in (folder, folder / "a.##.exr"):
        text = told(capfd, named)
        assert -1 < text.index("a.9.exr:") < text.index("a.10.exr:")


def test_what_fits_no_profile_is_still_shown(tmp_path: Path, capfd) -> None:
    path = foreign_exr.write(tmp_path / "photo.exr", {"RGB": GREY, "extra.Q": GREY[..., 0]})
    text = told(capfd, path, "--out", tmp_path / "out")
    assert f"fits no profile ({', '.join(SHIPPED)}): none finds its depth" in text
    assert Image.open(tmp_path / "out" / "photo_sheet.png").width > 2 * 320


def test_the_sheet_shows_layers_and_what_they_become(tmp_path: Path, capfd) -> None:
    path = foreign_exr.write(tmp_path / "a_7.exr", LAYERS, HEADER)
    assert "wrote" in told(capfd, path, "--out", tmp_path / "raw")
    assert "wrote" in told(capfd, path, "--fov", "50", "--out", tmp_path / "both")
    raw, both = (Image.open(tmp_path / folder / "a_7_sheet.png") for folder in ("raw", "both"))
    assert both.height > raw.height


def test_a_frame_of_gbufrt(tmp_path: Path, capfd) -> None:
    frame = boxes.frame(boxes.camera((24, 32)), index=4)
    write_exr(tmp_path / "own.exr", frame)
    text = told(capfd, tmp_path / "own.exr", "--out", tmp_path / "out")
    assert "taken for gbufrt's own, because the header has gbufrt Frame 4 at 0 s" in text
    assert "frame.depth Z float32" in text
    assert "agrees: depth with normals, motion with the cameras wrote" in text
    assert (tmp_path / "out" / "own_sheet.png").is_file()
    write_exr(tmp_path / "part.exr", frame, only=("image", "depth"))
    assert "part.exr is no whole frame" in told(capfd, tmp_path / "part.exr", "--out", tmp_path / "out")


def test_worlds(tmp_path: Path, capfd) -> None:
    path = tmp_path / "a.vox"
    path.write_bytes(vox.file(vox.model((3, 4, 5), [(0, 0, 0, 1), (2, 3, 4, 2)]), version=150))
    text = told(capfd, path)
    assert text == f"{path}: MagicaVoxel 150, 1 model, 3 x 4 x 5, the last number upwards; 2 voxels, 0 materials"


def test_worlds_whose_tags_are_of_a_wrong_kind(tmp_path: Path, capfd) -> None:
    nbtlib = pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")
    for tags, message in (
        ({"Height": 1}, "a.schem: Width must be int, got none"),
        ({"Width": 1, "Height": 1, "Length": 1, "Version": "x"}, "a.schem: Version must be int, got String"),
    ):
        kinds = {int: nbtlib.Short, str: nbtlib.String}
        nbtlib.File({name: kinds[type(value)](value) for name, value in tags.items()}).save(tmp_path / "a.schem")
        assert message in told(capfd, tmp_path / "a.schem", code=2)
    region = tmp_path / "r.0.0.mca"
    region.write_bytes(b"")  # as the game leaves some behind
    assert "region, empty: no chunk was ever saved in 1 file; there is nothing to render" in told(capfd, region)
    region.write_bytes(b"\0\0\2\1".ljust(8192, b"\0") + b"\0\0\0\2\5x")
    assert "data version not known, because chunk 0,0 cannot be read (compression must" in told(capfd, region)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("mca/1.18.2/r.0.0.mca", "Minecraft region, data version 2975, 280 chunks in 1 file, in x 0..320 and z 0..224"),
        ("mca/1.12.2", "Minecraft save, data version 1343, 105 chunks in 1 file, in x 16..432 and z -80..0"),
        ("schem/smallhouse1.schem", "Sponge schematic 2, 21 x 28 x 20 blocks, the middle number upwards, Minecraft's"),
    ],
)
def test_real_worlds(capfd, file: str, message: str) -> None:
    folder = os.environ.get("GBUFRT_TEST_DATA")
    if not folder:
        pytest.skip("GBUFRT_TEST_DATA is not set: no real worlds")
    assert message in told(capfd, Path(folder) / file)


@pytest.mark.parametrize("name", ["blender4515_cycles_multilayer", "blender501_cycles_multipart", "mitsuba391_aov"])
def test_real_files_of_other_renderers(tmp_path: Path, capfd, name: str) -> None:
    folder = os.environ.get("GBUFRT_TEST_DATA")
    if not folder:
        pytest.skip("GBUFRT_TEST_DATA is not set: no files of other renderers")
    camera = tmp_path / "camera.toml"
    camera.write_text(
        'location = [0, -10, 3]\nrotation = [80, 0, 0]\nfocal_length = 50\nconvention = "opengl"\nup = "z"\n'
    )
    text = told(capfd, Path(folder) / "exr" / f"{name}.exr", "--camera", camera)
    assert f"taken for {name[:7]}, {93 if name.startswith('blender') else 100}% sure" in text
    assert text.endswith("agrees: depth with normals")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no files given; give EXR files or worlds"),
        (("none.exr",), "none.exr does not exist; check the path"),
        (("{}", "--fov", "5", "--camera", "c.toml"), "--camera and --fov exclude each other"),
        (("{}", "--fov", "500"), "--fov must lie between 0 and 180 degrees, got 500"),
        (("{}", "--from", "blendr"), "no profile 'blendr' in --from (did you mean blender?); it has auto, blender,"),
        (("{}", "--from", "nuke", "--out", "{}"), "a.exr is a file; choose another name"),
        (("{}", "--from", "falcor"), "has no depth under linearZ.R, linearZ.X, linearZ; choose another profile"),
        (("picture.png",), "picture.png is of a kind that is not read; give .vox, .schem, .schematic, .litematic, "),
    ],
)
def test_what_is_wrong_is_told_in_one_line(tmp_path: Path, capfd, monkeypatch, arguments, message: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("picture.png").write_bytes(b"")
    path = foreign_exr.write(tmp_path / "a.exr", LAYERS, HEADER)
    text = told(capfd, *(str(a).format(path) for a in arguments), code=2)
    assert text.startswith("gbufrt: ")
    assert message in text


def test_a_folder_of_nothing_that_is_read(tmp_path: Path, capfd) -> None:
    assert "holds neither EXR files nor a Minecraft world; give files" in told(capfd, tmp_path, code=2)


def test_folders_beside_the_overworld_are_told_from_it(tmp_path: Path, capfd) -> None:
    """A save of mods may have no other dimension than theirs; poi and entities hold regions without blocks."""
    moon = tmp_path / "save/dimensions/mod/moon"
    chunks = {(0, 0): region.chunk("1.21", 0, 0, [])}
    for folder, held in (
        (moon / "region", chunks),
        (moon / "poi", {(0, 0): File({"DataVersion": Int(3955), "Sections": Compound({})})}),
    ):
        folder.mkdir(parents=True)
        region.write_region(folder / "r.0.0.mca", held)
    for there in ("save", "save/dimensions", "save/dimensions/mod"):
        text = told(capfd, tmp_path / there, code=2)
        assert f"{there} is no save with an overworld; give a folder within it: {moon}" in text
    assert "1 chunk in 1 file" in told(capfd, moon)
    text = told(capfd, moon / "poi", code=2)
    assert "poi/r.0.0.mca: it holds entities or points of interest, no blocks; give the file of that name" in text
