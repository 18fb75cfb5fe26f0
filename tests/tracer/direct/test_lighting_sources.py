"""Unoccluded light of the sources, and which lamps a world has."""

from __future__ import annotations

import math

import pytest
import torch
import torch.nn.functional as F
from voxels import GLASS, LAMP, STONE, TABLE, pose, world

from tracer.direct.kernel import rectangle_irradiance as rectangle_irradiance_of_one
from tracer.lights.emitters import MANY, lamps_of, lamps_of_world
from tracer.lights.form_factor import disc_cosine, dot, rectangle_irradiance
from tracer.scene.scene import MASK_ALL, MASK_SECONDARY, Instance, Scene
from tracer.scene.world import World


def planes(*rows: tuple[float, float, float]) -> torch.Tensor:
    return torch.tensor(rows).T


def test_a_square_above_a_point_matches_the_closed_form():
    """Configuration factor C-11 of Howell's catalogue: a rectangle with one corner on the point's normal."""
    x, y, height = 2.0, 3.0, 1.5
    got = rectangle_irradiance(
        planes((0.0, 0.0, 0.0)),
        planes((0.0, 1.0, 0.0)),
        planes((0.0, height, 0.0))[:, :, None],
        planes((x, 0.0, 0.0))[:, :, None],
        planes((0.0, 0.0, y))[:, :, None],
    )
    a, b = x / height, y / height
    ra, rb = math.sqrt(1 + a * a), math.sqrt(1 + b * b)
    factor = (a / ra * math.atan(b / ra) + b / rb * math.atan(a / rb)) / (2 * math.pi)
    assert got.item() == pytest.approx(math.pi * factor, rel=1e-5)


def test_rectangles_match_quadrature_where_the_horizon_cuts_them_and_behind():
    g = torch.Generator().manual_seed(0)
    points = torch.randn(3, 60, generator=g) * 1.5
    normals = F.normalize(torch.randn(3, 60, generator=g), dim=0)
    corner, u, v = (planes(p) for p in ((0.2, -0.4, 0.1), (0.0, 1.0, 0.5), (1.5, 0.0, 0.0)))
    got = rectangle_irradiance(points, normals, corner[:, :, None], u[:, :, None], v[:, :, None])[0]
    s = (torch.arange(200, dtype=torch.float64) + 0.5) / 200
    spot = corner[:, :, None] + u[:, :, None] * s[None, :, None] + v[:, :, None] * s
    way = spot.reshape(3, 1, -1) - points[:, :, None].double()
    outward = torch.linalg.cross(u, v, dim=0)[:, :, None].double()
    cosines = dot(normals[:, :, None].double(), way).clamp_min(0) * dot(-outward, way).clamp_min(0)
    truth = (cosines / dot(way, way) ** 2).mean(dim=-1)
    assert torch.allclose(got.double(), truth, atol=2e-4, rtol=2e-3)
    below = (dot(normals[:, :, None].double(), way) < 0).any(1) & (truth > 0)
    assert int(below.sum()) > 3
    assert int((truth == 0).sum()) > 20
    assert (got[truth == 0] < 1e-6).all()


def test_a_series_gives_far_rectangles_the_light_of_the_closed_form():
    g = torch.Generator().manual_seed(0)
    cases = 0
    for _ in range(300):
        corner, normal, way, u, v = F.normalize(torch.randn(5, 3, generator=g).double(), dim=1)
        u, v = u * 1.5, torch.linalg.cross(u, v)
        diagonal, away = (u @ u + v @ v).sqrt(), 6.1 + 10 * torch.rand((), generator=g).double()
        point = corner + (u + v) / 2 + way * diagonal * away
        facing = torch.linalg.cross(u, v)
        table = torch.cat([corner, u, v, facing, (facing @ corner)[None]])[None].numpy()
        got = rectangle_irradiance_of_one(table, 0, tuple(point.tolist()), tuple(normal.tolist()))
        columns = [x[:, None] for x in (point, normal)] + [x[:, None, None] for x in (corner, u, v)]
        want = rectangle_irradiance(*columns).item()
        assert got == pytest.approx(want, abs=2e-5 * (facing.norm() / (diagonal * away) ** 2).item())
        cases += want > 0
    assert cases > 60


def test_a_setting_disc_matches_quadrature():
    sine = 0.05
    radius, angle = torch.meshgrid(
        (torch.arange(400) + 0.5) / 400, torch.arange(400) / 400 * 2 * math.pi, indexing="ij"
    )
    offset = radius * angle.sin() * sine
    for cosine in (-0.06, -0.03, 0.0, 0.02, 0.049, 0.3):
        truth = ((cosine + offset).clamp_min(0) * radius).sum() / radius.sum()
        assert disc_cosine(torch.tensor(cosine), sine).item() == pytest.approx(truth.item(), abs=1e-5)
    assert disc_cosine(torch.tensor(0.5), 0.0).item() == 0.5


def test_a_lone_block_is_one_lamp_of_six_outward_squares():
    lamps = lamps_of_world(world((20, 20, 20), (LAMP, (5, 6, 7), (6, 7, 8)), origin=(-10, 0, 0)))
    outward = torch.linalg.cross(lamps.edge_u, lamps.edge_v)[0]
    assert len(lamps) == 1
    assert torch.equal(outward.sum(0), torch.zeros(3))
    assert torch.equal(outward.norm(dim=1), torch.ones(6))
    center = torch.tensor([-4.5, 6.5, 7.5])
    middle = (lamps.corner + lamps.edge_u / 2 + lamps.edge_v / 2)[0]
    assert torch.allclose(middle - center, outward / 2)
    assert torch.allclose(lamps.center[0], center)
    assert lamps.radius.item() == pytest.approx(math.sqrt(3) / 2)
    assert torch.equal(lamps.radiance[0], TABLE.emission[LAMP])


def test_only_exposed_faces_shine():
    buried = world((8, 8, 8), (STONE, (0, 0, 0), (8, 8, 8)), (LAMP, (3, 3, 3), (5, 4, 4)))
    assert len(lamps_of_world(buried)) == 0
    flush = world((8, 8, 8), (STONE, (0, 0, 0), (8, 4, 8)), (LAMP, (3, 3, 3), (5, 4, 4)))
    lamps = lamps_of_world(flush)
    areas = torch.linalg.cross(lamps.edge_u, lamps.edge_v)
    assert torch.equal(areas.sum((0, 1)), torch.tensor([0.0, 2.0, 0.0]))
    covered = world(
        (8, 8, 8), (STONE, (0, 0, 0), (8, 4, 8)), (LAMP, (3, 3, 3), (4, 4, 4)), (GLASS, (3, 4, 3), (4, 5, 4))
    )
    assert len(lamps_of_world(covered)) == 1


def test_total_area_survives_merging_and_lamps_stay_few():
    g = torch.Generator().manual_seed(3)
    voxels = (torch.rand(40, 12, 40, generator=g) < 0.3).to(torch.int16) * LAMP
    voxels[:, 4, :] = LAMP
    lamps = lamps_of_world(World.from_dense(voxels, TABLE))
    solid = F.pad((voxels > 0).int(), (1, 1, 1, 1, 1, 1))
    faces = sum(int((solid.diff(dim=axis) != 0).sum()) for axis in range(3))
    area = torch.linalg.cross(lamps.edge_u, lamps.edge_v).norm(dim=-1)
    assert area.sum().item() == pytest.approx(faces)
    assert int((area > 0).sum()) < faces
    assert len(lamps) <= MANY
    reach = (lamps.corner - lamps.center[:, None]).norm(dim=-1) - lamps.radius[:, None]
    assert reach[area > 0].max() < 1e-4


def test_a_torch_of_small_voxels_is_one_lamp():
    """Wherever it stands in its block: cells of four of its voxels would cut it into eight."""
    torch_ = world((16, 8, 8), (LAMP, (3, 3, 3), (5, 6, 5)), (LAMP, (11, 2, 2), (13, 4, 4)))
    for scale, count in ((1 / 8, 2), (1.0, 10)):
        stands = Instance(model=torch_, pose=lambda _: pose((0.0, 0.0, 0.0)), scale=scale)
        scene = Scene(world=world((4, 4, 4)), instances=(stands,))
        lamps = lamps_of(scene, scene.poses([0.0])[0])
        area = torch.linalg.cross(lamps.edge_u, lamps.edge_v).norm(dim=-1).sum()
        assert len(lamps) == count
        assert area.item() == pytest.approx((32 + 24) * scale**2)


def test_instances_shine_where_they_are_unless_bounces_do_not_see_them():
    model = world((4, 4, 4), (LAMP, (1, 1, 1), (2, 2, 2)))

    def scene(mask: int) -> Scene:
        still = world((4, 4, 4), (STONE, (0, 0, 0), (4, 1, 4)))
        moving = Instance(model=model, pose=lambda t: pose((3.0 * t, 5.0, 0.0), yaw=0.7), scale=0.5, mask=mask)
        return Scene(world=still, instances=(moving,))

    shown = scene(MASK_ALL)
    matrix = shown.poses([2.0])[0]
    lamps = lamps_of(shown, matrix)
    middle = matrix[0] @ torch.tensor([0.75, 0.75, 0.75, 1.0])
    assert len(lamps) == 1
    assert torch.allclose(lamps.center[0], middle[:3], atol=1e-5)
    assert torch.allclose(torch.linalg.cross(lamps.edge_u, lamps.edge_v).norm(dim=-1), torch.full((1, 6), 0.25))
    hidden = scene(MASK_ALL & ~MASK_SECONDARY)
    assert len(lamps_of(hidden, matrix)) == 0
