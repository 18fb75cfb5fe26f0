"""Gradients of reflections: what they recover, where they stay finite, and that asking for them changes nothing."""

from __future__ import annotations

from collections.abc import Callable

import boxes
import pytest
import smooth
import torch
from mirrors import SkyAlone
from torch import Tensor

from gbufrt import Frame
from post.march.attached import attach_hits
from post.march.rays import depth_hierarchy, march_rays
from post.passes.light.march_gi import MarchGI
from post.passes.light.ssr import SSR

ROOM = smooth.corner((18, 24), uneven=False)
FLOOR = (ROOM.gbuffer.normal[:, 1:2] > 0.5).double()


def rough(by: Tensor) -> Frame:
    return ROOM.replace(gbuffer=ROOM.gbuffer.replace(roughness=by.expand_as(FLOOR)))


def wall_moved(by: Tensor) -> Frame:
    """The wall farther away or nearer; a floor like polished stone reflects it."""
    g = ROOM.gbuffer
    return ROOM.replace(gbuffer=g.replace(depth=g.depth * (1 + by * (1 - FLOOR)), roughness=0 * FLOOR + 0.05))


@pytest.mark.parametrize(
    ("change", "true", "start", "rate", "close"),
    [(rough, 0.5, 0.3, 0.03, 0.02), (wall_moved, 0.0, 0.04, 0.006, 0.004), (wall_moved, 0.0, -0.04, 0.006, 0.004)],
)
def test_descent_recovers_what_a_reflection_tells(
    change: Callable[[Tensor], Frame], true: float, start: float, rate: float, close: float
) -> None:
    """From the reflection in the floor alone."""

    def shown(by: Tensor) -> Tensor:
        return FLOOR * torch.cat(
            [SkyAlone(samples=2)(change(by).replace(index=i)).read("reflection") for i in range(3)]
        )

    wanted = shown(torch.tensor(true, dtype=torch.float64))
    guess = torch.tensor(start, dtype=torch.float64, requires_grad=True)
    descent = torch.optim.Adam([guess], lr=rate)
    slower = torch.optim.lr_scheduler.ExponentialLR(descent, 0.9)
    for _ in range(24):
        descent.zero_grad()
        (shown(guess) - wanted).square().mean().backward()
        descent.step()
        slower.step()
    assert float(guess.detach()) == pytest.approx(true, abs=close)


@pytest.mark.parametrize("stage", [SSR(samples=2, reuse=2), SSR(method="cone", samples=2), MarchGI(rays=4)])
@pytest.mark.parametrize("orthographic", [False, True])
def test_asking_for_gradients_changes_no_value(stage: SSR | MarchGI, orthographic: bool) -> None:
    frame = boxes.frame(boxes.camera((36, 48), orthographic=orthographic))
    g = frame.gbuffer
    leaves = {name: frame.read(name).clone().requires_grad_() for name in ("depth", "normal", "roughness")}
    result, wanted = stage(frame.replace(gbuffer=g.replace(**leaves))), stage(frame)
    for name in stage.writes:
        assert torch.equal(result.read(name), wanted.read(name)), name
        assert result.read(name).requires_grad


@pytest.mark.parametrize("method", ["ggx", "cone"])
def test_gradients_are_finite_at_mirrors_under_an_open_sky_and_where_nothing_is(method) -> None:
    frame = boxes.frame(boxes.camera((24, 32)))
    leaves = {name: frame.read(name).clone().requires_grad_() for name in ("depth", "normal", "roughness")}
    with torch.no_grad():
        leaves["roughness"].zero_()
    visibility = torch.ones_like(frame.gbuffer.depth)
    visibility[..., ::2] = 0
    visibility.requires_grad_()
    frame = frame.replace(gbuffer=frame.gbuffer.replace(**leaves), sky_visibility=visibility)
    result = SSR(samples=2, method=method, reuse=2)(frame.replace(bent_normal=frame.gbuffer.normal.detach()))
    total = torch.stack([result.read(name).sum() for name in sorted(SSR.writes)]).sum()
    for gradient in torch.autograd.grad(total, [*leaves.values(), visibility]):
        assert torch.isfinite(gradient).all()


def test_hits_follow_rays_and_planes_but_not_where_reads_keep_off_another_surface() -> None:
    """For a plane with normal n, the distance along a ray d changes by -n / (n . d) for each step of its origin."""
    g = ROOM.gbuffer
    points, normal = g.points_view().detach().requires_grad_(), g.camera.rotate_to_view(g.normal)
    eye = g.camera.to_eye(points.detach())
    rays = torch.where(FLOOR > 0, 2 * (eye * normal).sum(1, keepdim=True) * normal - eye, 0.0)
    hits = march_rays(depth_hierarchy(g.depth, g.normal, g.camera), points, rays, g.camera)
    attached = attach_hits(hits, g.depth, g.normal, points, rays, g.camera)
    assert torch.equal(attached.px, hits.px)
    (moved,) = torch.autograd.grad(attached.distance.sum(), points, retain_graph=True)
    expected = -normal[:, :, :1, :1] / (normal[:, :, :1, :1] * rays).sum(1, keepdim=True)  # all hit the wall
    follows = hits.hit & (moved.abs().sum(1, keepdim=True) > 0)
    assert float(follows.sum() / hits.hit.sum()) > 0.9
    torch.testing.assert_close(moved[follows.expand_as(moved)], expected[follows.expand_as(moved)])
    crossing = g.camera.project(points + rays * hits.distance, jittered=True).detach()
    kept_off = hits.hit & ((crossing - hits.px).abs() > 0.05)
    assert kept_off.any()
    for part, some in ((kept_off, False), (hits.hit & ~kept_off, True)):
        (moved,) = torch.autograd.grad((attached.px * part).sum(), points, retain_graph=True)
        assert bool((moved != 0).any()) == some
