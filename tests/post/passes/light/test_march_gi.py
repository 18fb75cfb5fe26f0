"""Ray-marched indirect light against brute force over the same boxes."""

from __future__ import annotations

import math
from typing import Any

import boxes
import mirrors
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame
from gbufrt.sampling import sample
from gbufrt.tree import map_tensors
from post.passes.light.march_gi import MarchGI, march_gi
from post.shading.sent_light import bounce_light, feedback_gain


def inputs(frame: Frame) -> tuple[Any, ...]:
    g = frame.gbuffer
    assert g.albedo is not None
    return g.depth, g.normal, g.camera, frame.read("radiance"), g.albedo


def scene(size: tuple[int, int] = (30, 40), **options: Any) -> Frame:
    return boxes.frame(boxes.camera(size, **options))


def brute_force(frame: Frame, rays: int = 160) -> tuple[Tensor, Tensor]:
    """Cosine-weighted rays through the boxes: light of the visible hits, and the open share."""
    g, generator = frame.gbuffer, torch.Generator().manual_seed(3)
    points = g.camera.to_world(g.points_view())
    light, open_sky = torch.zeros_like(points), torch.zeros_like(g.depth)
    for _ in range(rays):
        wild = torch.nn.functional.normalize(torch.randn(g.normal.shape, generator=generator), dim=1)
        way = torch.where(g.hit, torch.nn.functional.normalize(g.normal * 1.0001 + wild, dim=1), 0.0)
        end = mirrors.intersect(g.camera, points + 1e-3 * g.normal, way)
        light = light + end.visible * sample(frame.read("radiance"), end.px, mode="nearest")
        open_sky = open_sky + (~end.hit).float()
    return frame.read("albedo") * light / rays, open_sky / rays


@pytest.mark.parametrize(("tilted", "orthographic"), [(False, True), (True, False)])
def test_agrees_with_brute_force(tilted, orthographic):
    frame = scene((42, 56) if orthographic else (30, 40), orthographic=orthographic)
    g = frame.gbuffer
    lean = torch.nn.functional.normalize(g.normal + torch.tensor([0.5, 0.6, 0.3])[None, :, None, None], dim=1)
    bent = torch.where(g.hit, lean, 0.0) if tilted else None
    gi, sky = march_gi(
        *inputs(frame),
        hit=frame.gbuffer.hit,
        bent_normal=bent,
        thickness=g.thickness,
        rays=48,
        steps=128,
        distance=100.0,
    )
    true_gi, true_sky = brute_force(frame)
    hit = g.hit.expand_as(gi)
    error = ((gi - true_gi)[hit].square().sum() / true_gi[hit].square().sum()).item()
    assert error < 0.1
    assert abs(float(gi[hit].mean() / true_gi[hit].mean()) - 1) < 0.09
    assert (sky >= true_sky - 0.2)[g.hit].float().mean() > 0.98, "a ray that is lost counts as open, not the reverse"


def test_open_plane_is_neutral():
    frame = boxes.frame(boxes.camera((30, 40)), boxes=boxes.ROOM[:1])
    gi, sky = march_gi(*inputs(frame), hit=frame.gbuffer.hit, rays=4)
    assert gi.abs().max() == 0
    assert torch.allclose(sky, torch.ones_like(sky))


def test_a_corner_sees_half_of_each_wall():
    """At the foot of a very high wall the floor's cosine-weighted hemisphere is half wall: form factor (1 - 0) / 2."""
    room = torch.tensor([[[-500.0, -1.0, -10.0], [500.0, 0.0, 500.0]], [[-500.0, -1.0, -11.0], [500.0, 500.0, -10.0]]])
    camera = Camera.look_at((0.0, 30.0, 60.0), (0.0, 26.0, -10.0), size=(81, 60), fov_y=100.0, far=2000.0)
    frame = boxes.frame(camera, boxes=room).replace(ambient=None)
    g = frame.gbuffer
    wall = (frame.read("material_id") == 2).float().expand(-1, 3, -1, -1)
    white = torch.ones_like(wall)
    gi, _ = march_gi(g.depth, g.normal, camera, wall, white, hit=g.hit, rays=128, steps=128, distance=2000.0)
    points = g.camera.to_world(g.points_view())
    foot = g.hit & (g.normal[:, 1:2] > 0.5) & (points[:, 2:3] < -5.0) & (points[:, 0:1].abs() < 10.0)
    assert foot.sum() > 3
    reach = points[:, 2:3][foot] + 10
    visible = 63.0  # units of the wall that are on screen above the floor at its middle
    expected = 0.5 * (1 - reach / (reach**2 + visible**2).sqrt())
    assert abs(float((gi[:, :1][foot] - expected).mean())) < 0.04


def test_bounces_feed_back_and_lamps_do_not_count_twice():
    frame = scene()
    g, radiance = frame.gbuffer, frame.read("radiance")
    lamp = torch.zeros_like(radiance)
    lamp[..., :10, :10] = 0.25
    lit = frame.replace(gbuffer=g.replace(emission=lamp), radiance=radiance + lamp, ambient=None)
    assert torch.allclose(bounce_light(lit), radiance, atol=1e-6)
    assert torch.equal(bounce_light(lit.replace(emitters_sampled=False)), radiance + lamp)
    shade = frame.replace(ao=torch.full_like(g.depth, 0.5))
    assert torch.allclose(bounce_light(shade), radiance + 0.5 * frame.read("ambient"))
    before = frame.replace(gi=torch.full_like(radiance, 0.2)).as_previous()
    again = frame.replace(previous=before, ambient=None)
    assert torch.equal(bounce_light(again, bounces=1), radiance)
    gained = (bounce_light(again, bounces=3) - radiance)[g.hit.expand_as(radiance)]
    assert torch.allclose(gained, torch.tensor(0.2 * feedback_gain(3)), atol=1e-3)
    gone = before.replace(gbuffer=before.gbuffer.replace(hit=torch.zeros_like(g.hit)))
    assert torch.allclose(
        bounce_light(again.replace(previous=gone), bounces=3)[g.hit.expand_as(radiance)],
        radiance[g.hit.expand_as(radiance)],
    )


@pytest.mark.parametrize("bounces", [1, 2, 3, 8])
def test_feedback_sums_to_the_bounces(bounces):
    total, first, reflectance = 0.0, 1.0, 0.3
    for _ in range(200):
        total = first + reflectance * feedback_gain(bounces) * total
    assert math.isclose(total, sum(reflectance**k for k in range(bounces)), rel_tol=1e-6)


def test_module_equals_function():
    frame = scene().replace(ambient=None)
    g = frame.gbuffer
    result = MarchGI(rays=3, bounces=1, seed=2)(frame.replace(bent_normal=g.normal, index=5))
    gi, sky = march_gi(
        *inputs(frame),
        hit=frame.gbuffer.hit,
        bent_normal=g.normal,
        normal_geo=g.normal_geo,
        thickness=g.thickness,
        index=5,
        rays=3,
        seed=2,
    )
    assert torch.equal(result.read("gi"), gi)
    assert torch.equal(result.read("sky_visibility"), sky)
    metal = frame.replace(gbuffer=g.replace(metallic=torch.ones_like(g.depth)))
    assert MarchGI(rays=1)(metal).read("gi").abs().max() == 0


def test_batch_equals_loop():
    cams = [boxes.camera((30, 40)), boxes.camera((30, 40), dx=0.7)]
    both = boxes.frame(
        Camera(
            intrinsics=torch.cat([c.intrinsics for c in cams]),
            world_from_view=torch.cat([c.world_from_view for c in cams]),
            size=(30, 40),
            far=100.0,
        )
    )
    together = MarchGI(rays=3)(both).read("gi")
    for k in range(2):
        one = map_tensors(lambda t, k=k: t[k : k + 1] if t.shape[0] == 2 else t, both)
        assert ((MarchGI(rays=3)(one).read("gi")[0] - together[k]).abs() < 1e-3).float().mean() > 0.999


@pytest.mark.parametrize("case", ["sky", "odd", "one row", "one column", "jittered"])
def test_awkward_frames(case):
    size = {"odd": (127, 73), "one row": (1, 9), "one column": (9, 1)}.get(case, (24, 32))
    camera = boxes.camera(size)
    camera = camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera
    frame = boxes.frame(camera, boxes=boxes.ROOM + 500 if case == "sky" else boxes.ROOM)
    result = MarchGI(rays=2)(frame)
    assert torch.isfinite(result.read("gi")).all()
    assert (result.read("gi")[~frame.gbuffer.hit.expand(-1, 3, -1, -1)] == 0).all()
    assert (result.read("sky_visibility")[~frame.gbuffer.hit] == 1).all()


def test_gradients_reach_light_and_albedo():
    frame = boxes.frame(boxes.camera((6, 8))).to(torch.float64)
    depth, normal, camera, light, albedo = inputs(frame)
    light, albedo = light.clone().requires_grad_(), albedo.clone().requires_grad_()

    def run(light: Tensor, albedo: Tensor) -> Tensor:
        return march_gi(depth, normal, camera, light, albedo, hit=frame.gbuffer.hit, rays=4)[0]

    assert torch.autograd.gradcheck(run, (light, albedo), fast_mode=True)
    run(light, albedo).sum().backward()
    assert light.grad is not None and albedo.grad is not None  # noqa: PT018
    assert light.grad.abs().sum() > 0.1
    assert albedo.grad.abs().sum() > 0.1


def test_wrong_arguments():
    frame = scene((8, 8))
    with pytest.raises(ValueError, match="rays"):
        MarchGI(rays=0)(frame)
    with pytest.raises(ValueError, match="bounces"):
        MarchGI(bounces=0)(frame)
