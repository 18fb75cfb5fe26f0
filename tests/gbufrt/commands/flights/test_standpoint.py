"""`gbufrt render --camera`: a camera of the user's own for each frame."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
import torch
from command_line import SMALL, fake_load, fake_me1, install, run

from gbufrt import Frame
from gbufrt.commands.arguments.options import FileOptions
from gbufrt.commands.flights.flight import Flight
from gbufrt.commands.flights.job import Job
from gbufrt.commands.flights.sampling import Sampling
from gbufrt.commands.flights.shots import Shot
from gbufrt.commands.flights.standpoint import Standpoint
from gbufrt.commands.progress import Tick
from gbufrt.commands.recipe import Recipe
from gbufrt.commands.session import Runner
from gbufrt.files.exr import read_exr

FLIGHT = """
rotation = [180.0, 0.0, 0.0]
fov = 50.0
[[frames]]
number = 7
location = [2.0, 4.0, 9.0]
[[frames]]
number = 8
location = [2.5, 4.0, 9.0]
[[frames]]
number = 9
location = [0.5, 3.0, 8.0]
cut = true
"""


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path)
    Path("flight.toml").write_text(FLIGHT)


def test_each_frame_has_its_own_camera():
    assert run("render", "--camera", "flight.toml", *SMALL, "--out", "a") == 0
    frames = [read_exr(path) for path in sorted(Path("a").glob("*.exr"))]
    places, before = ((2.0, 4.0, 9.0), (2.5, 4.0, 9.0), (0.5, 3.0, 8.0)), []
    for frame in frames:
        assert frame.gbuffer.previous_camera is not None
        before.append(tuple(frame.gbuffer.previous_camera.position[0].tolist()))
    assert [tuple(frame.gbuffer.camera.position[0].tolist()) for frame in frames] == list(places)
    assert before == [places[0], places[0], places[2]], "the first stands still, and so does one after a cut"
    assert [frame.cut is not None and bool(frame.cut) for frame in frames] == [False, False, True]


def test_some_of_the_frames_are_enough_and_no_others_can_be_made(capsys: pytest.CaptureFixture[str]):
    assert run("render", "--camera", "flight.toml", "--frames", "2", *SMALL, "--out", "a") == 0
    assert len(list(Path("a").glob("*.exr"))) == 2
    assert run("render", "--camera", "flight.toml", "--frames", "4", *SMALL, "--out", "b") == 2
    assert "flight.toml has no frame 10; it has 7 to 9" in capsys.readouterr().err
    assert run("render", "--camera", "flight.toml", "--frames", "0", *SMALL, "--out", "b") == 2
    assert run("render", "--camera", "nowhere.toml", *SMALL, "--out", "b") == 2
    assert "nowhere.toml does not exist" in capsys.readouterr().err
    assert not Path("b").exists()


def test_a_great_turn_is_a_cut_and_told(capsys: pytest.CaptureFixture[str]):
    Path("turn.toml").write_text(FLIGHT.replace("cut = true", "rotation = [180.0, 90.0, 0.0]"))
    assert run("render", "--camera", "turn.toml", *SMALL, "--out", "a") == 0
    assert "frame 9: the camera turns by 90 degrees" in " ".join(capsys.readouterr().err.split())
    cuts = [read_exr(path).cut for path in sorted(Path("a").glob("*.exr"))]
    assert [cut is not None and bool(cut) for cut in cuts] == [False, False, True]


class Counting(Runner):
    """Counts stills that histories begin with."""

    begun: list[int]

    def settle(self, stills: Iterable[Frame], tick: Tick = lambda: None) -> None:
        self.begun = [*getattr(self, "begun", ()), len(list(stills))]


def test_each_shot_begins_with_stills_of_other_noise():
    point = Standpoint.of(None, None, None, None, Path("flight.toml"))
    given = {"size": (16, 24), "frames": 3, "time": 0.0, "fps": 24.0, "samples": None, "seed": None}
    job = Job(world="builtin", standpoint=point, **given)
    recipe, runner = Recipe(fog=True), Counting(fake_me1(), 2)
    flight = Flight(
        job=job,
        scene=fake_load("builtin"),
        recipe=recipe,
        sampling=Sampling(),
        notes={},
        debug=False,
        files=FileOptions(),
    )
    assert len(list(flight.make(Shot(begin=0, wanted=(0, 1, 2)), runner, device=torch.device("cpu")))) == 3
    assert runner.begun == [2, 2], "before the first frame, and before the cut"


@pytest.mark.parametrize("option", ["--view=front", "--eye=1,2,3", "--target=1,2,3", "--fov=40"])
def test_other_ways_to_place_a_camera_are_refused(option: str, capsys: pytest.CaptureFixture[str]):
    assert run("render", "--camera", "flight.toml", option, *SMALL, "--out", "a") == 2
    assert f"leave {option.split('=')[0]} out" in " ".join(capsys.readouterr().err.split())


def test_resume_refuses_other_cameras(capsys: pytest.CaptureFixture[str]):
    resume = ("render", "--camera", "flight.toml", *SMALL, "--out", "a", "--resume")
    assert run(*resume) == 0
    assert run(*resume) == 0
    assert "all 3 frames are in a already" in capsys.readouterr().out
    Path("flight.toml").write_text(FLIGHT.replace("2.5", "2.6"))
    assert run(*resume) == 2
    assert "cannot resume" in capsys.readouterr().err


def test_one_camera_holds_for_all_frames_and_a_lens_in_pixels_for_smaller_ones():
    Path("one.toml").write_text(
        "location = [2.0, 4.0, 9.0]\nrotation = [180.0, 0.0, 0.0]\n"
        "intrinsics = [[20.0, 0.0, 12.0], [0.0, 20.0, 8.0], [0.0, 0.0, 1.0]]\n"
    )
    point = Standpoint.of(None, None, None, None, Path("one.toml"))
    point.check(5)
    whole, half = (point.camera(fake_load("builtin"), 4, 0.0, size=size, of=(16, 24)) for size in ((16, 24), (8, 12)))
    assert point.frames == 1
    assert not point.cuts_at(4)
    torch.testing.assert_close(half.intrinsics[0, :2], whole.intrinsics[0, :2] / 2)
    assert half.size == (8, 12)


def test_a_view_written_to_a_file_is_that_view():
    scene, size = fake_load("builtin"), (16, 24)
    seen = Standpoint(view="front").camera(scene, 0, 0.0, size=size)
    Path("view.toml").write_text(f"fov = 50.0\nworld_from_view = {seen.world_from_view[0].tolist()}\n")
    again = Standpoint.of(None, None, None, None, Path("view.toml")).camera(scene, 0, 0.0, size=size)
    torch.testing.assert_close(again.intrinsics, seen.intrinsics)
    torch.testing.assert_close(again.world_from_view, seen.world_from_view)
