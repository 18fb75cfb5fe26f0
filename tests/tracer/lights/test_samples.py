"""Lamps chosen one at a time, and points on them."""

from __future__ import annotations

import torch
from voxels import LAMP, world

from tracer.lights.emitters import lamps_of
from tracer.lights.form_factor import rectangle_irradiance
from tracer.lights.lamp_table import LampTable
from tracer.lights.samples import lamp_sample
from tracer.sampling.scatter import dot
from tracer.scene.scene import Scene


def test_lamps_chosen_one_at_a_time_give_their_form_factors():
    boxes = [(LAMP, (10, 6, 10), (14, 7, 12)), (LAMP, (30, 4, 33), (31, 5, 34)), (LAMP, (24, 3, 24), (25, 4, 25))]
    lamps = lamps_of(Scene(world=world((48, 8, 48), *boxes)), torch.zeros(0, 4, 4))
    table = LampTable.of(lamps, (0, 0, 0), (48, 8, 48))
    g = torch.Generator().manual_seed(0)
    points = torch.tensor([[24.2, 2.6, 24.8], [11.0, 1.0, 11.0], [40.0, 2.0, 7.0]]).repeat(40000, 1)
    normals = torch.tensor([0.0, 1.0, 0.0]).expand_as(points)
    sample = lamp_sample(table, points, normals, torch.rand(4, len(points), generator=g))
    got = (sample.energy * dot(normals, sample.direction).clamp_min(0)[:, None]).view(-1, 3, 3).mean(dim=0)
    for i in range(3):
        want = torch.zeros(3)
        for lamp in range(len(lamps)):
            corner, edge_u, edge_v = (
                t[lamp, :, None].permute(2, 0, 1) for t in (lamps.corner, lamps.edge_u, lamps.edge_v)
            )
            each = rectangle_irradiance(points[i, :, None], normals[i, :, None], corner, edge_u, edge_v)
            want += lamps.radiance[lamp] * each.sum()
        assert torch.allclose(got[i], want, rtol=0.03)
