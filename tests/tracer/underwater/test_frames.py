"""Frames and path-traced truth of cameras in water."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
import torch
import voxels
from torch import Tensor

from gbufrt import Camera, Frame
from post import Composite
from tracer import Scene, Waves, path_trace
from tracer.frames import render
from tracer.gbuffers import layers
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Haze, Sun
from tracer.texture import Look, look
from tracer.traversal.hits import Hits
from tracer.underwater import frames

BLACK, BLUE, GREEN, WALL = 1, 2, 3, 4
TABLE = MaterialTable.of(
    [
        Material(name="black", albedo=(0.0, 0.0, 0.0), roughness=1.0, variation=0.0),
        Material(name="water", albedo=(0.02, 0.05, 0.1), opacity=0.25, tint=(0.5, 0.7, 0.9), variation=0.0),
        Material(name="water of a swamp", albedo=(0.02, 0.05, 0.1), opacity=0.25, tint=(0.5, 0.7, 0.9), variation=0.0),
        Material(name="wall", albedo=(0.8, 0.8, 0.8), roughness=1.0, variation=0.0),
    ]
)
EYE = (32.0, 18.0, 32.0)
UP = Camera.look_at(EYE, (32.0, 24.0, 30.5), size=(24, 32), fov_y=80.0)
AHEAD = Camera.look_at(EYE, (42.0, 18.0, 32.0), size=(24, 32), fov_y=70.0)


def pool(*boxes: tuple, sun: Sun | None = None) -> Scene:
    """Black walls far away, and water from 1 up to 22 of two kinds that look alike, under an even sky."""
    world = voxels.world(
        (64, 24, 64),
        (BLACK, (0, 0, 0), (64, 22, 64)),
        (BLUE, (1, 1, 1), (34, 22, 63)),
        (GREEN, (34, 1, 1), (63, 22, 63)),
        *boxes,
        table=TABLE,
    )
    return Scene(world=world, sky=voxels.EVEN_SKY, sun=sun)


def direct(frame: Frame) -> Tensor:
    """Direct light, and what comes through the surface."""
    assert frame.behind is not None
    assert frame.gbuffer.transmittance is not None
    return frame.read("radiance") + frame.gbuffer.transmittance * frame.behind.read("radiance")


def window(frame: Frame) -> Tensor:
    """Pixels that see the sky through the surface."""
    assert frame.gbuffer.transmittance is not None
    return (frame.gbuffer.transmittance.amax(dim=1, keepdim=True) > 0) & (frame.gbuffer.normal[:, 1:2] < -0.5)


def test_the_sky_fills_a_window_of_the_critical_angle():
    frame = render(pool(), UP)
    frame.validate()
    cosine = UP.rays()[1][..., 1][:, None]
    inside = cosine > math.sqrt(1 - 9 / 16)
    assert torch.equal(window(frame), inside)
    assert 0.1 < inside.float().mean() < 0.9
    assert frame.behind is not None
    sky = frame.behind.read("radiance").permute(0, 2, 3, 1)[inside[:, 0]]
    torch.testing.assert_close(sky, torch.tensor(voxels.EVEN).expand_as(sky))


@pytest.mark.parametrize("camera", [UP, AHEAD], ids=["up", "ahead"])
def test_a_frame_is_what_paths_find(camera: Camera):
    """Under a surface without waves and over black ground, where nothing is lit but the water itself."""
    scene, size = pool(), camera.size
    frame = render(scene, camera)
    found = path_trace(scene, camera, samples=64, antialias=False)["radiance"]
    one = direct(frame)
    assert found.shape == (1, 3, *size)
    torch.testing.assert_close(found.mean(dim=(0, 2, 3)), one.mean(dim=(0, 2, 3)), rtol=0.02, atol=0)
    close = (found - one).abs() < 0.08 * one.amax()
    assert close.float().mean() > 0.97, "but for the rim of the window, where pixels are split"


def test_walls_take_the_colour_of_the_water_over_distance():
    found = []
    for far in (2, 6, 12):
        x = 32 + far
        frame = render(pool((WALL, (x, 1, 1), (x + 1, 22, 63))), AHEAD, light_samples=0)
        g, middle = frame.gbuffer, (0, slice(None), 12, 16)
        assert g.albedo is not None
        distance = (g.camera.to_world(g.points_view())[0, :, 12, 16] - torch.tensor(EYE)).norm()
        want = 0.8 * TABLE.tint[BLUE] ** distance
        torch.testing.assert_close(g.albedo[middle], want, rtol=1e-4, atol=1e-6)
        found.append((g.albedo[middle], frame.read("radiance")[middle]))
    for (near, haze), (far, more) in itertools.pairwise(found):
        assert (far < near).all()
        assert (more > haze).all(), "haze thickens"
        assert far[2] / far[0] > near[2] / near[0], "and red goes first"


def test_no_border_shows_between_waters_of_two_kinds():
    first, second = layers(pool(), AHEAD)
    assert second is not None
    assert first.material_id is not None
    assert not (first.hit & (first.material_id == GREEN) & (first.normal[:, 1:2] > -0.5)).any()


def test_mirrors_of_the_surface_show_the_ground():
    lit = pool((WALL, (1, 16, 1), (63, 17, 63)), sun=Sun(direction=(0.0, 1.0, 0.0)))
    black = replace(lit, world=pool((BLACK, (1, 16, 1), (63, 17, 63))).world)
    over = Camera.look_at(EYE, (42.0, 25.0, 32.0), size=(24, 32), fov_y=20.0)
    bright, dark = (render(scene, over) for scene in (lit, black))
    total = bright.gbuffer.hit & (bright.gbuffer.normal[:, 1:2] < -0.5) & ~window(bright)
    assert total.float().mean() > 0.3
    more = (bright.read("radiance") - dark.read("radiance"))[total.expand(-1, 3, -1, -1)]
    assert (more > 0).all()


def test_eyes_in_the_air_see_what_they_saw_beside_one_in_water():
    scene = replace(pool(sun=Sun()), haze=Haze(begin=5.0, end=60.0), waves=Waves(amplitude=0.1))
    eyes, targets = torch.tensor([(20.0, 30.0, 20.0), EYE]), torch.tensor([(40.0, 20.0, 40.0), (42.0, 18.0, 32.0)])
    given = {"size": (24, 32), "fov_y": 70.0}
    dry, mixed = (Camera.look_at(x, targets, **given) for x in (eyes[:1].expand(2, 3), eyes))
    alone, both = (render(scene, cameras, light_samples=2) for cameras in (dry, mixed))
    for name in ("radiance", "ambient", "environment"):
        torch.testing.assert_close(both.read(name)[:1], alone.read(name)[:1], rtol=1e-6, atol=1e-8, msg=name)
    for name in alone.gbuffer.present:
        assert torch.equal(getattr(both.gbuffer, name)[:1], getattr(alone.gbuffer, name)[:1]), name


def test_waves_ripple_the_window_and_keep_its_light():
    still, waved = (render(replace(pool(), waves=w), UP) for w in (None, Waves(amplitude=0.1)))
    assert not torch.equal(window(still), window(waved))
    a, b = (direct(f).mean(dim=(0, 2, 3)) for f in (still, waved))
    torch.testing.assert_close(a, b, rtol=0.15, atol=0)


def test_passes_run_on_it():
    frame = Composite()(render(pool(), UP))
    assert torch.isfinite(frame.read("composite")).all()


@pytest.mark.parametrize("orthographic", [False, True])
def test_detail_beyond_the_surface_is_that_of_the_camera(monkeypatch: pytest.MonkeyPatch, orthographic: bool):
    """Parallel rays span as many pixels a world unit far off as near by."""
    camera = Camera.look_at(
        EYE, (32.0, 24.0, 30.5), size=(24, 32), fov_y=80.0, orthographic_height=8.0 if orthographic else None
    )
    spans = list[tuple[Tensor, Tensor]]()

    def seen(scene: Scene, hits: Hits, ways: Tensor, pixels_per_unit: Tensor, *, poses: Tensor) -> Look:
        spans.append((pixels_per_unit[hits.hit], hits.t[hits.hit]))
        return look(scene, hits, ways, pixels_per_unit, poses=poses)

    monkeypatch.setattr(frames, "look", seen)
    render(pool(), camera)
    spanned, distance = (torch.cat(parts) for parts in zip(*spans, strict=True))
    focal = camera.intrinsics[0, 1, 1]
    assert len(distance)
    assert (distance - 1).abs().min() > 0.5
    assert torch.equal(spanned, focal.expand_as(distance) if orthographic else focal / distance)


def test_parallel_rays_lose_what_their_own_way_loses():
    """The mirror overhead is as clear at the picture's border as in its middle: all rays are as long."""
    overhead = Camera.look_at(EYE, (32.0, 24.0, 32.0), up=(0.0, 0.0, 1.0), size=(24, 32), orthographic_height=24.0)
    frame = render(pool(), overhead)
    emission = frame.gbuffer.emission
    assert emission is not None
    found = emission[0][:, window(frame)[0, 0]]
    assert found.shape[1] == 24 * 32
    assert torch.allclose(found, found[:, :1].expand_as(found), rtol=1e-4)
