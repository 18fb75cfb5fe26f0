"""The light of the sky by tables, against paths of light through the same air."""

from __future__ import annotations

import math

import pytest
import torch

from gbufrt.atmosphere import Atmosphere, sky_picture
from gbufrt.environment import environment_directions, lookup_environment
from tracer.truth.atmosphere import sky_truth


@pytest.mark.parametrize(("elevation", "paths"), [(50.0, 96), (4.0, 96), (-4.0, 192)])
def test_tables_hold_what_paths_of_light_bring(elevation: float, paths: int):
    """Means over rings round the zenith: single directions are too noisy for so few paths."""
    sun = (math.cos(math.radians(elevation)), math.sin(math.radians(elevation)), 0.0)
    ways = environment_directions((8, 12))[0].permute(1, 2, 0)[:4]
    truth = sky_truth(Atmosphere(), sun, ways.reshape(-1, 3), paths=paths).view(4, 12, 3)
    ours = lookup_environment(sky_picture(Atmosphere(), sun), ways.permute(2, 0, 1)[None])[0].permute(1, 2, 0)
    rings = ours.mean(1) / truth.mean(1)
    assert float((rings - 1).abs().max()) < 0.03, rings
    assert float((ours.mean((0, 1)) / truth.mean((0, 1)) - 1).abs().max()) < 0.02


def test_light_scattered_once_needs_no_chance():
    """In a thin atmosphere nothing is scattered twice: what both find is the same integral."""
    thin = Atmosphere(
        rayleigh=(1e-4, 2e-4, 4e-4), mie=0.0, mie_absorption=0.0, ozone=(0.0, 0.0, 0.0), ground_albedo=0.0
    )
    sun = (0.6, 0.8, 0.0)
    up = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.6, 0.8]])
    truth = sky_truth(thin, sun, up, paths=128)
    column = torch.tensor(thin.rayleigh) * thin.rayleigh_height * 3 / (16 * math.pi)
    overhead = column * (1 + 0.8**2)
    assert torch.allclose(truth[0], overhead, rtol=0.02)
    ours = lookup_environment(sky_picture(thin, sun), up.T[None, :, None])[0, :, 0].T
    assert torch.allclose(ours, truth, rtol=0.02)
