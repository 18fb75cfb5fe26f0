"""Ambient occlusion by visibility bitmasks, against closed forms and ray-traced truth."""

from __future__ import annotations

import math
from typing import Any

import boxes
import pytest
import torch
from cornell import cornell
from torch import Tensor

from gbufrt import Camera
from post.sweep.arcs import mean_directions
from post.sweep.bitmask import bitmask_ao
from post.sweep.sectors import GROUPS, SECTORS, cover, group_shares, no_cover, share

CORNER = torch.tensor([[[-40.0, -1.0, -40.0], [40.0, 0.0, 40.0]], [[-40.0, -1.0, -4.0], [40.0, 40.0, -3.0]]])


def pit(depth: float, *, size: int = 41) -> tuple[Tensor, Tensor, Camera]:
    """A round pit of radius 1 in a floor, viewed from straight above without perspective."""
    camera = Camera.look_at((0, 10, 0), (0, 0, 0), up=(0, 0, -1), size=(size, size), orthographic_height=3.2)
    point = camera.unproject(torch.full((1, 1, size, size), 10.0))
    inside = point[:, :2].norm(dim=1, keepdim=True) < 1
    normal = torch.tensor([0.0, 1.0, 0.0]).view(1, 3, 1, 1).expand(1, 3, size, size)
    return torch.where(inside, 10.0 + depth, 10.0), normal, camera


@pytest.mark.parametrize("depth", [0.5, 1.5])
def test_the_middle_of_a_pit_sees_what_the_disk_above_it_covers(depth: float) -> None:
    z, normal, camera = pit(depth)
    results = [bitmask_ao(z, normal, camera, radius=None, thickness=torch.inf, steps=20, index=i)[0] for i in range(2)]
    middle = torch.cat(results)[..., 19:22, 19:22].mean()
    assert float(middle) == pytest.approx(1 / (1 + depth * depth), abs=0.04)


def test_a_wall_within_the_radius_blocks_a_circular_segment() -> None:
    camera = Camera.look_at((0, 2, 2), (0, 0.6, -2), size=(60, 64), far=100.0)
    g = boxes.frame(camera, boxes=CORNER).gbuffer
    point = camera.to_world(g.points_view())
    radius, away = 1.5, point[:, 2:] + 3
    ao = torch.stack(
        [
            bitmask_ao(g.depth, g.normal, camera, hit=g.hit, thickness=g.thickness, radius=radius, steps=10, index=i)[0]
            for i in range(3)
        ]
    ).mean(0)
    for low, high in ((0.2, 0.4), (0.6, 0.8), (1.0, 1.2)):
        chosen = (point[:, 1:2] < 0.01) & (away > low) & (away < high) & (point[:, :1].abs() < 0.5)
        c = away[chosen] / radius  # by Nusselt's analogue: the unit disk's segment beyond c
        expected = 1 - (c.acos() - c * (1 - c * c).sqrt()) / math.pi
        assert float(ao[chosen].mean()) == pytest.approx(float(expected.mean()), abs=0.04)
    far = (point[:, 1:2] < 0.01) & (away > 1.1 * radius)
    assert float(ao[far].mean()) > 0.99


def test_a_thin_pole_leaves_no_halo_where_thickness_is_measured() -> None:
    frame = boxes.frame(boxes.camera((72, 96)))
    g = frame.gbuffer
    ao, _ = bitmask_ao(g.depth, g.normal, g.camera, hit=g.hit, thickness=g.thickness, radius=1.0)
    behind = g.normal[:, 2:] * (g.depth > 25)  # the far wall, behind the pole but out of its reach
    height = g.camera.to_world(g.points_view())[:, 1:2]
    assert float(ao[(behind > 0.9) & (height > 1.5)].min()) == 1


def test_sectors_count_what_they_cover() -> None:
    like, dither = torch.zeros(1, 1, 4), torch.full((1, 1, 4), 0.5)
    low, high = torch.tensor([[[0.0, 0.2, 0.5, 0.0]]]), torch.tensor([[[0.5, 0.7, 0.5, 1.0]]])
    for soft in (False, True):
        covered, fresh = cover(no_cover(like, soft), low, high, torch.ones_like(like), dither)
        torch.testing.assert_close(share(covered), torch.tensor([[[0.5, 0.5, 0.0, 1.0]]]))
        torch.testing.assert_close(group_shares(covered).mean(0), share(covered))
        torch.testing.assert_close(share(fresh), share(covered))
        again, fresh = cover(covered, low, high, torch.ones_like(like), dither)
        assert torch.equal(again, covered)
        assert float(share(fresh).abs().max()) == 0
    assert SECTORS % GROUPS == 0


def test_mean_directions_match_their_integrals() -> None:
    errors = []
    for n in (-1.2, -0.3, 0.0, 0.7):
        alpha = torch.linspace(-math.pi / 2, math.pi / 2, 20001, dtype=torch.float64)
        density = alpha.cos() * (alpha + n).sin().abs()
        part = ((density.cumsum(0) / density.sum()) * GROUPS).long().clamp_max(GROUPS - 1)
        found = mean_directions(torch.full((1, 1, 1), math.sin(n), dtype=torch.float64), GROUPS)
        for mean, direction in zip(found, (alpha.cos(), alpha.sin()), strict=True):
            for group in range(GROUPS):
                weight = density * (part == group)
                errors.append(abs(float(mean[group] - (weight * direction).sum() / weight.sum())))
    assert max(errors) < 0.1
    assert sum(errors) / len(errors) < 0.015


def test_soft_sectors_agree_with_dithered_ones() -> None:
    g = boxes.frame(boxes.camera((24, 32))).gbuffer
    soft, hard = (
        torch.stack(
            [
                bitmask_ao(
                    g.depth, g.normal, g.camera, hit=g.hit, thickness=g.thickness, radius=2.0, soft=soft, index=i
                )[0]
                for i in range(2)
            ]
        ).mean(0)
        for soft in (True, False)
    )
    assert float((soft - hard).abs().mean()) < 0.005


def test_soft_sectors_are_the_mean_of_dithered_ones() -> None:
    """Bodies of taps that abut or overlap, as in sweeps; the mean over evenly spaced dithers is exact."""
    generator, steps = torch.Generator().manual_seed(4), 6
    ends = torch.rand(steps, 1, 8, 9, generator=generator).cumsum(0) * 0.08
    slack = 0.02 * torch.rand(steps, 1, 8, 9, generator=generator)
    dithers = (torch.arange(600) + 0.5) / 600
    total = torch.zeros(SECTORS, 1, 8, 9)
    for dither in dithers:
        mask = no_cover(ends[0], soft=False)
        for i in range(steps - 1):
            mask, _ = cover(mask, ends[i] - slack[i], ends[i + 1], torch.ones(1, 8, 9), dither.expand(1, 8, 9))
        total += torch.stack([(mask >> bit) & 1 for bit in range(SECTORS)]) / len(dithers)
    covered, gained = no_cover(ends[0], soft=True), torch.zeros(1, 8, 9)
    for i in range(steps - 1):
        covered, fresh = cover(covered, ends[i] - slack[i], ends[i + 1], torch.ones(1, 8, 9), ends[i])
        gained = gained + share(fresh)
    torch.testing.assert_close(covered[0], total, atol=4e-3, rtol=0)
    torch.testing.assert_close(gained, share(covered))


def test_the_gradient_of_the_radius_is_whole_without_a_thickness() -> None:
    """The radius's gradient includes its effect through the default thickness."""
    g = boxes.frame(boxes.camera((8, 10))).to(torch.float64).gbuffer
    radius = torch.tensor(3.0, dtype=torch.float64)

    def run(radius: Tensor) -> Tensor:
        sweep: dict[str, Any] = {"hit": g.hit, "radius": radius, "directions": 2, "steps": 3, "soft": True}
        return bitmask_ao(g.depth, g.normal, g.camera, **sweep)[0].sum()

    (gradient,) = torch.autograd.grad(run(leaf := radius.clone().requires_grad_()), leaf)
    wanted = (run(radius + 1e-6) - run(radius - 1e-6)) / 2e-6
    assert float(gradient) == pytest.approx(float(wanted), rel=1e-3)


def test_gradients_match_finite_differences_and_are_not_zero() -> None:
    g = boxes.frame(boxes.camera((8, 10))).to(torch.float64).gbuffer
    assert g.thickness is not None
    depth, thickness = g.depth.clone().requires_grad_(), g.thickness.clone().requires_grad_()
    radius = torch.tensor(3.0, dtype=torch.float64, requires_grad=True)

    def run(depth: Tensor, thickness: Tensor, radius: Tensor) -> Tensor:
        sweep: dict[str, Any] = {"hit": g.hit, "thickness": thickness, "radius": radius}
        return bitmask_ao(depth, g.normal, g.camera, directions=4, steps=4, **sweep)[0]

    assert torch.autograd.gradcheck(run, (depth, thickness, radius), eps=1e-7, atol=1e-4, fast_mode=True)
    run(depth, thickness, radius).sum().backward()
    for leaf in (depth, thickness, radius):
        assert leaf.grad is not None
        assert float(leaf.grad.abs().max()) > 1e-4


def test_gradient_descent_recovers_a_radius() -> None:
    g = boxes.frame(boxes.camera((24, 32))).gbuffer

    def run(radius: Tensor) -> Tensor:
        return bitmask_ao(
            g.depth,
            g.normal,
            g.camera,
            hit=g.hit,
            thickness=g.thickness,
            radius=radius,
            directions=2,
            steps=6,
            soft=True,
        )[0]

    wanted = run(torch.tensor(2.0))
    radius = torch.tensor(1.5, requires_grad=True)
    descent = torch.optim.SGD([radius], lr=0.03)
    for _ in range(20):
        descent.zero_grad()
        (run(radius) - wanted).square().sum().backward()
        descent.step()
    assert float(radius.detach()) == pytest.approx(2.0, abs=0.15)


def test_the_cornell_box() -> None:
    frame, truth = cornell(step=4)
    g, ok = frame.gbuffer, truth["ok"]
    results = [bitmask_ao(g.depth, g.normal, g.camera, hit=g.hit, thickness=0.5, steps=8, index=i) for i in range(3)]
    ao = torch.stack([ao for ao, _ in results]).mean(0)
    error = float((ao - truth["ao_gt"])[ok].square().mean().sqrt())
    constant = float((truth["ao_gt"][ok] - truth["ao_gt"][ok].mean()).square().mean().sqrt())
    assert error < 0.08 < constant / 2
    dark = ok & (truth["ao_gt"] < 0.9)
    bent = torch.nn.functional.normalize(torch.stack([ao * bent for ao, bent in results]).mean(0), dim=1)

    def angle(one: Tensor) -> float:
        return float((one * truth["bent_gt"]).sum(1, keepdim=True)[dark].clamp(-1, 1).acos().mean())

    assert angle(bent) < angle(g.normal) / 3
