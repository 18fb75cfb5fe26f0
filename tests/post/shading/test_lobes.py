"""Lobes of rough surfaces, and rays that neighbours share."""

from __future__ import annotations

import torch

from post.shading.lobes import Surface, ggx_ray, reuse_neighbors


def test_reuse_weighs_rays_by_their_density():
    """Light only from off the lobe's middle: rays not weighted by their density would find too little of it."""
    ones = torch.ones(1, 1, 96, 96)
    up = torch.cat([0 * ones, 0 * ones, -ones], dim=1)
    eye = torch.nn.functional.normalize(up + torch.tensor([0.6, 0.0, 0.0])[None, :, None, None], dim=1)
    surface = Surface(0.1 * up, up, up, eye, 0.5 * ones, ones > 0)
    lobe = ggx_ray(surface, torch.rand(1, 2, 96, 96, generator=torch.Generator().manual_seed(2)), ones)
    mirrored = 2 * (eye * up).sum(1, keepdim=True) * up - eye
    light = ((lobe.direction * mirrored).sum(1, keepdim=True) < 0.6).float().expand(-1, 3, -1, -1)
    shared, reflected = reuse_neighbors(surface, lobe, torch.cat([lobe.direction, 0 * ones], dim=1), light, 8)
    found = (shared * (reflected[:, :1] + reflected[:, 1:2])).mean()
    expected = (light * lobe.weight).mean()
    assert expected > 0.1
    assert abs(float(found / expected) - 1) < 0.01
