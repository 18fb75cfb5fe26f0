"""Screen-space global illumination by the bitmask gather."""

from __future__ import annotations

import math
from typing import Any

import boxes
import pytest
import torch
from cornell import cornell
from torch import Tensor

from gbufrt import Camera, Frame, GBuffer
from post.passes.light.ssgi import SSGI, ssgi
from post.shading.sent_light import sent_light

SIZE = (24, 32)
CORNER = torch.tensor([[[-40.0, -1.0, -40.0], [40.0, 0.0, 40.0]], [[-2.0, 0.0, -4.0], [2.0, 1.5, -3.0]]])


def gather(frame: Frame, light: Tensor, **tunables: Any) -> tuple[Tensor, Tensor, Tensor]:
    g = frame.gbuffer
    tunables = {"thickness": g.thickness, **tunables}
    return ssgi(g.depth, g.normal, g.camera, light, torch.ones_like(light), hit=g.hit, **tunables)


def form_factor(point: Tensor) -> Tensor:
    """Of the wall's face (z = -3) from floor points ``(N, 3)``, by the midpoint rule."""
    x = (torch.arange(80) + 0.5) / 80 * 4 - 2
    y = (torch.arange(60) + 0.5) / 60 * 1.5
    grid_y, grid_x = torch.meshgrid(y, x, indexing="ij")
    dx, dz = grid_x[None] - point[:, 0, None, None], point[:, 2, None, None] + 3
    distance2 = dx * dx + grid_y * grid_y + dz * dz
    return (grid_y * dz / (math.pi * distance2 * distance2)).sum((1, 2)) * (4 / 80) * (1.5 / 60)


def test_a_floor_beside_a_lit_wall_receives_the_form_factor() -> None:
    camera = Camera.look_at((0, 2, 2.5), (0, 0.7, -2), size=(48, 60), far=100.0)
    frame = boxes.frame(camera, boxes=CORNER)
    g = frame.gbuffer
    point = camera.to_world(g.points_view())
    colour = torch.tensor([1.0, 0.5, 0.0]).view(1, 3, 1, 1)
    light = colour * ((g.normal[:, 2:] > 0.9) & g.hit)
    gi = torch.stack([gather(frame, light, index=i, directions=3)[0] for i in range(2)]).mean(0)
    for low, high in ((0.4, 0.7), (1.0, 1.3), (1.8, 2.2)):
        away = point[:, 2:] + 3
        chosen = (point[:, 1:2] < 0.01) & (away > low) & (away < high) & (point[:, :1].abs() < 0.6)
        expected = float(form_factor(point.permute(0, 2, 3, 1)[chosen[:, 0]]).mean())
        assert float(gi[:, :1][chosen].mean()) == pytest.approx(expected, rel=0.12)
        assert float(gi[:, 1:2][chosen].mean()) == pytest.approx(expected / 2, rel=0.12)
        assert float(gi[:, 2:][chosen].max()) == 0


def test_a_step_seen_edge_on_sends_light_and_a_hidden_one_less() -> None:
    steps = torch.tensor([[[-5.0, 0.0, -1.0], [5.0, 1.0, 1.0]], [[-5.0, 0.0, -3.0], [5.0, 3.0, 0.0]]])

    def just_above(height: float) -> float:
        frame = boxes.frame(Camera.look_at((0, height, 10), (0, height, 0), size=(41, 40), far=100.0), boxes=steps)
        g = frame.gbuffer
        assert not (g.normal[:, 1:2] > 0.5).any(), "no pixel shows the tread"
        gi = torch.stack([gather(frame, torch.ones_like(g.normal), index=i)[0] for i in range(4)]).mean(0)
        above = torch.where(g.hit, g.camera.to_world(g.points_view())[:, 1:2] - 1, torch.inf)
        lowest = above[above > 0].min()
        return float(gi[:, :1][(above - lowest).abs() < 0.1].mean())

    assert just_above(1.3) > 0.05
    assert just_above(1.3) > 3 * just_above(0.4)


def test_a_surface_that_faces_away_sends_nothing() -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    top = (frame.gbuffer.normal[:, 1:2] > 0.9) & (
        frame.gbuffer.camera.to_world(frame.gbuffer.points_view())[:, 1:2] > 1
    )
    gi = gather(frame, top.float().expand(-1, 3, -1, -1))[0]
    floor = (frame.gbuffer.normal[:, 1:2] > 0.9) & ~top
    assert int(top.sum()) > 5
    assert float(gi[floor.expand_as(gi)].max()) == 0


def test_without_light_there_is_none_and_open_sky_and_gathered_light_share_the_hemisphere() -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    black, sky, _ = gather(frame, torch.zeros(1, 3, *SIZE))
    assert float(black.abs().max()) == 0
    white, again, _ = gather(frame, torch.ones(1, 3, *SIZE))
    assert torch.equal(sky, again)
    assert float((white[:, :1] + sky)[frame.gbuffer.hit].max()) < 1 + 1e-5
    assert float(white.max()) > 0.05


def test_half_resolution_keeps_light_on_its_surface() -> None:
    frame = boxes.frame(boxes.camera((48, 64)))
    light = torch.where(frame.gbuffer.hit, frame.read("radiance"), 0.0)
    full, full_sky, _ = gather(frame, light, steps=8)
    half, half_sky, bent = gather(frame, light, steps=8, resolution=2)
    assert float((half - full).mean().abs()) < 0.03 * float(full.mean())
    assert float((half_sky - full_sky).abs().mean()) < 0.03
    length = bent.norm(dim=1, keepdim=True)[frame.gbuffer.hit]
    torch.testing.assert_close(length, torch.ones_like(length))


@pytest.mark.parametrize("resolution", [1, 2])
def test_any_size_projection_and_sky_gives_numbers(resolution: int) -> None:
    cameras = [boxes.camera(size, orthographic=True) for size in ((127, 73), (1, 5), (1, 1))]
    cameras.append(Camera.look_at((0, 5, 0), (0, 9, -1), size=SIZE))
    for camera in cameras:
        frame = SSGI(directions=1, steps=2, resolution=resolution)(boxes.frame(camera, index=3))
        assert bool(torch.isfinite(frame.read("gi")).all())
        assert bool((frame.read("gi") >= 0).all())
        assert bool((frame.read("sky_visibility")[~frame.gbuffer.hit] == 1).all())


def test_batch_is_the_same_as_one_by_one_and_module_is_the_function() -> None:
    one, other = boxes.camera(SIZE), boxes.camera(SIZE, dx=1.0)
    both = Camera(
        intrinsics=torch.cat([one.intrinsics, other.intrinsics]),
        world_from_view=torch.cat([one.world_from_view, other.world_from_view]),
        size=SIZE,
        far=one.far,
    )
    stage = SSGI(directions=2, steps=6, distance=4.0, seed=2, bounces=1)
    together = stage(boxes.frame(both, index=2))
    for b, camera in enumerate((one, other)):
        frame = boxes.frame(camera, index=2)
        g: GBuffer = frame.gbuffer
        alone = stage(frame)
        assert float((together.read("gi")[b : b + 1] - alone.read("gi")).abs().mean()) < 1e-4
        light, sweep = sent_light(frame, distance=4.0), {"directions": 2, "steps": 6, "distance": 4.0, "seed": 2}
        expected = ssgi(
            g.depth, g.normal, camera, light, frame.read("albedo"), hit=g.hit, thickness=g.thickness, index=2, **sweep
        )
        assert torch.equal(alone.read("gi"), expected[0])
        assert torch.equal(alone.read("sky_visibility"), expected[1])


@pytest.mark.parametrize("tunables", [{}, {"resolution": 2}, {"distance": 4.0}])
def test_a_gradient_in_light_or_albedo_leaves_the_result_alone(tunables: dict[str, Any]) -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    g, light, albedo = frame.gbuffer, frame.read("radiance"), frame.read("albedo")
    wanted = ssgi(g.depth, g.normal, g.camera, light, albedo, hit=g.hit, **tunables)
    leaves = light.clone().requires_grad_(), albedo.clone().requires_grad_()
    found = ssgi(g.depth, g.normal, g.camera, *leaves, hit=g.hit, **tunables)
    for a, b in zip(found, wanted, strict=True):
        torch.testing.assert_close(a, b, atol=1e-6, rtol=1e-5)
    way = torch.rand(light.shape, generator=torch.Generator().manual_seed(2))
    along = ssgi(g.depth, g.normal, g.camera, way, albedo, hit=g.hit, **tunables)[0]  # linear in light
    gradient = torch.autograd.grad(found[0].sum(), leaves)
    assert float((gradient[0] * way).sum()) == pytest.approx(float(along.sum()), rel=1e-3)
    assert float((gradient[1] * albedo).sum()) == pytest.approx(float(wanted[0].sum()), rel=1e-4)


@pytest.mark.parametrize(("tunables", "apart"), [({}, 2e-3), ({"thickness": 0.5}, 2e-3), ({"distance": 4.0}, 1e-2)])
def test_soft_and_dithered_sectors_agree_on_average(tunables: dict[str, Any], apart: float) -> None:
    """Within a distance the soft form fades there, where the dithered one ends."""
    frame = boxes.frame(boxes.camera(SIZE))
    g, totals = frame.gbuffer, []
    for leaf in (g.depth, g.depth.clone().requires_grad_()):
        sweep: dict[str, Any] = {"hit": g.hit, "thickness": g.thickness, **tunables}
        inputs = (leaf, g.normal, g.camera, frame.read("radiance"), frame.read("albedo"))
        frames = [ssgi(*inputs, index=i, **sweep) for i in range(6)]
        totals.append([float(sum(f[k].detach().mean() for f in frames)) for k in (0, 1)])
    for hard, soft in zip(*totals, strict=True):
        assert soft == pytest.approx(hard, rel=apart)


def test_gradients_match_finite_differences_and_are_not_zero() -> None:
    g = boxes.frame(boxes.camera((5, 6))).to(torch.float64).gbuffer
    depth = g.depth.clone().requires_grad_()
    light = torch.rand(1, 3, 5, 6, dtype=torch.float64, generator=torch.Generator().manual_seed(1)).requires_grad_()

    def run(depth: Tensor, light: Tensor) -> Tensor:
        sweep: dict[str, Any] = {"hit": g.hit, "thickness": g.thickness, "directions": 1, "steps": 3}
        gi, sky, _ = ssgi(depth, g.normal, g.camera, light, torch.ones_like(light), **sweep)
        return torch.cat([gi, sky], dim=1)

    assert torch.autograd.gradcheck(run, (depth, light), eps=1e-7, atol=1e-4, fast_mode=True)
    run(depth, light).sum().backward()
    for leaf in (depth, light):
        assert leaf.grad is not None
        assert float(leaf.grad.abs().max()) > 1e-4


def test_wrong_arguments_are_named() -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    light = frame.read("radiance")
    with pytest.raises(ValueError, match="resolution must be 1"):
        gather(frame, light, resolution=3)
    with pytest.raises(ValueError, match="positive length"):
        gather(frame, light, distance=0.0)
    with pytest.raises(ValueError, match=r"light must be \(1,3,24,32\)"):
        gather(frame, light[:, :1])
    with pytest.raises(ValueError, match="bounces must be at least 1"):
        SSGI(bounces=0)(frame)


def test_the_cornell_box() -> None:
    frame, truth = cornell(step=4)
    wanted, ok = truth["indirect_diffuse_1_onscreen_gt"], truth["ok"]
    results = [SSGI(bounces=1, directions=3)(frame.replace(index=i)) for i in range(2)]
    gi = torch.stack([result.read("gi") for result in results]).mean(0)
    constant = torch.zeros_like(wanted)
    for which in truth["object"].unique():
        part = ok & (truth["object"] == which)
        mean = (wanted * part).sum((2, 3), keepdim=True) / part.sum().clamp_min(1)
        constant = torch.where(part, mean, constant)

    def error(one: Tensor) -> float:
        return float(((one - wanted).square() * ok).sum() / (wanted.square() * ok).sum())

    assert error(gi) < 0.9 * error(constant)
    assert error(gi) < 0.12
    sky = torch.stack([result.read("sky_visibility") for result in results]).mean(0)
    assert float((sky - truth["ao_inf_gt"])[ok].square().mean().sqrt()) < 0.15


@pytest.mark.parametrize("compiled", [True, False])
def test_a_flat_floor_does_not_light_itself_round_what_stands_on_it(compiled):
    frame = boxes.frame(boxes.camera((36, 48)), boxes=boxes.ROOM[[0, 2]])
    g, floor = frame.gbuffer, frame.read("material_id") == 1
    light, albedo = torch.where(floor, 1.0, 0.0).expand(-1, 3, -1, -1), torch.ones_like(g.normal)
    found, _, _ = ssgi(
        g.depth, g.normal, g.camera, light, albedo, hit=g.hit, thickness=g.thickness, directions=8, compiled=compiled
    )
    assert float(found[floor.expand_as(found)].max()) < 1e-4
    assert float(found[(frame.read("material_id") == 2).expand_as(found)].mean()) > 0.05, "the box sees the floor"
