"""Light through coloured glass: direct light, reflections and the path tracer tint it alike, and two panes multiply."""

from __future__ import annotations

import math

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera
from gbufrt.specular import DIELECTRIC_F0, schlick
from tracer import path_trace, reflection
from tracer.frames import render
from tracer.gbuffers import gbuffer
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene, Sky, Sun
from tracer.scene.world import World

TABLE = MaterialTable.of(
    [
        Material(name="chalk", albedo=(0.8, 0.8, 0.8), roughness=1.0, variation=0.0),
        Material(name="red", albedo=(0.0, 0.0, 0.0), opacity=0.2, tint=(0.9, 0.3, 0.1), roughness=0.0),
        Material(name="blue", albedo=(0.0, 0.0, 0.0), opacity=0.3, tint=(0.2, 0.5, 0.95), roughness=0.0),
        Material(name="lamp", emission=(6.0, 5.0, 4.0), variation=0.0),
        Material(name="mirror", albedo=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.0, variation=0.0),
    ]
)
CHALK, RED, BLUE, LAMP, MIRROR = range(1, 6)
PANES = {"none": (), "red": (RED,), "both": (RED, BLUE), "twice": (RED, RED)}
BLACK = Sky(picture=torch.zeros(1, 3, 4, 8))  # without the glow round the sun, whose ways through glass differ
SUN = Sun(direction=(0.3, 1.0, 0.2), angular_radius=0.1)


def room(panes: tuple[int, ...], *, floor: int = CHALK, lamp: bool, sun: Sun | None) -> Scene:
    """A floor whose top is at 1, panes a voxel thick over it, and a lamp over those."""
    grid = torch.zeros(24, 16, 24, dtype=torch.int16)
    grid[:, 0] = floor
    for number, pane in enumerate(panes):
        grid[:, 5 + 3 * number] = pane
    if lamp:
        grid[10:14, 13, 10:14] = LAMP
    return Scene(world=World.from_dense(grid, TABLE), sun=sun, sky=BLACK)


def camera(fov: float = 20.0) -> Camera:
    """Below all panes, straight down on the floor's middle."""
    return Camera.look_at((12.0, 3.5, 12.0), (12.0, 1.0, 12.0), size=(6, 6), fov_y=fov, up=(0.0, 0.0, -1.0))


def mean(picture: Tensor) -> Tensor:
    """``(3,)`` of all pixels."""
    return picture[0].flatten(1).mean(dim=1)


def passed(panes: tuple[int, ...], cosine: Tensor) -> Tensor:
    """``(3,)`` that panes let through at a cosine."""
    each = [
        (1 - TABLE.opacity[p]) * TABLE.tint[p] ** (1 / cosine) * (1 - schlick(cosine, DIELECTRIC_F0)) for p in panes
    ]
    return torch.stack(each).prod(dim=0) if each else torch.ones(3)


@pytest.mark.parametrize("panes", PANES.values(), ids=PANES.keys())
def test_the_sun_through_panes_is_tinted_in_direct_light_and_by_the_path_tracer(panes: tuple[int, ...]):
    cosine = F.normalize(torch.tensor(SUN.direction), dim=0)[1]
    wanted = 0.8 / math.pi * torch.tensor(SUN.irradiance) * cosine * passed(panes, cosine)
    bare, scene = (room(p, lamp=False, sun=SUN) for p in ((), panes))
    direct = render(scene, camera()).read("radiance")[0].flatten(1)
    torch.testing.assert_close(direct, wanted[:, None].expand_as(direct), rtol=5e-3, atol=0)
    traced = [mean(path_trace(s, camera(), samples=16, bounces=1)["radiance"]) for s in (bare, scene)]
    torch.testing.assert_close(traced[1] / traced[0], passed(panes, cosine), rtol=5e-3, atol=0)


@pytest.mark.parametrize("panes", PANES.values(), ids=PANES.keys())
def test_a_lamp_through_panes_is_tinted_in_direct_light_and_by_the_path_tracer(panes: tuple[int, ...]):
    bare, scene = (room(p, lamp=True, sun=None) for p in ((), panes))
    direct = [mean(render(s, camera(), light_samples=16).read("radiance")) for s in (bare, scene)]
    traced = [mean(path_trace(s, camera(), samples=256, bounces=1)["radiance"]) for s in (bare, scene)]
    torch.testing.assert_close(direct[1] / direct[0], traced[1] / traced[0], rtol=0.02, atol=0)
    torch.testing.assert_close(direct[1] / direct[0], passed(panes, torch.tensor(0.99)), rtol=0.05, atol=0)


@pytest.mark.parametrize("panes", PANES.values(), ids=PANES.keys())
def test_a_lamp_through_panes_is_tinted_in_a_mirror(panes: tuple[int, ...]):
    scene, seen = room(panes, floor=MIRROR, lamp=True, sun=None), camera(4.0)
    wanted = TABLE.emission[LAMP] * passed(panes, torch.tensor(1.0))
    mirrored = mean(reflection(scene, gbuffer(scene, seen), samples=512)["reflection"])
    traced = mean(path_trace(scene, seen, samples=512, bounces=1)["radiance"])
    torch.testing.assert_close(mirrored, wanted, rtol=0.02, atol=0)
    torch.testing.assert_close(traced, wanted, rtol=0.02, atol=0)


@pytest.mark.parametrize("panes", PANES.values(), ids=PANES.keys())
def test_a_lamp_behind_panes_is_tinted_before_the_camera(panes: tuple[int, ...]):
    """What the layers hold together is what the path tracer sees."""
    scene = room(panes, lamp=True, sun=None)
    up = Camera.look_at((12.0, 3.5, 12.0), (12.0, 13.0, 12.0), size=(6, 6), fov_y=4.0, up=(0.0, 0.0, -1.0))
    frame = render(scene, up)
    shown, g = frame.read("radiance"), frame.gbuffer
    if frame.behind is not None and panes:
        assert g.transmittance is not None
        shown = shown + g.transmittance * frame.behind.read("radiance")
    each = [(1 - TABLE.opacity[p]) * TABLE.tint[p] for p in panes]
    wanted = TABLE.emission[LAMP] * (torch.stack(each).prod(dim=0) if each else 1.0)
    found = shown[0].flatten(1)
    torch.testing.assert_close(found, wanted[:, None].expand_as(found), rtol=5e-3, atol=0)
    traced = mean(path_trace(scene, up, samples=512, bounces=1)["radiance"])
    torch.testing.assert_close(traced, TABLE.emission[LAMP] * passed(panes, torch.tensor(1.0)), rtol=0.04, atol=0)
