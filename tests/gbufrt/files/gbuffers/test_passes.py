"""Frames whose passes have a file each, under the names that renderers give them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import run
from writers.foreign_exr import CAMERA, SIZE, truth, write

from gbufrt.commands.foreign import Source
from gbufrt.commands.post import gathered
from gbufrt.files import read_gbuffer
from gbufrt.files.exr import read_exr
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.sequence import by_number, exr_files, shot_parts, shots_of

T = truth()
SKY = ~T["hit"]
DEPTH, NORMAL, LIGHT = np.where(SKY, 0, T["planar"]), T["normal"], np.full((*SIZE, 3), 0.5)


def _layers(folder: Path, *names: str) -> set[str]:
    """The layers of files of R, G and B with those names."""
    files = [folder / name for name in names]
    for file in files:
        file.parent.mkdir(exist_ok=True)
        write(file, {"RGB": LIGHT})
    return {*Layers(files[0], shot_parts(files)).groups()}


@pytest.mark.parametrize(
    ("names", "layers"),
    [
        (("s.Z.0007.exr", "s.N.0007.exr", "s.0007.exr"), {"Z", "N", ""}),
        (("s_a_direct.7.exr", "s_b_direct.7.exr", "s_Z.7.exr"), {"a_direct", "b_direct", "Z"}),
        (("s_depth_left.7.exr", "s_normal_left.7.exr"), {"depth", "normal"}),
        (("M.G.diffuseOpacity.7.RGBA.exr", "M.G.specRough.7.RGBA.exr"), {"diffuseOpacity", "specRough"}),
        (("M.G.linearZ.7.R.exr", "M.A.output.7.exr"), {"G_linearZ", "A_output"}),
        (("my_shot.7.RGBA.exr", "my_shot.7.depth.exr"), {"RGBA", "depth"}),
        (("shot.RGBA.7.exr", "shot.N.7.exr"), {"RGBA", "N"}),
        (("Z/s.7.exr", "N/s.7.exr"), {"Z", "N"}),
        (("s.0101.Z.exr", "s.0101.Mask00.exr", "s.0101.Mask01.exr"), {"Z", "Mask00", "Mask01"}),
        (("Seq.0001FinalImage.exr", "Seq.0001QueueWorldDepth.exr"), {"FinalImage", "QueueWorldDepth"}),
    ],
)
def test_a_pass_is_what_names_do_not_share(names: tuple[str, ...], layers: set[str], tmp_path: Path) -> None:
    assert _layers(tmp_path, *names) == layers


def test_digits_after_letters_are_of_the_pass_where_others_have_a_number_of_their_own(tmp_path: Path) -> None:
    files = [tmp_path / f"s.{number}.{name}.exr" for number in (9, 10) for name in ("Mask01", "N", "Mask00")]
    shots = shots_of(files)
    assert [(shot.number, len(shot.files), shot.name) for shot in shots] == [(9, 3, "s_9"), (10, 3, "s_10")]
    assert by_number(reversed(files))[:3] == sorted(files[:3])
    assert [shot.number for shot in shots_of([tmp_path / f"cam_01_f{n}.exr" for n in (7, 8)])] == [7, 8]


def test_two_files_of_one_pass_are_told(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"s\.N\.07\.exr: two files of one frame number are both of the pass 'N'"):
        _layers(tmp_path, "s.N.07.exr", "s.N.7.exr", "s.Z.7.exr")


def test_folders_may_be_the_passes(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """As Unreal writes {render_pass}/{sequence_name}.{frame_number}."""
    x, y, z = np.moveaxis(NORMAL, -1, 0)
    encoded = np.stack([x, z, y], -1) / 2 + 0.5
    depth = np.where(SKY, 65504, 100 * T["planar"])
    for number in (7, 8):
        for name, pixels in (("FinalImage", LIGHT), ("FinalImageWorldNormal", encoded), ("QueueWorldDepth", depth)):
            (folder := tmp_path / "shot" / name).mkdir(parents=True, exist_ok=True)
            write(folder / f"Seq.{number:04}.exr", {"RGB": np.broadcast_to(pixels.reshape(*SIZE, -1), (*SIZE, 3))})
    files = gathered((tmp_path / "shot",), tmp_path / "out")
    assert files == exr_files(tmp_path / "shot")
    assert [file.name for file in files] == ["Seq.0007.exr"] * 3 + ["Seq.0008.exr"] * 3
    g = read_gbuffer(files[:3], "unreal", camera=CAMERA).gbuffer
    assert np.abs(g.normal[0].permute(1, 2, 0).numpy() - NORMAL)[T["hit"]].max() < 1e-5
    options = (
        "--fov",
        "50",
        "--preset",
        "low",
        "--warmup",
        "0",
        "--passes",
        "fxaa",
        "--only",
        "image,depth,hit,normal",
    )
    assert run("post", tmp_path / "shot", "--out", tmp_path / "out", *options) == 0, capfd.readouterr().err
    assert sorted(path.name for path in (tmp_path / "out").glob("*.png")) == ["Seq_0007.png", "Seq_0008.png"]
    assert (read_exr(tmp_path / "out" / "Seq_0008.exr").gbuffer.hit[0, 0].numpy() == T["hit"]).all()


def test_passes_of_a_still_need_no_number(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name, pixels in (("depth", DEPTH), ("normal", NORMAL), ("beauty", LIGHT)):
        write(tmp_path / f"still_{name}.exr", {"RGB": np.broadcast_to(pixels.reshape(*SIZE, -1), (*SIZE, 3))})
    (shot,) = Source.of(exr_files(tmp_path), "auto", None, 50.0).shots
    assert (len(shot.files), shot.number, shot.name) == (3, 0, "still")
    (frame,) = Source.of(exr_files(tmp_path), "auto", None, 50.0).frames()
    assert (frame.gbuffer.hit[0, 0].numpy() == T["hit"]).all()
    assert run("inspect", tmp_path, "--fov", 50) == 0
    assert "beauty.RGB, a finished picture" in capfd.readouterr().out


def test_stills_that_are_whole_stay_apart(tmp_path: Path) -> None:
    whole = {"depth.Z": DEPTH, "normal.XYZ": NORMAL, "RGB": LIGHT}
    files = [write(tmp_path / f"{name}.exr", whole) for name in "ab"]
    assert [shot.name for shot in Source.of(files, "auto", None, 50.0).shots] == ["a", "b"]
    (tmp_path / "own.toml").write_text('[channels]\ndepth = ["far.Z"]\nnormal = ["way"]')
    files = [write(tmp_path / f"{name}.exr", {"far.Z": DEPTH, "way.XYZ": NORMAL, "RGB": LIGHT}) for name in "cd"]
    assert len(Source.of(files, str(tmp_path / "own.toml"), None, 50.0).shots) == 2
