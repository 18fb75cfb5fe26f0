"""The surface of water from below against Fresnel's equations and Snell's law."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F

from tracer.sampling.scatter import mirrored
from tracer.underwater.surface import INDEX, outside, reflectance, refracted

CRITICAL = math.asin(1 / INDEX)


def test_reflectance_head_on_and_beyond_the_critical_angle():
    head_on = reflectance(torch.tensor([1.0]))
    torch.testing.assert_close(head_on, torch.tensor([((INDEX - 1) / (INDEX + 1)) ** 2]))
    beyond = torch.linspace(CRITICAL + 1e-3, math.pi / 2, 50).cos()
    torch.testing.assert_close(reflectance(beyond), torch.ones(50))
    within = reflectance(torch.linspace(0, CRITICAL - 1e-3, 50).cos())
    assert (within < 1).all()
    assert (within.diff() >= -1e-6).all()


def test_reflectance_is_the_same_from_the_other_side():
    """As light in the air has it, with the polarisations written for that side."""
    inner = torch.linspace(0, CRITICAL - 1e-3, 50, dtype=torch.float64)
    outer = (INDEX * inner.sin()).asin()
    across = ((inner - outer).sin() / (inner + outer).sin())[1:]
    along = ((inner - outer).tan() / (inner + outer).tan())[1:]
    torch.testing.assert_close(reflectance(inner.cos())[1:], (across**2 + along**2) / 2)


def test_refraction_follows_snell_and_stays_in_the_plane():
    g = torch.Generator().manual_seed(3)
    normals = F.normalize(torch.randn(200, 3, generator=g), dim=1)
    ways = F.normalize(torch.randn(200, 3, generator=g), dim=1)
    ways = torch.where(((ways * normals).sum(1) > 0)[:, None], -ways, ways)
    cosine = -(ways * normals).sum(1)
    passes = cosine > math.cos(CRITICAL) + 1e-3
    ways, normals, cosine = ways[passes], normals[passes], cosine[passes]
    out = refracted(ways, normals)
    torch.testing.assert_close(-(out * normals).sum(1), outside(cosine), rtol=1e-3, atol=1e-4)
    sine = torch.linalg.cross(out, normals).norm(dim=1)
    torch.testing.assert_close(sine, INDEX * (1 - cosine**2).sqrt(), rtol=1e-3, atol=1e-4)
    assert (torch.linalg.cross(ways, normals) * out).sum(1).abs().max() < 1e-5
    back = mirrored(ways, normals)
    torch.testing.assert_close((back * normals).sum(1), cosine)
