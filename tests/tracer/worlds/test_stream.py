"""Streams: frames are those of the whole world where the window reaches, and a shift of the window shows in nothing."""

from __future__ import annotations

import pickle
import warnings
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")

import torch
from hills import LONG, WIDE, save_of_hills
from writers.pack import textures, write_pack

import tracer
from gbufrt import Frame
from gbufrt.gbuffer import CHANNELS
from tracer.scene.scene import Haze, Scene, Sky
from tracer.scene.view import View
from tracer.worlds.regions.stream import Stream, stream

DOWN = View(
    eye=lambda t: (200.0 + 4.0 * t, 34.0, 48.0), target=lambda t: (204.0 + 4.0 * t, 0.0, 48.0), fov_y=40.0
)  # 4 blocks a second; a window of 8 chunks moves after 4 s and after 8 s
SIZE = (24, 40)
BLACK = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def save(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_of_hills(tmp_path_factory.mktemp("hills"), lamps=False)


def frame_at(world: Scene | Stream, time: float, view: View = DOWN) -> Frame:
    now, before = (view.camera(t, size=SIZE) for t in (time, time - 1.0))
    return tracer.render(
        world.around(view.eye(time)), now, previous_camera=before, time=time, previous_time=time - 1.0, light_samples=2
    )


def check_same(found: Frame, wanted: Frame, *, but: str = "") -> None:
    for name in CHANNELS:
        if name not in ("material_id", but):  # numbers go by the order in which blocks are met
            assert torch.equal(getattr(found.gbuffer, name), getattr(wanted.gbuffer, name)), name
    hit = wanted.gbuffer.hit
    for name in ("radiance", "ambient"):
        assert torch.equal(*(torch.where(hit, frame.read(name), 0.0) for frame in (found, wanted))), name


def test_packs_dress_what_streams_in_as_they_dress_the_whole(save: Path, tmp_path: Path):
    pixels = torch.randint(0, 255, (8, 8, 3), generator=torch.Generator().manual_seed(0)).numpy()
    pack = write_pack(tmp_path / "pack.zip", textures(stone=pixels, grass_block_top=pixels[::-1]))
    box = (0, -64, 0, 16 * LONG, 64, 16 * WIDE)
    with pytest.warns(UserWarning, match="3 blocks have no texture in the pack: glass, poppy, water"):
        flown, whole = stream(save, window=8, pack=pack), tracer.load(save, box=box, pack=pack)
    whole = replace(whole, sun=flown.sun, sky=flown.sky)
    for time in (1, 5):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            found = frame_at(flown, time).gbuffer
        assert sum("no texture in the pack: " in str(warning.message) for warning in told) == (time == 1)
        wanted, plain = frame_at(whole, time).gbuffer, frame_at(stream(save, window=8), time).gbuffer
        assert found.albedo is not None
        assert wanted.albedo is not None
        assert torch.equal(found.albedo, wanted.albedo)
        assert float((found.albedo != plain.albedo).float().mean()) > 0.3
    with pytest.raises(FileNotFoundError, match="does not exist"):
        stream(save, pack=tmp_path / "nothing.zip")


def test_frames_and_motion_are_those_of_the_whole_world(save: Path):
    flown, whole = stream(save, window=8), tracer.load(save, box=(0, -64, 0, 16 * LONG, 64, 16 * WIDE))
    whole = replace(whole, sun=flown.sun, sky=flown.sky)
    scenes = set[Scene]()
    for time in (1, 4, 5, 8, 9):
        scenes.add(flown.around(DOWN.eye(time)))
        found, wanted = frame_at(flown, time), frame_at(whole, time)
        assert bool(wanted.gbuffer.hit.all())
        assert set(found.gbuffer.object_id.unique().tolist()) == {0, 1}  # pyright: ignore[reportOptionalMemberAccess]
        check_same(found, wanted)
        assert found.behind is not None
        assert wanted.behind is not None
        check_same(found.behind, wanted.behind)
    assert len(scenes) == 3


def test_lamps_come_and_go_with_their_chunks(tmp_path: Path):
    save = save_of_hills(tmp_path)
    night = replace(stream(save, window=8), sun=None, sky=Sky(**dict.fromkeys(("zenith", "horizon", "ground"), BLACK)))
    for x in (200.0, 232.0):
        view = replace(DOWN, eye=lambda _, x=x: (x, 34.0, 48.0), target=lambda _, x=x: (x + 4.0, 0.0, 48.0))
        low = round(x / 16) * 16 - 64
        there = replace(tracer.load(save, box=(low, -64, 0, low + 128, 64, 96)), sun=night.sun, sky=night.sky)
        found, wanted = frame_at(night, 0.0, view), frame_at(there, 0.0, view)
        assert torch.equal(found.read("radiance"), wanted.read("radiance"))
        gained = found.read("radiance") - frame_at(replace(there, instances=()), 0.0, view).read("radiance")
        assert int((gained.amax(dim=1) > 3e-4).sum()) > 20


def test_a_window_without_land_shows_the_sky_and_no_stars_beneath_it(save: Path):
    view = View(eye=lambda _: (-900.0, 30.0, 0.0), target=lambda _: (-860.0, 30.0, 5.0))
    night = tracer.at_hour(stream(save, window=4), 0.0, day=14.8)
    frame = frame_at(night, 0.0, view)
    assert not bool(frame.gbuffer.hit.any())
    scene = night.around(view.eye(0.0))
    starless = replace(scene, sky=replace(scene.sky, stars=None))
    same = (frame.read("radiance") == frame_at(starless, 0.0, view).read("radiance")).all(dim=1)
    assert bool(same[:, SIZE[0] // 2 :].all())
    assert not bool(same.all())


def test_the_border_of_the_window_is_never_seen(save: Path):
    """Where the land goes on beyond the window nothing ends in sight: what is far off has the sky's colour."""
    flown = stream(save, window=4)
    view = View(eye=lambda t: (200.0 + t, 14.0, 48.0), target=lambda t: (240.0 + t, 11.0, 48.0), fov_y=40.0)
    whole = tracer.load(save, box=(0, -64, 0, 16 * LONG, 64, 16 * WIDE))
    haze = flown.around(view.eye(0.0)).haze
    assert haze is not None
    whole = replace(whole, sun=flown.sun, sky=flown.sky, haze=haze)
    seen = 0
    for time in (0.0, 7.0, 9.0, 15.0):
        found, wanted = frame_at(flown, time, view), frame_at(whole, time, view)
        check_same(found, wanted, but="thickness")  # which goes on underground
        assert torch.equal(found.read("radiance"), wanted.read("radiance"))
        seen += int(found.gbuffer.hit.sum())
    assert seen > 1000


def test_haze_hides_what_is_far_and_leaves_what_is_near(save: Path):
    whole = tracer.load(save, box=(0, -64, 0, 16 * LONG, 64, 16 * WIDE))
    view = View(eye=lambda _: (200.0, 40.0, 48.0), target=lambda _: (240.0, 10.0, 48.0), fov_y=60.0)
    clear, hazy = frame_at(whole, 0.0, view), frame_at(replace(whole, haze=Haze(begin=30.0, end=60.0)), 0.0, view)
    directions = clear.gbuffer.camera.rays()[1]
    along = (directions * clear.gbuffer.camera.forward[:, None, None]).sum(-1)
    far = (clear.gbuffer.depth[:, 0] / along * directions[..., [0, 2]].norm(dim=-1))[:, None]
    near, gone, air = far < 30, clear.gbuffer.hit & (far > 60), hazy.gbuffer.emission
    assert air is not None
    assert torch.equal(hazy.read("radiance")[near.expand(-1, 3, -1, -1)], clear.read("radiance")[near.expand_as(air)])
    assert not bool(hazy.gbuffer.hit[gone].any())
    between = hazy.gbuffer.hit & (far > 50)
    assert bool(between.any() & gone.any() & near.any())
    albedo, before = hazy.gbuffer.albedo, clear.gbuffer.albedo
    assert albedo is not None
    assert before is not None
    assert float((albedo / before).masked_select(between).max()) < 0.5
    assert float(air.masked_select(between).min()) > 0.2
    hidden = hazy.read("radiance").movedim(1, -1)[gone[:, 0]]
    assert float(hidden[:, 2].min()) > 0.9 * whole.sky.horizon[2], "the sky over the horizon, not the ground under it"


def test_a_stream_flies_over_the_land_and_goes_to_workers(save: Path):
    flown = stream(save, window=4)
    flight = flown.views["flight"]
    for time in torch.linspace(0.0, 200.0, 101).tolist():
        x, y, z = flight.eye(time)
        assert 24.0 <= x <= 16 * LONG - 24.0
        assert 20.0 <= z <= 16 * WIDE - 20.0
        assert 24.0 < y < 40.0
    sent = pickle.loads(pickle.dumps(replace(flown, views={})))
    assert named_like(sent, flown)


def named_like(a: Stream, b: Stream) -> bool:
    eye = (200.0, 30.0, 48.0)
    return torch.equal(a.around(eye).world.index > 0, b.around(eye).world.index > 0)


def test_streams_of_nothing_are_refused(tmp_path: Path, save: Path):
    with pytest.raises(FileNotFoundError, match="does not exist"):
        stream(tmp_path / "none.mca")
    with pytest.raises(ValueError, match="has no chunks in that part"):
        stream(save, around=(9000, 0), chunks=4)
    with pytest.raises(ValueError, match="chunks needs around where there is a window"):
        stream(save, chunks=4)
    with pytest.raises(ValueError, match=r"window must lie in 4\.\.64 chunks, got 100"):
        stream(save, window=100)
