"""Truth of indirect light: furnaces, closed rooms, energy, and what the picture shows of it."""

from __future__ import annotations

import math

import torch
from voxels import DARK, EVEN_SKY, STONE, points_of, world
from walls import WALL, WHITE, above, albedo_of, corner

from gbufrt import Camera
from tracer.gbuffers import gbuffer
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene, Sun
from tracer.scene.world import World
from tracer.truth.truth import ambient_occlusion, indirect_diffuse


def test_a_white_furnace_stays_as_bright_as_its_sky():
    voxels = torch.rand(20, 12, 20, generator=torch.Generator().manual_seed(3)) < 0.04
    scene = Scene(world=World.from_dense(voxels.short(), WHITE), sun=None, sky=EVEN_SKY)
    g = gbuffer(scene, Camera.look_at((40, 20, 30), (10, 6, 10), size=(16, 16), fov_y=20.0))
    light = indirect_diffuse(scene, g, bounces=12, samples=64)
    got = (light["gi"] + light["sky"]) / torch.tensor(EVEN_SKY.zenith).view(1, 3, 1, 1)
    assert g.hit.float().mean() > 0.4
    assert light["sky_visibility"][g.hit].mean() < 0.9
    assert (got[g.hit.expand_as(got)] - 1).abs().mean() < 0.001


def test_light_in_a_closed_room_of_lamps_adds_up_to_the_geometric_series():
    share, emission = 0.5, 2.0
    lamp = Material(name="lamp", albedo=(share, share, share), emission=(emission, emission, emission), variation=0.0)
    shell = torch.ones(8, 6, 7, dtype=torch.int16)
    shell[1:-1, 1:-1, 1:-1] = 0
    scene = Scene(world=World.from_dense(shell, MaterialTable.of([lamp])))
    g = gbuffer(scene, Camera.look_at((2, 4, 3), (6, 2, 4.2), size=(24, 24)))
    for bounces in (1, 3):
        gi = indirect_diffuse(scene, g, bounces=bounces, samples=64)["gi"].mean()
        want = emission * sum(share**k for k in range(2, bounces + 2))
        assert abs(float(gi) - want) < 0.02 * want


def test_sunlight_reflected_by_a_wall_is_energy_that_arrived_there(monkeypatch):
    monkeypatch.setattr("tracer.lights.sky.GLOW", ())
    scene = corner(height=24, sky=DARK)
    scene = Scene(world=scene.world, sky=DARK, sun=Sun(direction=(-1.0, 0.0, 0.0), irradiance=(2.0, 3.0, 4.0)))
    g = gbuffer(scene, above(WALL - 3.0, 48.0))
    light = indirect_diffuse(scene, g, samples=256)
    x = WALL - points_of(g)[:, :1]
    visible = 0.5 * (1 - x / (x * x + 24.0**2).sqrt())  # form factor of a long wall 24 high
    want = albedo_of(g) * visible * 0.8 / math.pi * torch.tensor([2.0, 3.0, 4.0]).view(1, 3, 1, 1)
    assert light["sky"].max() == 0
    assert (light["gi"] / want - 1).mean().abs() < 0.02


def test_seen_is_what_the_picture_shows():
    scene = Scene(world=corner(height=6).world, sun=Sun(direction=(-1.0, 1.0, 0.1)))
    whole = gbuffer(scene, Camera.look_at((20, 12, 48), (30, 2, 48), size=(64, 64), fov_y=70.0))
    near = whole.hit & (WALL - points_of(whole)[:, :1] < 2) & (points_of(whole)[:, 1:2] < 1.01)
    ao, light = ambient_occlusion(scene, whole, samples=32), indirect_diffuse(scene, whole, samples=32)
    assert near.sum() > 50
    assert ao["ao"][near].mean() < 0.8
    assert (ao["ao_onscreen"] - ao["ao"])[near].mean() < 0.01
    assert (light["gi_onscreen"] / light["gi"])[near.expand(-1, 3, -1, -1)].mean() > 0.9
    floor = gbuffer(scene, above(WALL - 1.5, 48.0, span=1.5))
    ao, light = ambient_occlusion(scene, floor, samples=32), indirect_diffuse(scene, floor, samples=32)
    assert ao["ao"].min() < 0.8
    assert ao["ao_onscreen"].min() == 1
    assert light["gi"].min() > 0
    assert light["gi_onscreen"].max() == 0


def test_the_back_of_what_the_picture_shows_is_not_seen():
    slab = (STONE, (20, 2, 0), (24, 3, 48))
    scene = Scene(world=world((48, 4, 48), (STONE, (0, 0, 0), (48, 1, 48)), slab), sun=None)
    g = gbuffer(scene, above(19.0, 24.0, span=1.0))
    found = ambient_occlusion(scene, g, radius=8.0, samples=64)
    assert found["ao"].mean() < 0.9
    assert found["ao_onscreen"].min() == 1  # the slab's underside and side do not face the camera
