"""Thickness of bodies that round off, guessed from the picture, against balls and pillars."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from gbufrt import Camera
from post import thickness_from_depth
from post.sweep.chords import FULLNESS


def _camera(orthographic: bool, size: tuple[int, int] = (90, 121)) -> Camera:
    height = 4.0 if orthographic else None
    return Camera.look_at((0.3, 2.0, 6.0), (0, 0.2, 0), size=size, fov_y=36.0, orthographic_height=height)


def _shown(camera: Camera, stretch: tuple[float, float, float]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Depth, normal, where it is hit, and thickness of ``|stretch * point| = 1`` before the sky."""
    scale = torch.tensor(stretch, dtype=torch.float64)
    origins, ways = (rays.double() for rays in camera.rays())
    o, d = origins * scale, ways * scale
    a, b, c = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
    root = b * b - a * c
    hit = (root > 0)[:, None]
    near = (-b - root.clamp_min(0).sqrt()) / a
    points = origins + near[..., None] * ways
    normal = torch.nn.functional.normalize(points * scale * scale, dim=-1).movedim(-1, 1)
    depth = camera.to_view(points.movedim(-1, 1).float())[:, 2:]
    thickness = (2 * root.clamp_min(0).sqrt() / a)[:, None]
    return torch.where(hit, depth, camera.far), torch.where(hit, normal.float(), 0.0), hit, thickness.float()


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (2.0, 0.0, 2.0), (0.0, 3.0, 3.0)])
def test_round_bodies_are_as_deep_as_their_rims_tell(stretch: tuple[float, float, float], orthographic: bool) -> None:
    """A ball, and pillars that stand and lie."""
    camera = _camera(orthographic)
    depth, normal, hit, thickness = _shown(camera, stretch)
    ratio = (thickness_from_depth(depth, normal, camera, hit=hit) / thickness)[hit & (thickness > 0.3)]
    assert float(ratio.median()) == pytest.approx(FULLNESS, rel=0.05)
    assert float(ratio.quantile(0.1)) > 0.85 * FULLNESS
    assert float(ratio.quantile(0.9)) < 1.15 * FULLNESS


def test_eggs_are_no_boxes() -> None:
    camera = _camera(False)
    depth, normal, hit, thickness = _shown(camera, (1.0, 1.3, 0.8))
    ratio = (thickness_from_depth(depth, normal, camera, hit=hit) / thickness)[hit & (thickness > 0.3)]
    assert 0.7 * FULLNESS < float(ratio.quantile(0.1)) < float(ratio.quantile(0.9)) < 1.3 * FULLNESS


def test_a_ball_before_which_another_body_stands_is_told_by_the_rest_of_its_rim() -> None:
    camera = _camera(False)
    depth, normal, hit, thickness = _shown(camera, (1.0, 1.0, 1.0))
    post = torch.zeros_like(hit)
    post[..., 45:60] = True
    depth, hit, normal = (
        torch.where(post, 3.0, depth),
        hit | post,
        torch.where(post, -camera.forward[..., None, None], normal),
    )
    seen = hit & ~post & (thickness > 0.3)
    ratio = (thickness_from_depth(depth, normal, camera, hit=hit) / thickness)[seen]
    assert float(ratio.median()) == pytest.approx(FULLNESS, rel=0.05)
    assert float(ratio.quantile(0.1)) > 0.8 * FULLNESS


def test_gradients_reach_the_thickness_of_balls() -> None:
    camera = _camera(False, (31, 41))
    depth, normal, hit, thickness = _shown(camera, (1.0, 1.0, 1.0))
    depth = depth.double().requires_grad_()
    inner = hit & (thickness > 1.0)
    (grad,) = torch.autograd.grad(thickness_from_depth(depth, normal.double(), camera, hit=hit)[inner].sum(), depth)
    assert bool(grad.isfinite().all())
    with torch.no_grad():
        up, down = (
            thickness_from_depth(depth * (1 + step), normal.double(), camera, hit=hit)[inner].sum()
            for step in (1e-4, -1e-4)
        )
    assert float((grad * depth.detach())[hit].sum()) == pytest.approx(float((up - down) / 2e-4), rel=1e-3)
