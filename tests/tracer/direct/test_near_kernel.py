"""Lamps side by side against one after the other."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from tracer.direct import choice_kernel, near_kernel
from tracer.direct.sources import sources_of
from tracer.lights.emitters import lamps_of_world
from tracer.scene.material import Material, MaterialTable
from tracer.scene.world import World


@pytest.mark.parametrize("share", [0.02, 0.3])
def test_lamps_side_by_side_send_what_each_of_them_does(share: float):
    """Lamps of one voxel, and of many rectangles."""
    g = torch.Generator().manual_seed(6)
    shines = torch.rand(16, 8, 16, generator=g) < share
    table = MaterialTable.of([Material(name="lamp", emission=(4.0, 3.0, 2.0))])
    sources = sources_of(lamps_of_world(World.from_dense(shines.to(torch.int16), table, origin=(-8, -4, -8))), None)
    near, dropped, dark = near_kernel.new_near(sources), 0, 0
    for _ in range(12):
        candidates = torch.randperm(sources.lamps.shape[1], generator=g)[: sources.lamps.shape[1] // 2].int().numpy()
        center, power = (torch.rand(3, generator=g) - 0.5) * torch.tensor([16, 8, 16]), np.empty(len(candidates))
        near_kernel.gather(near, sources, candidates, (center - 1.5).tolist(), (center + 1.5).tolist())
        dropped += sum(int(sources.first[n + 1] - sources.first[n]) for n in candidates) - near.first[len(candidates)]
        for point in (center + torch.rand(4, 3, generator=g) * 2 - 1).double().tolist():
            normal = tuple(F.normalize(torch.randn(3, generator=g), dim=0).double().tolist())
            for reach in (0.5, 0.0):
                near_kernel.importances(near, tuple(point), normal, reach, power)
                alone = [
                    choice_kernel.importance(sources, number, tuple(point), normal, reach) for number in candidates
                ]
                np.testing.assert_allclose(power, alone, rtol=1e-12, atol=1e-12)
            ways = sources.lamps[:3, candidates].T - np.array(point)
            assert near_kernel.closest(near, tuple(point), len(candidates)) == pytest.approx(
                (ways**2).sum(1).min() ** 0.5
            )
            dark += alone.count(0.0)
    assert dropped > 100, "rectangles that face no point of the tile"
    assert dark > 10
