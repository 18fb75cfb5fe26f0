"""Reflections: exact mirrors, mirrors in mirrors, what rays end in; batches, odd frames, gradients."""

from __future__ import annotations

import boxes
import mirrors
import pytest
import torch
from mirrors import SkyAlone, shiny
from torch import Tensor

import tracer
from gbufrt import Camera, Frame, Pass
from gbufrt.sampling import gather
from gbufrt.tree import map_tensors
from post.passes.light.march_gi import MarchGI
from post.passes.light.ssr import SSR, ssr
from post.shading.ggx import grazing
from post.shading.sent_light import outgoing_light
from tracer.scene.placement import place


def truth_of(frame: Frame) -> tuple[Tensor, mirrors.Truth]:
    truth = mirrors.intersect(frame.gbuffer.camera, *mirrors.reflected(frame))
    return boxes.ALBEDO[truth.box[:, 0]].permute(0, 3, 1, 2), truth


@pytest.mark.parametrize(("reflects", "signal"), [(SSR(), "reflection"), (MarchGI(distance=1e6), "gi")])
def test_without_thickness_units_do_not_matter(reflects: Pass, signal: str) -> None:
    frame = boxes.frame(boxes.camera((45, 60)))
    g, pose = frame.gbuffer.replace(thickness=None), frame.gbuffer.camera.world_from_view.clone()
    pose[:, :3, 3] *= 128
    near, far = 128 * g.camera.near, 128 * g.camera.far
    camera = Camera.from_intrinsics(g.camera.intrinsics, pose, size=g.camera.size, near=near, far=far)
    small = g.replace(camera=camera, previous_camera=None, motion=None, motion_z=None, depth=128 * g.depth)
    found, other = (reflects(frame.replace(gbuffer=one)).read(signal) for one in (g, small))
    assert float(found.mean()) > 0.01
    torch.testing.assert_close(other, found)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("method", ["ggx", "cone"])
def test_a_mirror_shows_the_truth(orthographic, method):
    frame = shiny(boxes.camera((108, 144), orthographic=orthographic))
    result = SSR(samples=1, method=method, bounces=1)(frame)
    light, truth = truth_of(frame)
    shown, mean = truth.visible.expand_as(light), light[truth.visible.expand_as(light)].mean()
    error = (result.read("reflection") - light)[shown]
    assert error.square().mean().sqrt() < 0.1 * mean
    assert (error.abs() < 1e-3).float().mean() > 0.965
    assert (result.read("reflection_confidence")[truth.visible] > 0.99).float().mean() > 0.97
    apart = (result.read("reflection_distance") - truth.distance)[truth.visible] / truth.distance[truth.visible]
    assert apart.abs().quantile(0.95) < 1e-3


@pytest.mark.parametrize("polished", [False, True])
def test_a_mirror_in_a_mirror_shows_the_truth(polished: bool):
    """The wall shines before a uniform sky, all else are mirrors: rays by way of two of them bring either.

    Where the wall is polished, it mirrors the sky besides.
    """
    frame = shiny(boxes.camera((108, 144)))
    g, wall = frame.gbuffer, frame.read("material_id") == 2
    frame = frame.replace(radiance=torch.where(wall, frame.read("radiance"), 0.0))
    rough = torch.where(wall, 0.0 if polished else 1.0, 0.0)
    frame = frame.replace(gbuffer=g.replace(metallic=torch.where(wall, 0.0, 1.0), roughness=rough))
    points, directions = mirrors.reflected(frame)
    first = mirrors.intersect(g.camera, points, directions)
    ends, away = points + directions * first.distance, 2 * (directions * first.normal).sum(1, keepdim=True)
    turned = torch.where(first.hit, directions - away * first.normal, 0.0)
    second = mirrors.intersect(g.camera, ends, turned)
    gloss = 0.5 * (0.04 + 0.96 * grazing((turned * second.normal).sum(1).abs())) if polished else g.depth[:, 0] * 0
    once, twice = (SkyAlone(samples=1, bounces=k)(frame).read("reflection") for k in (1, 2))
    shown = first.visible & (first.box != 1) & g.hit & ~wall
    shines, misses = shown & second.visible & (second.box == 1), shown & ~second.hit
    for seen, light in ((shines, boxes.ALBEDO[1][:, None] + gloss[shines[:, 0]]), (misses, 0.5)):
        found = twice.movedim(1, 0)[:, seen[:, 0]]
        assert int(seen.sum()) > 20
        assert ((found - light).abs() < 1e-3).float().mean() > 0.9
        assert once.movedim(1, 0)[:, seen[:, 0]].median() == 0, "metals have no light of their own"


def test_no_metal_is_black_under_an_open_sky():
    """A ball of voxels: rays end in corners of its steps, and at sides that the camera does not see."""
    x, y, z = torch.meshgrid(*(torch.arange(13) - 6,) * 3, indexing="ij")
    gold = tracer.MaterialTable.of([tracer.Material(name="gold", albedo=(1.0, 0.7, 0.3), metallic=1.0, roughness=0.15)])
    scene = place(tracer.World.from_dense((x**2 + y**2 + z**2 < 36).short(), gold))
    frame = tracer.render(scene, scene.views["front"].camera(time=0.0, size=(60, 80)))
    metal = (frame.read("metallic") > 0.5)[:, 0]
    black = [SSR(samples=1, bounces=k)(frame).read("reflection")[:, 0][metal] < 0.02 for k in (1, 2)]
    assert black[0].float().mean() > 0.3
    assert black[1].float().mean() < 0.01


def test_module_equals_function():
    frame = shiny(rough=0.3).replace(ambient=None)
    g = frame.gbuffer
    assert g.roughness is not None
    result = SSR(samples=2, steps=32, reuse=2, seed=3)(frame)
    light = outgoing_light(frame)
    by_hand = ssr(
        g.depth, g.normal, g.camera, light, g.roughness, hit=g.hit, f0=torch.ones_like(light), metallic=g.metallic,
        normal_geo=g.normal_geo, thickness=g.thickness, environment=frame.environment, samples=2, steps=32, reuse=2,
        seed=3,
    )  # fmt: skip
    for name, tensor in zip(("reflection", "reflection_confidence", "reflection_distance"), by_hand, strict=True):
        assert torch.equal(result.read(name), tensor)


def test_batch_equals_loop_and_frames_differ():
    both = shiny(boxes.cameras(2, (40, 56)), rough=0.3)
    together = SSR(samples=2, reuse=3)(both).read("reflection")
    for k in range(2):
        one = map_tensors(lambda t, k=k: t[k : k + 1] if t.shape[0] == 2 else t, both)
        assert ((SSR(samples=2, reuse=3)(one).read("reflection")[0] - together[k]).abs() < 1e-3).float().mean() > 0.999
    later = SSR(samples=2)(both.replace(index=1)).read("reflection")
    assert not torch.allclose(SSR(samples=2)(both).read("reflection"), later)
    assert not torch.allclose(SSR(samples=2, seed=1)(both.replace(index=1)).read("reflection"), later)


@pytest.mark.parametrize("case", ["sky", "odd", "one row", "one column", "jittered", "orthographic"])
def test_awkward_frames(case):
    size = {"odd": (127, 73), "one row": (1, 9), "one column": (9, 1)}.get(case, (24, 32))
    camera = boxes.camera(size, orthographic=case == "orthographic")
    camera = camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera
    frame = shiny(camera, rough=0.5, scene=boxes.ROOM + 500 if case == "sky" else boxes.ROOM)
    for method in ("ggx", "cone"):
        result = SSR(samples=2, reuse=1, method=method)(frame)
        for name in SSR.writes:
            assert torch.isfinite(result.read(name)).all()
        assert (result.read("reflection")[~frame.gbuffer.hit.expand(-1, 3, -1, -1)] == 0).all()


def test_gradients_reach_light_sky_and_reflectance():
    frame = shiny(boxes.camera((6, 8)), rough=0.3).to(torch.float64)
    g, light = frame.gbuffer, frame.read("radiance").double().requires_grad_()
    f0 = torch.full_like(light, 0.5).detach().requires_grad_()
    environment = torch.full((1, 3, 4, 8), 0.5, dtype=torch.float64, requires_grad=True)

    def run(light: Tensor, f0: Tensor, environment: Tensor) -> Tensor:
        assert g.roughness is not None
        return ssr(
            g.depth, g.normal, g.camera, light, g.roughness, hit=g.hit, f0=f0, thickness=g.thickness,
            environment=environment, samples=2, reuse=2,
        )[0]  # fmt: skip

    assert torch.autograd.gradcheck(run, (light, f0, environment), fast_mode=True)
    run(light, f0, environment).sum().backward()
    for tensor in (light, f0, environment):
        assert tensor.grad is not None
        assert tensor.grad.abs().sum() > 0.1


def test_wrong_arguments():
    frame = shiny(boxes.camera((8, 8)))
    with pytest.raises(ValueError, match="method"):
        SSR(method="box")(frame)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="samples"):
        SSR(samples=0)(frame)
    with pytest.raises(ValueError, match="bounces"):
        SSR(bounces=0)(frame)


def test_a_mirror_shows_all_the_light_of_a_wall_that_goes_on_behind_a_beam() -> None:
    """Its part behind the beam is on screen nowhere; half the light there would draw the shape of the beam."""
    floor, wall = [[-40.0, -1.0, -9.0], [40.0, 0.0, 40.0]], [[-40.0, 0.0, -10.0], [40.0, 8.0, -9.0]]
    room = torch.tensor([floor, wall, [[-1.4, 2.0, -0.3], [1.4, 2.8, 0.3]]])
    frame = shiny(Camera.look_at((0, 2, 7), (0, 1, 0), size=(90, 120), fov_y=50.0), scene=room)
    truth = mirrors.intersect(frame.gbuffer.camera, *mirrors.reflected(frame), scene=room)
    column, row = truth.px.floor().unbind(1)
    over = gather(frame.read("material_id"), column, row) == 3
    hidden = (frame.read("material_id") == 1) & truth.hit & (truth.box == 1) & ~truth.visible & over
    assert int(hidden.sum()) > 20
    found = SSR(samples=1, bounces=1)(frame).read("reflection").movedim(1, 0)[:, hidden[:, 0]]
    assert float(((found - boxes.ALBEDO[1][:, None]).abs() < 0.02).float().mean()) > 0.9
