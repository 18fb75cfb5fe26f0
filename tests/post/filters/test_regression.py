"""Planes fitted to light by filters, against weighted least squares and at the borders of surfaces."""

from __future__ import annotations

import boxes
import torch
import torch.nn.functional as F
from torch import Tensor

from post.filters.regression import NOISE, PIXELS, SHRINKAGE, fitted, with_places
from post.passes.denoising.atrous import atrous


def test_the_fit_is_that_of_weighted_least_squares():
    generator = torch.Generator().manual_seed(0)
    signal = 1 + 0.1 * torch.rand(1, 3, 9, 11, generator=generator, dtype=torch.float64)
    weight = torch.rand(9, 11, generator=generator, dtype=torch.float64)
    weight[:, 6:] = 0  # so that the pixel lies to one side of what it is fitted to
    weight, variance = weight / weight.sum(), torch.full((1, 1, 9, 11), 0.02, dtype=torch.float64)
    averages = (with_places(signal) * weight).sum((2, 3), keepdim=True).expand(-1, -1, 9, 11)
    found = fitted(averages, variance)

    row, column = 7, 8
    light = float((averages[0, :3, 0, 0] * torch.tensor([0.2126, 0.7152, 0.0722])).sum())
    y, x = torch.meshgrid(torch.arange(9) - row, torch.arange(11) - column, indexing="ij")
    design = torch.stack([torch.ones(99), x.flatten() / PIXELS, y.flatten() / PIXELS], dim=1).double()
    slopes = torch.diag(torch.tensor([0.0, 1.0, 1.0], dtype=torch.float64)) * (SHRINKAGE + NOISE * 0.02 / light**2)
    normal = design.T @ (weight.flatten()[:, None] * design) + slopes
    wanted = torch.linalg.solve(normal, design.T @ (weight * signal[0]).flatten(1).T)[0]
    torch.testing.assert_close(found[0, :, row, column], wanted, rtol=1e-6, atol=1e-8)
    assert float((wanted - averages[0, :3, 0, 0]).abs().min()) > 1e-4, "the plane is not the mean"


def test_where_a_surface_ends_the_gradient_of_its_light_does_not():
    frame = boxes.frame(boxes.camera((48, 64)), boxes=boxes.ROOM[:1])
    g = frame.gbuffer
    ramp = (1 + torch.arange(48.0).view(1, 1, -1, 1) / 16).expand_as(g.normal)
    noise = torch.full_like(g.depth, 0.01)
    mean, plane = (
        atrous(ramp, g.depth, g.normal, hit=g.hit, camera=g.camera, variance=noise, phi_color=1e3, linear=linear)[0]
        for linear in (False, True)
    )
    border = g.hit & ~F.pad(g.hit, (0, 0, 3, 0))[..., :48, :]
    error = [float((light - ramp).abs()[border.expand_as(ramp)].mean()) for light in (mean, plane)]
    assert error[1] < 0.3 * error[0]
    assert torch.equal(plane[~g.hit.expand_as(ramp)], ramp[~g.hit.expand_as(ramp)])


def test_noise_makes_the_plane_a_mean():
    averages = box(torch.rand(1, 3, 16, 24, generator=torch.Generator().manual_seed(1)) + 0.5)
    calm, loud = (fitted(averages, torch.full((1, 1, 16, 24), variance)) for variance in (0.0, 1e4))
    torch.testing.assert_close(loud, averages[:, :3], rtol=1e-3, atol=0.0)
    assert float((calm - averages[:, :3]).abs().max()) > 0.01


def test_single_precision_is_enough_at_the_edge_of_a_picture_3840_wide():
    light = torch.rand(1, 1, 6, 3840, generator=torch.Generator().manual_seed(2), dtype=torch.float64) + 0.5
    averages, calm = box(light), torch.zeros_like(light)
    wanted, found = fitted(averages, calm), fitted(box(light.float()), calm.float())
    assert float((found - wanted).abs().max()) < 0.01
    assert float((wanted - averages[:, :1]).abs().max()) > 0.1


def box(signal: Tensor) -> Tensor:
    """One-sided 3x3 means of what is fitted."""
    return F.avg_pool2d(F.pad(with_places(signal), (2, 0, 2, 0), mode="replicate"), 3, stride=1)
