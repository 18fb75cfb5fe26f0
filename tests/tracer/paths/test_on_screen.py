"""Which part of path-traced pictures came by on-screen surfaces."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
import torch
from voxels import DARK, above, pose, random_scene

from gbufrt import Camera
from tracer.gbuffers import gbuffer
from tracer.paths import op as path_ops
from tracer.paths import radiance as path_radiance
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Scene, Sky, Sun
from tracer.scene.world import World
from tracer.truth.truth import path_trace


def test_the_part_that_came_by_on_screen_surfaces():
    """A floor in front of a white wall. With the wall on screen, all of its light came by on-screen surfaces; alone,
    the sky's and the sun's, and what the wall sends is left out."""
    table = MaterialTable.of(
        [Material(name="floor", albedo=(0.5, 0.5, 0.5), variation=0.0), Material(name="wall", albedo=(0.9, 0.5, 0.2))]
    )
    voxels = torch.zeros(48, 24, 48, dtype=torch.int16)
    voxels[:, 0], voxels[:, :, 20] = 1, 2
    scene = Scene(world=World.from_dense(voxels, table), sun=Sun(direction=(0.2, 0.8, 0.6)))
    given = {"size": (9, 12), "fov_y": 20.0}
    floor_alone = Camera.look_at((24, 10, 44), (24, 1, 32), **given)
    found = path_trace(scene, floor_alone, bounces=1, samples=256, antialias=False)
    straight = path_trace(scene, floor_alone, bounces=0, samples=256, antialias=False)
    light, onscreen = found["radiance"], found["radiance_onscreen"]
    lost = (light - onscreen).mean(dim=(0, 2, 3))
    assert (lost / light.mean(dim=(0, 2, 3)) > 0.03).all()
    assert lost[0] > 2 * lost[2] * (light.mean(dim=(0, 2, 3)) / light.mean())[2]  # of the wall's colour
    assert abs(float(onscreen.mean() / straight["radiance"].mean()) - 1) < 0.02
    both = Camera.look_at((24, 12, 47), (24, 9, 20), size=(27, 36), fov_y=80.0)
    found = path_trace(scene, both, bounces=1, samples=64, antialias=False)
    g = gbuffer(scene, both)
    near = g.hit & (g.normal[:, 1:2] > 0.9) & ((both.to_world(g.points_view())[:, :1] - 24).abs() < 6)
    assert int(near.sum()) > 20
    assert (found["radiance_onscreen"] * near).sum() > 0.985 * (found["radiance"] * near).sum()


def test_what_is_in_sight_is_that_of_each_picture_at_its_time():
    scene = random_scene(2)
    at_time = lambda t: Camera.look_at([(25.0 - 9 * t, 18.0, 22.0), (-25.0, 12.0 + t, 8.0)], (0, 4, 0), size=(9, 12))
    both = path_trace(scene, at_time, time=[0.0, 1.0], shutter_offset=0.5, samples=16)
    for b, time in enumerate((0.5, 1.5)):
        eye = [(25.0 - 9 * time, 18.0, 22.0), (-25.0, 12.0 + time, 8.0)][b]
        one = path_trace(scene, Camera.look_at(eye, (0, 4, 0), size=(9, 12)), time=time, samples=16)
        for name in ("radiance", "radiance_onscreen"):
            assert torch.allclose(both[name][b : b + 1], one[name], rtol=1e-3, atol=1e-4)


BLACK: dict[str, Any] = {"albedo": (0.0, 0.0, 0.0), "metallic": 1.0, "roughness": 1.0, "variation": 0.0}
SHINING = MaterialTable.of(
    [
        Material(name="red", emission=(4.0, 0.0, 0.0), **BLACK),
        Material(name="blue", emission=(0.0, 0.0, 4.0), **BLACK),
        Material(name="glass", opacity=0.2, roughness=0.0),
        Material(name="mirror", albedo=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.0, variation=0.0),
    ]
)
RED, BLUE, GLASS, MIRROR = 1, 2, 3, 4
BLUE_SKY = Sky(zenith=(0.0, 0.0, 4.0), horizon=(0.0, 0.0, 4.0), ground=(0.0, 0.0, 4.0))
LIGHT: dict[str, dict[str, Any]] = {"all light": {"bounces": 0}, "unblocked light": {"unblocked": True}}


def shining(size: tuple[int, int, int], *boxes: tuple[int, tuple[int, int, int], tuple[int, int, int]]) -> World:
    voxels = torch.zeros(size, dtype=torch.int16)
    for which, low, high in boxes:
        voxels[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = which
    return World.from_dense(voxels, SHINING)


@pytest.mark.parametrize("light", LIGHT)
@pytest.mark.parametrize("behind", ["wall", "sky"])
def test_a_lens_sees_round_an_edge_what_the_pinhole_does_not(behind: str, light: str):
    """A red slab hides the left half of what is blue and in focus: the slab's blur, before the hidden half, shows some
    of it."""
    slab, wall = (RED, (0, 0, 20), (24, 24, 21)), (BLUE, (0, 0, 40), (48, 24, 41))
    boxes, focus = ((slab, wall), 40.0) if behind == "wall" else ((slab,), 1e4)
    scene = Scene(world=shining((48, 24, 42), *boxes), sun=None, sky=DARK if behind == "wall" else BLUE_SKY)
    camera = Camera.look_at((24, 12, 0), (24, 12, 40), size=(128, 192), fov_y=40.0)
    found = path_trace(scene, camera, samples=16, aperture_radius=2.0, focus_distance=focus, **LIGHT[light])
    x = camera.to_world(camera.unproject(torch.full((1, 1, *camera.size), 40.0)))[0, 0, 64] - 24
    inner = x.abs() < 16  # the lens gathers from beyond the border, too
    total, onscreen = (found[name][0, :, 48:80, inner].mean(dim=1) for name in ("radiance", "radiance_onscreen"))
    x, pixel = x[inner], float((x[1] - x[0]).abs())
    hidden, open_ = x < -2 * pixel, x > 2 * pixel
    assert (total[2, hidden] > 0.1).sum() >= 5
    assert onscreen[2, hidden].max() < 0.02
    assert torch.allclose(onscreen[2, open_], total[2, open_], atol=0.02)
    lost = (total - onscreen)[0].clamp_min(0)  # some of the slab's side, which is edge-on to the pinhole
    assert lost.sum() < 0.01 * total[0].sum()


@pytest.mark.parametrize("light", LIGHT)
def test_a_shutter_uncovers_what_a_mover_hides(light: str):
    """A red box crosses a blue floor: the box is known wherever it goes, the floor except where the box was when the
    picture was taken."""
    box = shining((2, 2, 2), (RED, (0, 0, 0), (2, 2, 2)))
    mover = Instance(model=box, pose=lambda t: pose((19.0 + 8 * t, 3.0, 23.0)))
    scene = Scene(world=shining((48, 2, 48), (BLUE, (0, 0, 0), (48, 1, 48))), instances=(mover,), sun=None, sky=DARK)
    given = {"samples": 64, "shutter": 1.0, "shutter_offset": -0.5, **LIGHT[light]}
    found = path_trace(scene, above(size=(32, 192), span=8.0), time=0.5, **given)
    total, onscreen = (found[name][0, :, 13:19].mean(dim=1) for name in ("radiance", "radiance_onscreen"))
    x = torch.arange(192) / 4 + 0.125
    hidden = (x > 23.5) & (x < 24.5)  # the box is at 23 to 25 then, and its edges show the floor beside them
    assert total[2, hidden].min() > 2.0
    assert onscreen[2, hidden].max() < 0.02
    away = (x < 22.5) | (x > 25.5)
    assert torch.allclose(onscreen[2, away], total[2, away], atol=0.02)
    assert float(total[0, away].sum()) > 0.6 * float(total[0].sum()) > 0
    assert torch.allclose(onscreen[0], total[0], atol=0.02)


@pytest.mark.parametrize("form", [path_radiance, path_ops])
def test_a_mover_in_a_mirror_is_known_where_it_was(form: ModuleType, monkeypatch: pytest.MonkeyPatch):
    """The side of a red box that a mirror shows is on screen, and stays so while the box goes by."""
    box = shining((2, 6, 6), (RED, (0, 0, 0), (2, 6, 6)))
    mover = Instance(model=box, pose=lambda t: pose((20.0, 4.0, 14.0 + 12 * t)))
    scene = Scene(world=shining((24, 14, 48), (MIRROR, (0, 0, 0), (1, 14, 48))), instances=(mover,), sun=None, sky=DARK)
    monkeypatch.setattr("tracer.truth.path_tracer.radiance", form.radiance)
    camera = Camera.look_at((9, 7, 0), (9, 7, 20), size=(60, 80), fov_y=100.0)
    found = path_trace(scene, camera, time=0.5, samples=32, bounces=1, shutter=0.5, shutter_offset=-0.25)
    total, onscreen = (found[name][0, 0, :, 40:] for name in ("radiance", "radiance_onscreen"))
    assert float(total.sum()) > 100
    assert float(onscreen.sum() / total.sum()) > 0.97


def test_a_moving_camera_brings_in_what_was_beyond_the_border():
    scene = Scene(world=shining((48, 2, 48), (BLUE, (0, 0, 0), (48, 1, 48))), sun=None, sky=DARK)

    def camera(t: float) -> Camera:
        eye = (20.0 + 4 * t, 30.0, 24.0)
        return Camera.look_at(eye, (eye[0], 0, 24), size=(8, 16), up=(0.0, 0.0, -1.0), orthographic_height=8.0)

    given = {"shutter": 1.0, "shutter_offset": -1.0, "unblocked": True}
    found = path_trace(scene, camera, time=1.0, samples=64, **given)  # four units to the right until then
    want = ((torch.arange(16) + 0.5) / 4).clamp(max=1.0)
    assert torch.allclose(found["radiance"], torch.tensor([0.0, 0.0, 4.0]).view(1, 3, 1, 1).expand(1, 3, 8, 16))
    assert (found["radiance_onscreen"][0, 2].mean(dim=0) / 4 - want).abs().max() < 0.03


def test_what_shows_through_glass_in_sight_is_known():
    boxes = (GLASS, (0, 0, 10), (48, 24, 11)), (BLUE, (0, 0, 20), (48, 24, 21))
    scene = Scene(world=shining((48, 24, 22), *boxes), sun=None, sky=DARK)
    camera = Camera.look_at((24, 12, 0), (24, 12, 20), size=(24, 24), fov_y=40.0)
    found = path_trace(scene, camera, bounces=0, samples=16, aperture_radius=0.3, focus_distance=10.0)
    assert found["radiance"].mean(dim=(0, 2, 3))[2] > 1.5
    assert torch.equal(found["radiance_onscreen"], found["radiance"])


def test_a_lens_and_a_shutter_next_to_none_leave_the_pinholes_picture():
    scene = random_scene(2)
    camera = Camera.look_at((25.0, 18.0, 22.0), (0, 4, 0), size=(18, 24))
    given: dict[str, Any] = {"time": 0.3, "samples": 16, "antialias": False}
    want = path_trace(scene, camera, **given)
    least: dict[str, Any]
    for least in ({"aperture_radius": 1e-5, "focus_distance": 20.0}, {"shutter": 1e-6}):
        got = path_trace(scene, camera, **given, **least)
        for name in ("radiance", "radiance_onscreen"):
            assert ((got[name] - want[name]).abs() > 0.02 + 0.02 * want[name]).float().mean() < 0.02
    lost = []
    for size in ((36, 48), (144, 192)):  # no more than on edges finer than the picture
        camera = Camera.look_at((25.0, 18.0, 22.0), (0, 4, 0), size=size)
        fine = path_trace(scene, camera, time=0.3, samples=4, unblocked=True, aperture_radius=1e-5)
        lost.append(float(1 - (fine["radiance_onscreen"] / fine["radiance"]).mean()))
    assert lost[1] < 0.5 * lost[0] < 0.05
