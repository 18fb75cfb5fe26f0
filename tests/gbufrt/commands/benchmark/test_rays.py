"""Rates of rays, and the worlds that they go through."""

from __future__ import annotations

import pytest
import torch

from gbufrt.commands.benchmark import rays
from tracer.gbuffers import gbuffer
from tracer.worlds import terrain


def test_a_large_world_is_the_small_one_and_its_mirror_images():
    small = terrain((32, 32, 32))
    large = rays.tiled(small)
    assert large.world.bounds() == ((0, 0, 0), (128, 32, 128))
    assert len(large.world.bricks) == 16 * (len(small.world.bricks) - 1) + 1, "no two parts share voxels"
    cells = torch.stack(torch.meshgrid(*(torch.arange(n) for n in (128, 32, 128)), indexing="ij"), dim=-1)
    folded = cells % 64
    folded = torch.where(folded >= 32, 63 - folded, folded)
    folded[..., 1] = cells[..., 1]
    assert torch.equal(large.world.at(cells), small.world.at(folded))


def test_the_grazing_view_meets_the_hills_at_a_grazing_angle():
    scene = terrain()
    g = gbuffer(scene, rays.grazing(scene).camera(0.0, size=(24, 32)))
    toward = g.camera.rotate_to_world(g.camera.to_eye(g.points_view()))
    up = toward[:, 1:2][g.hit]
    assert 0.3 < float(g.hit.float().mean()) < 1.0
    assert 0.0 < float(up.median()) < 0.5


@pytest.mark.parametrize("pixels", [1, 4])
def test_rates_count_rays_by_the_second(monkeypatch: pytest.MonkeyPatch, pixels: int):
    monkeypatch.setattr(rays, "timed", lambda run, repeats, device="cpu": 2.0)
    scene, size = terrain((16, 16, 16)), (pixels, 500)
    assert rays.rate(scene, scene.views["horizon"], 1, size) == pytest.approx(0.25 * pixels)
    assert rays.time_rays(1, size=size) == pytest.approx({"ms": 2.0, "mrays_per_s": 0.25 * pixels})
    g = gbuffer(scene, scene.views["horizon"].camera(0.0, size=size))
    assert rays.occlusion_rate(scene, g, 1) == pytest.approx(int(g.hit.sum()) * rays.SAMPLES / 2e3)
