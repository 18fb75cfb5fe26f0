"""Slices are drawn by what they hold of the hemisphere."""

from __future__ import annotations

import math
from typing import Any

import boxes
import pytest
import torch

from gbufrt import Camera
from post.sweep import slices
from post.sweep.bitmask import bitmask_ao
from post.sweep.layout import Receiving
from post.sweep.turns import tangents, turn


def receivers(degrees: float) -> Any:
    """One receiver, whose normal makes an angle with the direction toward the eye."""
    camera = Camera.look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), size=(1, 1))
    angle = math.radians(degrees)
    normal = torch.tensor([math.sin(angle) * 0.8, math.sin(angle) * 0.6, math.cos(angle)]).view(1, 3, 1, 1)
    depth = torch.full((1, 1, 1, 1), 3.0)
    return slices.receivers(Receiving(camera, depth, normal, depth > 0))


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 80.0, 89.0])
def test_shares_are_those_of_the_hemisphere(degrees: float):
    """As many slices fall between two angles as random directions, by their cosine about the normal, lie there."""
    one, count = receivers(degrees), 1 << 18
    at = one._replace(**{name: plane.expand(1, 1, count) for name, plane in one._asdict().items()})
    cosine, sine = (t.flatten().double() for t in turn(at, (torch.arange(count)[None] + 0.5) / count))
    assert torch.allclose(cosine**2 + sine**2, torch.ones_like(cosine), atol=1e-5)
    (ax, ay, az), (bx, by, bz) = tangents(one)
    along, aside = one.nx * ax + one.ny * ay + one.nz * az, one.nx * bx + one.ny * by + one.nz * bz
    own = float(torch.atan2(aside, along)) if degrees else 0.0
    found = (torch.atan2(sine, cosine) - own) % math.pi
    uniform = torch.rand(2, count, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    radius, azimuth, tilt = uniform[0].sqrt(), 2 * math.pi * uniform[1], math.radians(degrees)
    across = radius * azimuth.cos() * math.cos(tilt) + (1 - uniform[0]).sqrt() * math.sin(tilt)
    wanted = torch.atan2(radius * azimuth.sin(), across) % math.pi
    bins = [torch.histc(angles, 16, 0, math.pi) for angles in (found, wanted)]
    assert float((bins[0] - bins[1]).abs().max()) / count < 3e-3


def test_one_slice_is_unbiased():
    """The mean over frames of one slice is that of many slices, in corners seen at a grazing angle too."""
    frame = boxes.frame(boxes.camera((24, 32)))
    g = frame.gbuffer

    def ao(index: int, directions: int) -> torch.Tensor:
        found = bitmask_ao(g.depth, g.normal, g.camera, hit=g.hit, thickness=g.thickness, radius=2.0, index=index,
                           directions=directions, steps=16)  # fmt: skip
        return found[0]

    one = torch.stack([ao(index, 1) for index in range(256)]).mean(0)
    many = torch.stack([ao(index, 16) for index in range(16)]).mean(0)
    assert float((one - many)[g.hit].abs().mean()) < 5e-3
    assert abs(float((one - many)[g.hit].mean())) < 5e-4
