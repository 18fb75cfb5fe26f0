"""How the command line runs a pipeline over frames: warm-up, cuts, frames without results, units."""

from __future__ import annotations

from pathlib import Path

import boxes
import pytest
import torch
from command_line import fake_me1

from gbufrt import Camera, Frame, GBuffer
from gbufrt.commands.fitting import hint_of_units, pipeline_for
from gbufrt.commands.recipe import Recipe
from gbufrt.commands.session import Runner, bare, own
from gbufrt.files.exr import write_exr
from gbufrt.noise.noise import blue_noise
from post import me1

SHAPE = (18, 32)


def test_runner_starts_anew_where_frames_do_not_follow():
    runner = Runner(fake_me1(), warmup=3)
    first = boxes.frame(boxes.camera((16, 24)), index=5)
    follower = boxes.frame(boxes.camera((16, 24), dx=0.1), previous=boxes.camera((16, 24)), index=6)
    stranger = boxes.frame(boxes.camera((16, 24), dx=9.0), index=7)
    lengths = [float(runner(frame).read("ao_length").max()) for frame in (first, follower, stranger)]
    assert lengths == [4, 5, 4]
    cut = follower.replace(index=8, cut=torch.tensor([True]))
    assert float(runner(cut).read("ao_length").max()) == 4


def test_warm_up_takes_the_noise_of_the_frames_before():
    frame = boxes.frame(boxes.camera((16, 24)), index=1)
    mean = torch.stack([blue_noise(16, 24, index=index) for index in (-2, -1, 0, 1)]).mean(0)
    assert torch.allclose(Runner(fake_me1(), warmup=3)(frame).read("ao")[0], mean * 0.8, atol=1e-5)


def test_bare_frames_hold_no_results():
    frame = boxes.frame(boxes.camera((16, 24)))
    full = frame.replace(
        ao=frame.gbuffer.roughness, behind=frame.replace(ao=frame.gbuffer.roughness), extra={"x": frame.gbuffer.depth}
    )
    clean = bare(full)
    assert clean.behind is not None
    assert clean.present == clean.behind.present == frame.present


def test_a_missing_frame_among_own_files_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / f"frame_{number}.exr" for number in (3, 4, 6)]
    for path, index in zip(files, (3, 4, 6), strict=True):
        write_exr(path, boxes.frame(boxes.camera((16, 24)), index=index))
    assert [frame.index for frame in own(files)] == [3, 4, 6]
    told = capsys.readouterr().err
    assert told == f"gbufrt: no frame 5 before {files[2]}: histories begin anew after a gap\n"


def wall(distance: float, *, orthographic_height: float | None = None) -> Frame:
    """A wall so many units away; the camera sees about as much of it."""
    camera = Camera.look_at(
        (0, 0, distance), (0, 0, 0), size=SHAPE, fov_y=53.0, far=1e5, orthographic_height=orthographic_height
    )
    depth = torch.full((1, 1, *SHAPE), distance)
    normal = torch.zeros(1, 3, *SHAPE)
    normal[:, 2] = 1.0
    return Frame(gbuffer=GBuffer(camera=camera, depth=depth, hit=depth > 0, normal=normal))


@pytest.mark.parametrize("height", [1.0, None])
def test_a_room_in_centimetres_is_told_from_one_in_metres(height: float | None) -> None:
    centimetres = wall(500.0, orthographic_height=height and 500.0)
    told = hint_of_units(centimetres, me1("high"))
    assert "the median depth is 500 units" in told
    assert "--units-per-metre 100" in told
    assert hint_of_units(centimetres, me1("high", units_per_metre=100)) == ""
    assert hint_of_units(wall(5.0, orthographic_height=height and 5.0), me1("high")) == ""
    assert hint_of_units(centimetres, me1("high").without("ao")) == ""


def test_a_table_top_that_the_lens_would_blur_is_told_from_a_room() -> None:
    """All but the middle is twice as far away."""
    near = (torch.arange(SHAPE[1]) - SHAPE[1] // 2).abs() < 6
    told = []
    for distance in (0.4, 8.0):
        frame = wall(distance)
        g = frame.gbuffer
        frame = frame.replace(gbuffer=g.replace(depth=torch.where(near, g.depth, 2 * g.depth)))
        told.append([hint_of_units(frame, me1("high").without(*leave)) for leave in ((), ("ao",), ("depth_of_field",))])
    (full, finished, sharp), room = told
    assert full == finished
    assert full.startswith("depth of field blurs half of the picture by")
    assert "--without depth_of_field, or --set depth_of_field.aperture_radius=0.00" in full
    assert sharp == ""
    assert room == ["", "", ""]
    small = me1("high").with_tunables({"depth_of_field.aperture_radius": 0.04})
    assert hint_of_units(frame, small) == "", "a lens that was chosen"


def test_mirrors_that_stay_black_without_reflections_are_told() -> None:
    """As Mitsuba gives a conductor: no albedo, and no direct light but of lamps that it happens to show."""
    mirror = torch.arange(SHAPE[1]) < 5
    light = torch.where(mirror, 0.0, 0.5).expand(1, 3, *SHAPE)
    frame = wall(5.0).replace(radiance=light)
    g = frame.gbuffer
    with pytest.warns(UserWarning, match=r"left out, and 16% of the surfaces, which have neither light nor albedo"):
        pipeline_for(frame.replace(gbuffer=g.replace(albedo=light)), Recipe(), ())
    for albedo in (None, torch.full_like(light, 0.5)):  # shadows are black too
        with pytest.warns(UserWarning, match=r"are left out; --passes reflection,ao,gi,\.\.\. guesses it"):
            pipeline_for(frame.replace(gbuffer=g.replace(albedo=albedo)), Recipe(), ())
