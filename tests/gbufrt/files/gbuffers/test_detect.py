"""Detection: which profile, how sure, and why."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from writers import foreign_exr

from gbufrt.commands.foreign import Source
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.detect import Detection, detect
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.named import Named
from gbufrt.files.gbuffers.profile import load_profile
from gbufrt.files.guard import read_parts

PLANE = np.ones(foreign_exr.SIZE)
RGB = np.ones((*foreign_exr.SIZE, 3))
BLENDER = {"BlenderMultiChannel": "Blender V2.55.1 and newer"}


def test_a_mark_in_the_header_and_all_names_make_certain(tmp_path: Path) -> None:
    layers = {"V.Depth.Z": PLANE, "V.Normal.XYZ": RGB, "V.Vector.XY": RGB[..., :2], "V.DiffCol.RGB": RGB}
    layers |= {"V.Roughness.X": PLANE, "V.Metallic.X": PLANE}
    found = detect(foreign_exr.write(tmp_path / "a.exr", layers, BLENDER))
    assert found == Detection(
        "blender",
        1.0,
        (
            "the header has BlenderMultiChannel = 'Blender V2.55.1 and newer'",
            "depth is V.Depth.Z",
            "normal is V.Normal.X, V.Normal.Y, V.Normal.Z",
            "motion is V.Vector.X, V.Vector.Y",
            "albedo is V.DiffCol.R, V.DiffCol.G, V.DiffCol.B",
            "roughness is V.Roughness.X",
            "metallic is V.Metallic.X",
        ),
    )
    unmarked = detect(foreign_exr.write(tmp_path / "b.exr", layers | {"V.Combined.RGB": RGB}))
    assert (unmarked.name, unmarked.certainty, len(unmarked.reasons)) == ("blender", 0.9, 6)


def test_a_mark_weighs_more_than_names(tmp_path: Path) -> None:
    """Three of Nuke's four channels and two of Blender's six in one file: the header decides, else the names."""
    layers = {"V.Depth.Z": PLANE, "V.Normal.XYZ": RGB, "depth.Z": PLANE, "N.XYZ": RGB, "backward.uv": RGB[..., :2]}
    assert detect(foreign_exr.write(tmp_path / "a.exr", layers)).name == "nuke"
    found = detect(foreign_exr.write(tmp_path / "b.exr", layers, BLENDER))
    assert (found.name, found.certainty) == ("blender", 0.73)


def test_a_mark_of_another_text_does_not_count(tmp_path: Path) -> None:
    layers = {"dd.T": PLANE, "nn.XYZ": RGB, "RGB": RGB}
    by = [foreign_exr.write(tmp_path / f"{n}.exr", layers, {"generatedBy": n}) for n in ("Mitsuba version 3", "Other")]
    sure, unsure = map(detect, by)
    assert sure.name == unsure.name == "mitsuba"
    assert sure.certainty > 0.8 > 0.7 > unsure.certainty > 0.5
    assert not any("header" in reason for reason in unsure.reasons)


def test_who_knows_the_light_knows_the_file(tmp_path: Path) -> None:
    """Blender's names for depth and normals are those of data sets too, whose picture it would not find."""
    layers = {"Depth.Z": PLANE, "Normal.XYZ": RGB, "RGB": RGB}
    assert detect(foreign_exr.write(tmp_path / "a.exr", layers | {"Albedo.RGB": RGB})).name == "generic"
    assert detect(foreign_exr.write(tmp_path / "b.exr", layers | {"Combined.RGB": RGB})).name == "blender"


@pytest.mark.parametrize("name", ["linear_depth.Z", "LinearDepth.R", "z_depth.red", "distance", "DEPTH.V"])
def test_plain_names_of_depth_in_any_spelling(name: str, tmp_path: Path) -> None:
    (path,) = (foreign_exr.write_parts(tmp_path / "a.exr", {"": {name: PLANE, **dict.fromkeys("RGB", PLANE)}}),)
    assert detect(path).reasons[0] == f"depth is {name}"


@pytest.mark.parametrize("spelled", [str.upper, str.lower, str.title])
def test_plain_names_are_found_in_any_case(spelled: Callable[[str], str], tmp_path: Path) -> None:
    names = {"normal": "RGB", "albedo": "RGB", "emission": "RGB", "roughness": "Y", "beauty": "RGB"}
    layers = {f"{spelled(name)}.{ends}": RGB[..., : len(ends)] for name, ends in names.items()}
    path = foreign_exr.write(tmp_path / "a.exr", {f"{spelled('zdepth')}.V": PLANE, **layers})
    assert detect(path).name == "generic"
    named = Named(Layers(path, read_parts(path)), load_profile("generic"))
    for name, ends in names.items():
        keys = named.light().finished if name == "beauty" else named.keys(name)
        assert keys == [f"{spelled(name)}.{end}" for end in ends]


def test_files_of_plain_names_with_depth_and_a_picture_are_no_renderers(tmp_path: Path) -> None:
    """A file a pass, as small renderers write them; Mitsuba's names would take depth from the positions."""
    passes = {"depth": PLANE, "position": RGB, "normal": RGB, "albedo": RGB, "color": RGB}
    files = [
        foreign_exr.write(tmp_path / f"{name}.exr", {".Y" if name == "depth" else ".RGB": pixels})
        for name, pixels in passes.items()
    ]
    assert (detect(files).name, detect(files).reasons[0]) == ("generic", "depth is depth.Y")
    assert detect(files[:-1]).name == "generic"


def test_without_depth_no_profile_fits(tmp_path: Path) -> None:
    layers = {f"{name}.RGB": RGB for name in "abcdefghijklmn"}
    with pytest.raises(
        ValueError,
        match=r"fits no profile \(blender, .*\): none finds its depth among a, .*, l, \.\.\.; render depth or",
    ):
        detect(foreign_exr.write(tmp_path / "a.exr", layers, BLENDER))


def test_files_of_gbufrt_itself_are_no_guess(tmp_path: Path) -> None:
    """By names alone they would be plain ones, whose picture is exposed already."""
    path = foreign_exr.write(tmp_path / "a.exr", {"frame.depth.Z": PLANE, "RGB": RGB}, {"gbufrt": "{}"})
    with pytest.raises(
        ValueError, match=r"a\.exr was written by gbufrt: .* without --from, --camera, --fov and --pass"
    ):
        detect(path)


def test_a_wrong_profile_is_told_the_one_that_fits(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    layers = {"V.Depth.Z": PLANE, "V.Normal.XYZ": RGB, "V.Combined.RGB": RGB, "depth.Z": PLANE}
    path = foreign_exr.write(tmp_path / "a.exr", layers, BLENDER)
    fits = "blender fits (the header has BlenderMultiChannel = 'Blender V2.55.1 and newer')"
    for command in (("post", "--out", tmp_path / "out"), ("inspect",)):
        assert run(*command, path, "--from", "mitsuba", "--fov", 50) == 2
        assert f"has no depth under *.T, dd.y, depth.y; choose another profile: {fits}" in capfd.readouterr().err
    with pytest.raises(ValueError, match=r"has no depth under .*; choose another profile: blender fits"):
        read_gbuffer(path, "mitsuba", fov=50.0)
    source = Source.of([path], "nuke", None, 50.0)
    assert f"{source.shots[0]}: --from nuke, but {fits}" in capfd.readouterr().err
    Source.of([path], "blender", None, 50.0)
    assert "but" not in capfd.readouterr().err


def test_of_several_view_layers_the_one_with_most_passes_is_taken(tmp_path: Path, capfd) -> None:
    """Whatever their order in the file, which is that of their names; the option chooses another."""
    layers = {"a_clay.Depth.Z": 2 * PLANE, "a_clay.Combined.RGB": RGB}
    layers |= {"main.Depth.Z": 4 * PLANE, "main.Normal.XYZ": RGB, "main.Combined.RGB": RGB}
    path = foreign_exr.write(tmp_path / "a.exr", layers, BLENDER)
    assert "depth is main.Depth.Z" in detect(path).reasons
    with pytest.warns(UserWarning, match="a_clay, main; main is taken, as none has more passes: --layer NAME"):
        frame = read_gbuffer(path, fov=40.0)
    assert float(frame.gbuffer.depth.max()) == 4
    (other,) = Source.of([path], "auto", None, 40.0, layer="a_clay").frames()
    assert float(other.gbuffer.depth.max()) == 2
    assert run("inspect", path, "--layer", "a_clay", "--fov", 40) == 0
    assert "a_clay.Depth.Z (planar" in capfd.readouterr().out
    assert run("post", path, "--layer", "b", "--fov", 40, "--out", tmp_path / "out") == 2
    assert "has no depth in the layer 'b'; it has a_clay, main" in capfd.readouterr().err.splitlines()[-1]
