"""Lamps on a picture: closed forms, brute force, many faint ones, what moves."""

from __future__ import annotations

import math

import pytest
import torch
from lit import FLOOR, above, irradiance
from voxels import DARK, LAMP, STONE, TABLE, points_of, pose, world

from gbufrt import Camera
from tracer.direct import lighting
from tracer.direct.lighting import light
from tracer.gbuffers import gbuffer
from tracer.lights.form_factor import rectangle_irradiance
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Scene
from tracer.scene.world import World
from tracer.traversal.rays import trace


def test_a_lamp_in_the_ceiling_gives_the_floor_its_closed_form():
    ceiling = [(STONE, (0, 4, 0), (48, 5, 48)), (LAMP, (23, 4, 23), (25, 5, 25))]
    scene = Scene(world=world((48, 8, 48), FLOOR, *ceiling))
    g = gbuffer(scene, above((32, 32), height=3.9))
    points = points_of(g)[0].flatten(1)
    corner, u, v = (torch.tensor(t).view(3, 1, 1) for t in ((23.0, 4.0, 23.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0)))
    up = torch.tensor([[0.0], [1.0], [0.0]]).expand_as(points)
    want = rectangle_irradiance(points, up, corner, u, v)[0] * TABLE.emission[LAMP][:, None]
    assert torch.allclose(irradiance(scene, g)[0].flatten(1), want, rtol=5e-3, atol=1e-5)


def test_sampled_lamps_agree_with_brute_force_over_the_hemisphere():
    shade = (STONE, (20, 3, 20), (22, 4, 26))
    lamps = [(LAMP, (23, 5, 23), (25, 6, 24)), (LAMP, (15, 1, 30), (16, 2, 31)), (LAMP, (40, 1, 3), (43, 3, 4))]
    scene = Scene(world=world((48, 8, 48), FLOOR, shade, *lamps), sky=DARK, sun=None)
    g = gbuffer(scene, above((12, 12)))
    got = irradiance(scene, g, samples=64)
    points = points_of(g).permute(0, 2, 3, 1).reshape(-1, 1, 3) + torch.tensor([0.0, 1e-3, 0.0])
    count = 20000
    u = torch.quasirandom.SobolEngine(2).draw(count)
    radius, angle = u[:, 0].sqrt(), 2 * math.pi * u[:, 1]
    way = torch.stack([radius * angle.cos(), (1 - u[:, 0]).sqrt(), radius * angle.sin()], dim=1)
    origins = points.expand(-1, count, 3)
    hits = trace(scene, origins.contiguous(), way.expand(len(points), count, 3).contiguous())
    truth = math.pi * TABLE.emission[hits.material.long()].mean(dim=1).T.view(1, 3, 12, 12)
    floor = points_of(g)[:, 1:2].expand_as(truth) < 1.5
    assert int(floor.sum()) > 300
    error = ((got - truth) / (truth + 0.02))[floor]
    assert error.abs().mean() < 0.02
    assert error.mean().abs() < 0.005


def test_many_faint_lamps_are_not_cut_off():
    """A strong lamp is behind a wall, faint ones in the open: each is negligible, yet their mean must be right."""
    table = MaterialTable.of(
        [
            Material(name="stone", variation=0.0),
            Material(name="strong", emission=(900.0, 900.0, 900.0)),
            Material(name="faint", emission=(1.0, 1.0, 1.0)),
        ]
    )
    grid = torch.zeros(48, 8, 48, dtype=torch.int16)
    grid[:, 0] = 1
    grid[16, 1:7] = 1
    grid[14, 2, 24] = 2
    grid[20:48:6, 6, 2:48:8] = 3
    scene = Scene(world=World.from_dense(grid, table), sky=DARK, sun=None)
    g = gbuffer(scene, above((24, 24), span=8.0, height=5.0))
    got = irradiance(scene, g)
    grid[14, 2, 24] = 0
    alone = Scene(world=World.from_dense(grid, table), sky=DARK, sun=None)
    want = irradiance(alone, g)
    assert want.mean() > 0.02
    assert got.mean().item() == pytest.approx(want.mean().item(), rel=0.03)


def test_lamps_are_weighed_against_what_a_surface_emits(monkeypatch: pytest.MonkeyPatch):
    scene = Scene(world=world((48, 8, 48), FLOOR, (LAMP, (20, 1, 18), (28, 2, 30))), sky=DARK, sun=None)
    g, found = gbuffer(scene, above((24, 24))), []
    direct = lighting._direct
    monkeypatch.setattr(lighting, "_direct", lambda *given: found.append(given[2].besides) or direct(*given))
    light(scene, g)
    assert g.albedo is not None
    assert g.emission is not None
    shines, besides = g.emission[0].amax(0) > 0, found[0].view(24, 24)
    assert 0 < shines.sum() < shines.numel()
    assert besides[~shines].max() < 1e-3
    as_bright = besides / math.pi * g.albedo[0].mean(0)
    torch.testing.assert_close(as_bright[shines], g.emission[0].mean(0)[shines])


def test_a_closed_box_is_black_inside():
    grid = torch.ones(32, 16, 32, dtype=torch.int16) * STONE
    grid[2:30, 2:14, 2:30] = 0
    grid[10:13, 2:9, 10:13] = STONE
    instance = Instance(model=world((2, 2, 2), (LAMP, (0, 0, 0), (2, 2, 2))), pose=lambda t: pose((40.0, 8.0, 16.0)))
    scene = Scene(world=World.from_dense(grid, TABLE), instances=(instance,))
    camera = Camera.look_at((4.0, 12.0, 4.5), (16.0, 3.0, 15.0), size=(96, 128), fov_y=90.0)
    radiance, _ = light(scene, gbuffer(scene, camera), poses=scene.poses([0.0]))
    assert radiance.abs().max() == 0
