"""Brute force through fog where its light is known in closed form, or as a sum over lamp and ray."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

import tracer
from gbufrt import Camera
from tracer.direct.fog import segments_of
from tracer.fog.along import LampsAlong
from tracer.fog.segments import Segments, phase
from tracer.lights.emitters import lamps_of
from tracer.lights.lamp_table import LampTable

EXTINCTION = 0.05
NONE = torch.zeros(0, 4, 4)


def scene(sun=None, level=0.0, lamps=0, **fog) -> tracer.Scene:
    """A row of voxels along z from the origin on, of which some may be lamps; a sky of one colour; and fog."""
    dark = tracer.Material(name="dark", albedo=(0.0, 0.0, 0.0))
    table = tracer.MaterialTable.of([dark, tracer.Material(name="lamp", emission=(40.0, 30.0, 20.0))])
    voxels = torch.zeros(3, 3, 12, dtype=torch.int16)
    voxels[1, 1, 1] = 1
    voxels[1, 1, 1 : 1 + 2 * lamps : 2] = 2
    world = tracer.World.from_dense(voxels, table, origin=(-1, -1, -1))
    sky = tracer.Sky(picture=torch.full((1, 3, 4, 8), level))
    return tracer.Scene(world=world, sun=sun, sky=sky, fog=tracer.Fog(extinction=EXTINCTION, **fog))


def seen(made: tracer.Scene, eye: tuple[float, float, float], target: tuple[float, float, float], span: float = 3.0):
    """The G-buffer of an orthographic camera, whose rays are alike, and its rays."""
    camera = Camera.look_at(eye, target, size=(6, 10), orthographic_height=span, far=20.0)
    gbuffer = tracer.gbuffer(made, camera)
    return gbuffer, segments_of(gbuffer, 0)


def rows(fog: torch.Tensor) -> torch.Tensor:
    return fog[0].flatten(1).T


def test_open_sun_and_even_sky_are_known():
    sun = tracer.Sun(direction=(0.3, 1.0, 0.2), irradiance=(3.0, 2.0, 1.0), angular_radius=0.27)
    made = scene(sun, 0.5, albedo=(0.9, 0.8, 0.7), anisotropy=0.5)
    gbuffer, rays = seen(made, (-8.0, 6.0, 0.5), (0.0, 6.0, 0.5))
    found = tracer.fog_truth(made, gbuffer, steps=64)
    toward = torch.nn.functional.normalize(torch.tensor(sun.direction), dim=0)
    assert made.fog is not None
    share = phase(made.fog, rays.directions @ toward)[:, None]
    share = share * torch.tensor(sun.irradiance) + 0.5
    taken = 1 - (-EXTINCTION * rays.length()).exp()
    wanted = share * taken[:, None] * torch.tensor(made.fog.albedo)
    torch.testing.assert_close(rows(found["fog"]).mean(0), wanted.mean(0), rtol=0.005, atol=0)
    torch.testing.assert_close(rows(found["fog"]), wanted, rtol=0.06, atol=0)
    torch.testing.assert_close(found["fog_transmittance"].flatten(), 1 - taken)


def test_shadow_is_left_out():
    sun = tracer.Sun(direction=(0.0, 1.0, 0.0), irradiance=(3.0, 3.0, 3.0), angular_radius=0.0)
    made = scene(sun, anisotropy=0.0, albedo=(1.0, 1.0, 1.0))
    gbuffer, rays = seen(made, (-8.0, -2.0, 0.5), (0.0, -2.0, 0.5), span=0.5)
    found = tracer.fog_truth(made, gbuffer, steps=256)
    lit = torch.tensor([0.0, 8.0, 9.0, 20.0])  # under the voxel, between 8 and 9 units away, it is dark
    first, last = (-EXTINCTION * lit).exp().view(2, 2).unbind(dim=1)
    wanted = 3 / (4 * math.pi) * (first - last).sum()
    torch.testing.assert_close(rows(found["fog"]), wanted.expand(len(rays.begin), 3), rtol=0.01, atol=0)


def from_lamps(made: tracer.Scene, rays: Segments, steps: int = 150, side: int = 8) -> torch.Tensor:
    """A sum over even steps and even points of every face; nothing stands between."""
    assert made.fog is not None
    table = LampTable.of(lamps_of(made, NONE), (0, 0, 0), (1, 1, 1))
    total, even = torch.zeros(len(rays.begin), 3), (torch.arange(side) + 0.5) / side
    for k in range(steps):
        t = rays.begin + rays.length() * (k + 0.5) / steps
        points = rays.points(t)
        for corner, u, v, facing, area, radiance in zip(
            table.corner, table.edge_u, table.edge_v, table.facing, table.area, table.radiance, strict=True
        ):
            spots = (corner + even[:, None, None] * u + even[:, None] * v).view(-1, 3)
            away = spots - points[:, None]
            far = away.norm(dim=2)
            ways = away / far[..., None]
            share = phase(made.fog, (ways * rays.directions[:, None]).sum(2)) * (-ways @ facing).clamp_min(0)
            share = (share * (-EXTINCTION * (far + t[:, None])).exp() / far.square()).mean(dim=1) * area
            total += share[:, None] * radiance * (EXTINCTION * rays.length() / steps)[:, None]
    return total * torch.tensor(made.fog.albedo)


@pytest.mark.parametrize("anisotropy", [0.0, 0.7])
def test_lamp_is_the_sum_over_its_faces(anisotropy):
    made = scene(lamps=1, anisotropy=anisotropy)
    gbuffer, rays = seen(made, (-6.0, 2.5, 0.5), (0.0, 1.5, 0.5), span=0.5)
    found = tracer.fog_truth(made, gbuffer, steps=256)["fog"]
    wanted = from_lamps(made, rays)
    torch.testing.assert_close(rows(found).mean(0), wanted.mean(0), rtol=0.02, atol=0)
    torch.testing.assert_close(rows(found), wanted, rtol=0.15, atol=0)


def test_few_of_many_lamps_stand_for_all(monkeypatch: pytest.MonkeyPatch):
    made = scene(lamps=5)
    _, rays = seen(made, (-6.0, 3.0, 3.5), (0.0, 1.5, 3.5))
    table = LampTable.of(lamps_of(made, NONE), (0, 0, 0), (1, 1, 1))
    assert made.fog is not None
    monkeypatch.setattr("tracer.fog.along.CANDIDATES", 3)
    some, every = [], []
    generator = torch.Generator().manual_seed(1)
    known = LampsAlong.of(table, rays, made.fog)
    for _ in range(300):
        u = torch.rand(5, len(rays.begin), generator=generator)
        some.append(LampsAlong.of(table, rays, made.fog, u[4]).draw(u[:4]).light.mean(0))
        every.append(known.draw(u[:4]).light.mean(0))
    torch.testing.assert_close(torch.stack(some).mean(0), torch.stack(every).mean(0), rtol=0.03, atol=0)


def test_lamps_have_a_chance_on_rays_that_share_weights():
    made = scene(lamps=3, anisotropy=0.0)
    _, rays = seen(made, (-6.0, 2.5, 2.5), (0.0, 1.5, 2.5), span=1.0)
    first = torch.arange(len(rays.end)) % 10 == 0  # the first of ten turns away from what the others see
    away = torch.where(first[:, None], torch.tensor([-1.0, 0.0, 0.0]), rays.directions)
    rays = replace(rays, directions=away, end=torch.where(first, 2.0, 20.0))
    table = LampTable.of(lamps_of(made, NONE), (0, 0, 0), (1, 1, 1))
    assert made.fog is not None
    own = LampsAlong.of(table, rays, made.fog)
    shared = LampsAlong.of(table, rays, made.fog, alike=torch.arange(len(rays.end)) // 10)
    u = torch.rand(4, 2000 * len(rays.end), generator=torch.Generator().manual_seed(1))
    found, wanted = (along.draw(u).light.mean(0) for along in (shared, own))
    torch.testing.assert_close(found, wanted, rtol=0.02, atol=0)


def test_places_drawn_at_once_are_those_drawn_apart():
    made = scene(lamps=3)
    _, rays = seen(made, (-6.0, 2.5, 2.5), (0.0, 1.5, 2.5))
    table = LampTable.of(lamps_of(made, NONE), (0, 0, 0), (1, 1, 1))
    assert made.fog is not None
    along, u = LampsAlong.of(table, rays, made.fog), torch.rand(4, 3 * len(rays.end))
    found = along.draw(u)
    each = [along.draw(part) for part in u.split(len(rays.end), dim=1)]
    torch.testing.assert_close(found.light, torch.cat([one.light for one in each]))
    torch.testing.assert_close(found.away, torch.cat([one.away for one in each]))


def test_what_cannot_be_marched_is_named():
    made = scene()
    gbuffer, _ = seen(made, (-8.0, 6.0, 0.5), (0.0, 6.0, 0.5))
    with pytest.raises(ValueError, match="must have fog"):
        tracer.fog_truth(replace(made, fog=None), gbuffer)
    with pytest.raises(ValueError, match="steps"):
        tracer.fog_truth(made, gbuffer, steps=0)
