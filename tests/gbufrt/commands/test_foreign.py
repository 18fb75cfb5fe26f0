"""`gbufrt post --from`: files of other renderers, their numbers and cameras, and the passes that fit them."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
from command_line import run
from writers import foreign_exr

from gbufrt import Frame
from gbufrt.commands.fitting import LIT, pipeline_for
from gbufrt.commands.foreign import Source
from gbufrt.commands.post import gathered
from gbufrt.commands.recipe import Recipe
from gbufrt.files.exr import read_exr

CAMERA = """
location = [0.0, -10.0, 3.0]
rotation = [80.0, 0.0, 0.0]
focal_length = 50.0
sensor_width = 36.0
convention = "opengl"
up = "z"
"""


def rendered(path: Path, *, direct: bool, level: float = 0.5) -> Path:
    """A file as Blender writes it, z up: with passes of direct light, or the finished picture alone."""
    found = foreign_exr.truth()
    x, y, z = np.moveaxis(found["normal"], -1, 0)
    light = np.full((*foreign_exr.SIZE, 3), level, np.float32)
    layers = {
        "ViewLayer.Roughness.X": np.full(foreign_exr.SIZE, 0.5),
        "ViewLayer.Depth.Z": np.where(found["hit"], found["planar"], 1e10),
        "ViewLayer.Normal.XYZ": np.stack([x, -z, y], -1),
        "ViewLayer.Combined.RGB": light,
    }
    if direct:
        layers |= {"ViewLayer.DiffDir.RGB": light, "ViewLayer.DiffCol.RGB": light}
    return foreign_exr.write(path, layers, {"BlenderMultiChannel": "Blender V2.55.1 and newer"})


def taken(path: Path) -> Frame:
    (frame,) = Source.of([path], "auto", None, 50.0).frames()
    return frame


def test_direct_light_gets_all_passes_and_a_finished_picture_no_light(tmp_path: Path) -> None:
    direct = taken(rendered(tmp_path / "a_0001.exr", direct=True))
    finished = taken(rendered(tmp_path / "b_0001.exr", direct=False))
    assert finished.radiance is None
    assert set(LIT) <= set(pipeline_for(direct, Recipe(), ()).stages)
    stages = set(pipeline_for(finished, Recipe(), ()).stages)
    assert not stages & set(LIT)
    assert {"missing", "taa", "motion_blur", "tone_map", "encode"} <= stages
    image = pipeline_for(finished, Recipe(preset="low"), ())(finished)[0].read("composite")
    assert np.allclose(image, 0.5)


def test_reflections_on_a_guess_of_roughness_must_be_asked_for(tmp_path: Path) -> None:
    frame = taken(rendered(tmp_path / "a_0001.exr", direct=True))
    guessed = frame.replace(gbuffer=frame.gbuffer.replace(roughness=None))
    with pytest.warns(UserWarning, match="no roughness, so that reflections are left out"):
        pipeline = pipeline_for(guessed, Recipe(), ())
    assert set(LIT) - set(pipeline.stages) == {"reflection"}
    assert pipeline.writes.isdisjoint(("roughness", "metallic"))
    asked = pipeline_for(guessed, Recipe(), ("reflection", "ao"))
    assert "reflection" in asked.stages
    assert asked.writes >= {"roughness", "metallic", "thickness", "motion"}
    known = pipeline_for(frame, Recipe(), ())
    assert "reflection" in known.stages
    assert known.writes.isdisjoint(("roughness", "metallic"))


def test_noisy_light_is_denoised_unless_other_passes_are_asked_for(tmp_path: Path) -> None:
    frame = taken(rendered(tmp_path / "a_0001.exr", direct=True))
    assert frame.radiance is not None
    grainy = frame.replace(radiance=frame.radiance * torch.rand(frame.radiance.shape))
    with pytest.warns(UserWarning, match="the light is noisy, by .* and is denoised first"):
        assert list(pipeline_for(grainy, Recipe(), ()).stages)[:3] == ["missing", "denoise", "ao"]
    with pytest.warns(UserWarning, match="the light is noisy, by .* from which --passes denoise"):
        assert "denoise" not in pipeline_for(grainy, Recipe(), ("ao",)).stages
    unknown = grainy.replace(gbuffer=grainy.gbuffer.replace(albedo=None))
    with pytest.warns(UserWarning, match="from which --passes denoise"):
        assert "denoise" not in pipeline_for(unknown, Recipe(), ()).stages, "it may be a texture"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pipeline_for(grainy, Recipe(), ("denoise", "ao"))
        assert "denoise" not in pipeline_for(frame, Recipe(), ()).stages


def test_normals_that_the_file_lacks_are_estimated_with_care_for_edges(tmp_path: Path) -> None:
    path = rendered(tmp_path / "a_0001.exr", direct=True)
    frame = taken(path)
    g, true = frame.gbuffer, torch.from_numpy(foreign_exr.truth()["normal"]).movedim(-1, 0)[None].float()
    assert bool((frame.read("normal_estimated") == g.hit).all())
    off = [
        torch.rad2deg(torch.arccos((foreign_exr.CAMERA.rotate_to_view(true) * view).sum(1).clamp(-1, 1)))[g.hit[:, 0]]
        for view in (g.camera.rotate_to_view(n) for n in (g.normal, g.camera.normals_from_depth(g.depth)))
    ]
    assert float(off[0].mean()) < 0.2 * float(off[1].mean())
    camera = tmp_path / "camera.toml"
    camera.write_text(f"fov = 50\nworld_from_view = {foreign_exr.CAMERA.world_from_view[0].tolist()}\n")
    (posed,) = Source.of([path], "auto", camera, None).frames()
    assert "normal_estimated" not in posed.extra
    assert np.allclose(posed.gbuffer.normal, true, atol=1e-5)


@pytest.mark.filterwarnings("ignore:reflection.estimate")
def test_passes_of_light_lose_nothing_to_what_is_reflected(tmp_path: Path) -> None:
    """The renderer has taken it off its diffuse light."""
    frame = taken(rendered(tmp_path / "a_0001.exr", direct=True))
    result, _ = pipeline_for(frame, Recipe(preset="low"), ())(frame)
    sum_of_all = result.read("radiance") + result.read("gi") + result.read("reflection")
    assert float(result.read("reflection").max()) > 0.01
    assert torch.allclose(result.read("composite"), sum_of_all, atol=1e-5)


def test_a_finished_picture_may_have_occlusion_as_a_layer(tmp_path: Path) -> None:
    finished = taken(rendered(tmp_path / "b_0001.exr", direct=False))
    pipeline = pipeline_for(finished, Recipe(preset="low"), ("ao",))
    assert list(pipeline.stages) == ["missing", "ao", "exposure", "tone_map", "encode"]
    result, _ = pipeline(finished)
    assert float(result.read("ao").min()) < 0.9
    assert result.bent_normal is not None
    assert np.allclose(result.read("color"), 0.5)


def test_stages_are_chosen_by_name(tmp_path: Path) -> None:
    direct = taken(rendered(tmp_path / "a_0001.exr", direct=True))
    finished = taken(rendered(tmp_path / "b_0001.exr", direct=False))
    chosen = list(pipeline_for(direct, Recipe(), ("denoise", "ao", "dof")).stages)
    assert chosen == ["missing", "denoise", "ao", "composite", "depth_of_field", "exposure", "tone_map", "encode"]
    assert list(pipeline_for(finished, Recipe(), ("dof",)).stages)[:2] == ["missing", "depth_of_field"]
    for frame, signal in ((direct, "radiance"), (finished, "color")):
        assert dict(pipeline_for(frame, Recipe(), ("denoise",)).passes())["denoise"].tunables()["signal"] == signal
    with pytest.raises(ValueError, match=r"--passes gi would add light that the finished picture holds already"):
        pipeline_for(finished, Recipe(), ("gi",))
    with pytest.raises(ValueError, match=r"no stage 'motion_blurr' in --passes \(did you mean motion_blur\?\)"):
        pipeline_for(direct, Recipe(), ("motion_blurr",))


def test_frames_that_count_on_follow_each_other_and_others_do_not(tmp_path: Path, capfd) -> None:
    paths = [rendered(tmp_path / f"shot_{number:04}.exr", direct=True) for number in (7, 8, 11)]
    Source.of(paths[:2], "auto", None, 50.0)
    told = capfd.readouterr().err
    assert "shot_0007.exr: blender (" in told
    assert "--fov: the camera is taken to stand still; moving ones need --camera" in told
    frames = list(Source.of(paths, "blender", None, 50.0).frames())
    assert [frame.index for frame in frames] == [7, 8, 11]
    assert [frame.gbuffer.previous_camera is not None for frame in frames] == [False, True, False]
    assert "no frame 9: histories begin anew after a gap" in capfd.readouterr().err
    twin = rendered(tmp_path / "other_0008.exr", direct=True)  # a frame of its own, no pass of the one before
    for wrong, told in ((paths[::-1], "must count up"), ([*paths[:2], twin], "one frame number, but are no passes")):
        with pytest.raises(ValueError, match=told):
            Source.of(wrong, "blender", None, 50.0)


def test_frames_with_and_without_direct_light_are_not_mixed(tmp_path: Path) -> None:
    paths = [rendered(tmp_path / f"shot_{number:04}.exr", direct=number == 8) for number in (7, 8)]
    for order, numbers in ((paths, "7.* alone, .*8"), (paths[1:] + paths[:1], "7.* alone, .*8")):
        shots = [Source.of([path], "blender", None, 50.0).shots[0] for path in order]
        mixed = Source(shots=shots, profile="blender", cameras=None, fov=50.0)
        with pytest.raises(ValueError, match=f"shot_000{numbers}.exr direct light too; run them apart"):
            list(mixed.frames())


def test_settings_of_what_is_left_out_are_told(tmp_path: Path) -> None:
    frame = taken(rendered(tmp_path / "a_0001.exr", direct=False))
    with pytest.warns(UserWarning, match="--set gtao.radius changes nothing: ao is left out; see --passes"):
        pipeline_for(frame, Recipe(set={"gtao.radius": 3.0}), ())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pipeline_for(frame, Recipe(set={"gtao.radius": 3.0}), ("ao", "denoise"))


def test_a_folder_or_pattern_of_another_renderer_needs_no_profile(tmp_path: Path, capfd) -> None:
    shot = tmp_path / "shot"
    shot.mkdir()
    for number in (9, 10):
        rendered(shot / f"a.{number}.exr", direct=False)
    wanted = [shot / "a.9.exr", shot / "a.10.exr"]
    for named in (shot, shot / "a.##.exr", shot / "a.%02d.exr"):
        assert gathered((named,), tmp_path / "out") == wanted
    (eyes := tmp_path / "eyes").mkdir()
    (left := eyes / "frame_0001_L.EXR").touch()  # no name of `gbufrt render`, which allows no gaps
    assert gathered((eyes,), tmp_path / "out") == [left]
    options = ("--fov", "50", "--preset", "low", "--warmup", "0", "--passes", "fxaa", "--only", "image")
    assert run("post", shot, "--out", tmp_path / "out", *options) == 0, capfd.readouterr().err
    assert sorted(path.name for path in (tmp_path / "out").glob("*.png")) == ["a.10.png", "a.9.png"]


def test_what_is_left_out_is_told_with_the_commands_options(tmp_path: Path, capfd) -> None:
    path = rendered(tmp_path / "a_0001.exr", direct=True)
    options = ("--fov", "50", "--preset", "low", "--warmup", "0", "--passes", "reflection", "--only", "image")
    assert run("post", path, "--out", tmp_path / "out", *options) == 0
    error = capfd.readouterr().err
    assert "because the frame has no environment: --environment SKY.exr with --camera gives it" in error
    assert "Frame" not in error
    assert "told once" not in error


def test_a_still_is_denoised_by_one_run(tmp_path: Path) -> None:
    """More would repeat its noise, which then passes for light."""
    path = rendered(tmp_path / "noisy_0001.exr", direct=True)
    out = tmp_path / "out"
    assert (
        run("post", path, "--from", "auto", "--fov", "50", "--preset", "low", "--passes", "denoise", "--out", out) == 0
    )
    assert float(read_exr(out / "noisy_0001.exr").extra["color_history"].max()) == 1.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "a_0001.exr carries no camera: give --camera FILE.toml, or --fov DEGREES for one that stands still"),
        (("--from", "auto", "--fov", "40", "--camera", "c.toml"), "--camera and --fov exclude each other"),
        (("--from", "auto", "--fov", "181"), "--fov must lie between 0 and 180 degrees, got 181"),
        (("--from", "blendr", "--fov", "50"), "no profile 'blendr' in --from (did you mean blender?); it has auto,"),
        (("--from", "auto", "--camera", "none.toml"), "none.toml does not exist"),
        (("--from", "auto", "--fov", "50", "--passes", "aoo"), "no stage 'aoo' in --passes (did you mean ao?)"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(tmp_path: Path, capfd, arguments: tuple[str, ...], message: str) -> None:
    path = rendered(tmp_path / "a_0001.exr", direct=True)
    assert run("post", path, *arguments, "--out", tmp_path / "out") == 2
    assert message in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["blender4515_cycles_multilayer", "blender501_cycles_multipart", "mitsuba391_aov"])
def test_real_files_become_pictures(tmp_path: Path, capfd, name: str) -> None:
    folder = os.environ.get("GBUFRT_TEST_DATA")
    if not folder:
        pytest.skip("GBUFRT_TEST_DATA is not set: no files of other renderers")
    camera = tmp_path / "camera.toml"
    camera.write_text(CAMERA)
    arguments = ("--camera", camera, "--preset", "low", "--warmup", "0", "--out", tmp_path / "out")
    assert run("post", Path(folder) / "exr" / f"{name}.exr", *arguments) == 0
    frame, told = read_exr(tmp_path / "out" / f"{name}.exr"), capfd.readouterr().err
    assert f"{name}.exr: {name[:7]}" in told
    assert "fits better" not in told
    assert frame.image is not None
    assert 0.1 < float(frame.image.mean()) < 0.9
    assert (frame.gi is None) == name.startswith("mitsuba")
