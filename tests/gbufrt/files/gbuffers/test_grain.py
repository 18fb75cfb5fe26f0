"""Noise in the light of a frame."""

from __future__ import annotations

import pytest
import torch

from gbufrt import Camera, Frame, GBuffer
from gbufrt.files.gbuffers.grain import grain, noisy


def floor(noise: float, *, textured: bool = False, known: bool = True) -> Frame:
    """A wall with a step in the middle, lit more to the right, with a checkered colour if asked for."""
    camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), fov_y=60.0, size=(48, 64))
    depth = torch.full((1, 1, 48, 64), 5.0)
    depth[..., 32:] = 8.0
    albedo = torch.full((1, 3, 48, 64), 0.6)
    if textured:
        albedo[..., ::2] = 0.3
    light = albedo * torch.linspace(0.5, 1.5, 64) * torch.where(depth > 6, 5.0, 1.0)
    light = light * (1 + noise * torch.randn(1, 1, 48, 64, generator=torch.Generator().manual_seed(0)))
    normal = torch.tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1).expand(1, 3, 48, 64).contiguous()
    gbuffer = GBuffer(camera=camera, depth=depth, hit=depth > 0, normal=normal, albedo=albedo if known else None)
    return Frame(gbuffer=gbuffer, radiance=light)


def test_grain_is_the_noise_and_neither_shading_nor_edges_nor_texture():
    assert grain(floor(0.0)) < 0.02
    assert grain(floor(0.0, textured=True)) < 0.02
    assert grain(floor(0.2)) == pytest.approx(0.2 * 1.128, rel=0.05)  # E|a - b| of two normal numbers


def test_noise_is_told_from_texture():
    assert noisy(floor(0.0)) is None
    assert noisy(floor(0.1)) == pytest.approx(0.113, rel=0.05)
    assert noisy(floor(0.1, known=False)) is None, "it may be a texture"
    picture = floor(0.3)
    assert noisy(picture.replace(radiance=None, color=picture.radiance)) == pytest.approx(0.34, rel=0.05)
