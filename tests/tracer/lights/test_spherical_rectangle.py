"""Points on rectangles, even over the solid angle."""

from __future__ import annotations

import torch

from tracer.lights.spherical_rectangle import rectangle_points


def test_points_on_a_rectangle_are_even_as_they_are_seen():
    g = torch.Generator().manual_seed(1)
    along, up, _ = torch.linalg.qr(torch.randn(3, 3, generator=g)).Q.unbind(0)
    along, up, eye = along * 3, up * 1.5, torch.tensor([0.3, -0.4, 0.9])
    n, corner = 100000, torch.tensor([-1.0, 0.2, 0.4])
    s = (torch.arange(600) + 0.5) / 600
    ways = corner + s[:, None, None] * along + s[:, None] * up - eye
    visible = (ways @ torch.linalg.cross(along, up)).abs() / ways.norm(dim=-1) ** 3
    eyes, corners, alongs, ups = (x.expand(n, 3) for x in (eye, corner, along, up))
    got, angle = rectangle_points(eyes, corners, alongs, ups, torch.rand(2, n, generator=g))
    assert torch.allclose(angle[0], visible.mean(), rtol=1e-4)
    unit = torch.nn.functional.normalize
    want = (unit(ways, dim=-1) * visible[..., None]).sum(dim=(0, 1)) / visible.sum()
    assert torch.allclose(unit(got, dim=1).mean(dim=0), want, atol=3e-3)
    assert ((got + eye - corner) @ torch.linalg.cross(along, up)).abs().max() < 1e-5
