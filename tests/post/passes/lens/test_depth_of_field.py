"""Depth of field against a lens sampled at many places, each a sheared pinhole that shares the focal plane."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pipeline
from post.lens.thin_lens import autofocus, circle_of_confusion
from post.passes.lens.depth_of_field import DepthOfField, depth_of_field

SIZE = (90, 120)
WORLD = torch.cat([boxes.ROOM, torch.tensor([[[1.2, 2.2, 4.5], [1.9, 3.4, 4.9]]])])  # and a block near the camera


def visible(camera: Camera) -> tuple[Frame, Tensor]:
    frame = boxes.frame(camera, boxes=WORLD)
    g = frame.gbuffer
    assert g.albedo is not None
    checker = 0.5 + 0.5 * torch.sin(camera.to_world(g.points_view()) * 2.6 + 0.5).prod(dim=1, keepdim=True)
    return frame, torch.where(g.hit, g.albedo * (0.2 + 0.8 * checker), 0.6)


def through_lens(camera: Camera, x: float, y: float, focus: float) -> Camera:
    """The camera moved by (x, y) on its lens, its picture shifted such that the focal plane stays where it was."""
    pose, k = camera.world_from_view.clone(), camera.intrinsics.clone()
    pose[:, :3, 3] += pose[:, :3, 0] * x + pose[:, :3, 1] * y
    k[:, 0, 2] += k[:, 0, 0] * x / focus
    k[:, 1, 2] += k[:, 1, 1] * y / focus
    return replace(camera, world_from_view=pose, intrinsics=k)


def lens_truth(camera: Camera, focus: float, aperture: float, count: int = 96) -> Tensor:
    total = torch.zeros(())
    for i in range(count):
        radius, angle = aperture * math.sqrt((i + 0.5) / count), 2.399963 * i  # the golden angle
        total = total + visible(through_lens(camera, radius * math.cos(angle), radius * math.sin(angle), focus))[1]
    return total / count


def psnr(image: Tensor, truth: Tensor) -> float:
    return -10 * math.log10(float((image - truth).square().mean()))


@pytest.mark.parametrize(
    ("focus", "aperture", "bound"), [(9.0, 0.3, 10.0), (9.0, 1.0, 14.0), (5.0, 0.3, 14.0), (25.0, 0.8, 12.0)]
)
def test_gains_on_the_thin_lens(focus, aperture, bound):
    camera = boxes.camera(SIZE)
    frame, color = visible(camera)
    g = frame.gbuffer
    truth = lens_truth(camera, focus, aperture)
    blurred = depth_of_field(color, g.depth, camera, hit=g.hit, focus_distance=focus, aperture_radius=aperture)
    assert psnr(blurred, truth) > psnr(color, truth) + bound


def test_circle_of_confusion_is_where_the_lens_puts_a_point():
    """Project one point from the middle and from the rim of the lens."""
    camera, focus, aperture = boxes.camera((64, 64)), 7.0, 0.2
    for z in (2.0, 7.0, 30.0):
        point = camera.to_world(torch.tensor([0.3, -0.2, z])[None, :, None, None])
        rim = through_lens(camera, aperture, 0.0, focus)
        moved = rim.project(rim.to_view(point)) - camera.project(camera.to_view(point))
        depth = torch.full((1, 1, 64, 64), z)
        coc = circle_of_confusion(depth, camera, focus_distance=focus, aperture_radius=aperture)
        assert float(coc[0, 0, 0, 0]) == pytest.approx(float(moved[0, 0]), abs=1e-3)
        assert float(moved[0, 1].abs()) < 1e-4


def test_circle_of_confusion_of_sky_and_parallel_rays():
    camera = boxes.camera((8, 8))
    depth, sky = torch.full((1, 1, 8, 8), 100.0), torch.zeros(1, 1, 8, 8, dtype=torch.bool)
    coc = circle_of_confusion(depth, camera, focus_distance=5.0, aperture_radius=0.1, hit=sky)
    assert float(coc[0, 0, 0, 0]) == pytest.approx(0.1 * float(camera.intrinsics[0, 1, 1]) / 5.0)
    flat = boxes.camera((8, 8), orthographic=True)
    coc = circle_of_confusion(torch.full_like(depth, 10.0), flat, focus_distance=5.0, aperture_radius=0.1)
    assert float(coc[0, 0, 0, 0]) == pytest.approx(0.1 * float(flat.intrinsics[0, 1, 1]))


def plane(depths: dict[tuple[int, int], float], size: int = 64) -> Tensor:
    depth = torch.full((1, 1, size, size), 10.0)
    for (start, stop), z in depths.items():
        depth[..., start:stop] = z
    return depth


def test_a_lamp_becomes_an_even_disc_that_keeps_its_light():
    camera, depth = boxes.camera((64, 64)), torch.full((1, 1, 64, 64), 10.0)
    color = torch.zeros(1, 3, 64, 64)
    color[..., 32, 32] = 1000.0
    # Half way to infinity from the focus at 5: a disc of 8 px.
    aperture = 8.0 / (float(camera.intrinsics[0, 1, 1]) * (1 / 5 - 1 / 10))
    disc = depth_of_field(color, depth, camera, focus_distance=5.0, aperture_radius=aperture)[0, 0]
    y, x = torch.meshgrid(torch.arange(64) - 32.0, torch.arange(64) - 32.0, indexing="ij")
    distance = torch.hypot(x, y)
    assert float(disc.sum()) == pytest.approx(1000.0, rel=1e-3)
    even = 1000 / (math.pi * 64)
    assert torch.allclose(disc[distance < 6.5], torch.tensor(even), rtol=0.1)
    assert float(disc[distance > 9.5].abs().max()) < 0.01 * even


def test_sharp_things_do_not_bleed_and_stay_sharp():
    """A red wall in focus in front of a blurred white one: no red on the white, no white on the red."""
    camera, depth = boxes.camera((64, 64)), plane({(0, 32): 5.0, (32, 64): 50.0})
    color = torch.ones(1, 3, 64, 64)
    color[:, 1:, :, :32] = 0.0
    blurred = depth_of_field(color, depth, camera, focus_distance=5.0, aperture_radius=0.6)
    assert torch.allclose(blurred, color, atol=2e-3)


def test_near_edges_become_transparent():
    """A black strip close to the lens over white in focus: half through at its edges, clear at three radii away."""
    camera, depth = boxes.camera((64, 64)), plane({(0, 32): 2.5})
    color = torch.ones(1, 3, 64, 64)
    color[..., :32] = 0.0
    aperture = 8.0 / (float(camera.intrinsics[0, 1, 1]) * (1 / 2.5 - 1 / 10))
    row = depth_of_field(color, depth, camera, focus_distance=10.0, aperture_radius=aperture)[0, 0, 32]
    # The share of a disc of 8 px beyond a straight edge at distance d.
    for x in (25, 28, 31, 32, 35, 38):
        d = (x + 0.5 - 32) / 8
        open_share = 1 - (math.acos(d) - d * math.sqrt(1 - d * d)) / math.pi
        assert float(row[x]) == pytest.approx(open_share, abs=0.06), x
    assert bool((row.diff() > -1e-3).all()), "no step back at the silhouette"
    assert float(row[8]) < 1e-3
    assert float(row[56]) == pytest.approx(1.0, abs=1e-3)


def test_a_sloped_surface_keeps_its_colour():
    frame, _ = visible(boxes.camera(SIZE))
    g = frame.gbuffer
    color = torch.full_like(g.normal, 0.37)
    blurred = depth_of_field(color, g.depth, g.camera, hit=g.hit, focus_distance=9.0, aperture_radius=1.0)
    assert torch.allclose(blurred, color, atol=1e-4)


def test_neutral():
    frame, color = visible(boxes.camera(SIZE))
    g = frame.gbuffer
    assert torch.equal(depth_of_field(color, g.depth, g.camera, aperture_radius=0.0), color)
    flat = torch.full_like(g.depth, 9.0)
    assert torch.allclose(depth_of_field(color, flat, g.camera, focus_distance=9.0), color, atol=1e-5)


def test_autofocus_is_the_median_of_what_is_hit():
    camera, depth = boxes.camera((40, 40)), torch.full((2, 1, 40, 40), 7.0)
    depth[..., 18:20, :] = 3.0
    hit = torch.ones_like(depth, dtype=torch.bool)
    hit[1] = False
    focus = autofocus(depth, camera, hit=hit, region=0.25)
    assert focus.tolist() == [7.0, pytest.approx(camera.far)]


def test_gradients():
    torch.manual_seed(1)
    camera = boxes.camera((6, 7)).to(torch.float64)
    color = torch.rand(1, 2, 6, 7, dtype=torch.float64, requires_grad=True)
    depth = (6 + torch.rand(1, 1, 6, 7, dtype=torch.float64) * 4).requires_grad_()
    aperture = torch.tensor([2.0], dtype=torch.float64, requires_grad=True)

    def blurred(c: Tensor, d: Tensor, a: Tensor) -> Tensor:
        return depth_of_field(c, d, camera, focus_distance=5.0, aperture_radius=a, max_radius_px=4.0)

    for gradient in torch.autograd.grad(blurred(color, depth, aperture).square().sum(), (color, depth, aperture)):
        assert float(gradient.abs().max()) > 1e-4
    assert torch.autograd.gradcheck(blurred, (color, depth, aperture), eps=1e-7, atol=1e-4)


def test_focus_distance_is_recovered_by_descent():
    frame, color = visible(boxes.camera((36, 48)))
    g = frame.gbuffer
    target = depth_of_field(color, g.depth, g.camera, focus_distance=9.0, aperture_radius=1.0)
    focus = torch.tensor([12.0], requires_grad=True)
    optimizer = torch.optim.Adam([focus], lr=0.3)
    for _ in range(40):
        optimizer.zero_grad()
        blurred = depth_of_field(color, g.depth, g.camera, focus_distance=focus, aperture_radius=1.0)
        (blurred - target).square().mean().backward()
        optimizer.step()
    assert float(focus.detach()) == pytest.approx(9.0, abs=0.3)


def test_module_equals_function_and_focus_eases():
    frame, color = visible(boxes.camera(SIZE))
    frame, g = frame.replace(color=color), frame.gbuffer
    blur = DepthOfField(focus_distance=20.0, aperture_radius=0.5, focus_speed=0.5)
    result, state = blur(frame)
    expected = depth_of_field(color, g.depth, g.camera, hit=g.hit, focus_distance=20.0, aperture_radius=0.5)
    assert torch.equal(result.read("color"), expected), "the first frame is in focus at once"
    nearer = DepthOfField(focus_distance=5.0, aperture_radius=0.5, focus_speed=0.5)
    focus = []
    for _ in range(20):
        _, state = nearer(frame, state)
        focus.append(float(state.signals["focus_distance"]))
    assert focus[0] == pytest.approx(1 / (0.5 / 20 + 0.5 / 5))
    assert focus == sorted(focus, reverse=True)
    assert focus[-1] == pytest.approx(5.0, rel=1e-3)


def test_a_cut_refocuses_its_own_batch_element_alone():
    camera = boxes.camera(SIZE)
    frame, color = visible(camera)
    pipeline = Pipeline(dof=DepthOfField(focus_speed=0.1), given={"color"})
    _, state = pipeline(frame.replace(color=color))
    target = float(state.stages["dof"].signals["focus_distance"])
    moved = {**state.stages["dof"].signals, "focus_distance": torch.full((1, 1, 1, 1), 50.0)}
    state = replace(state, stages={"dof": replace(state.stages["dof"], signals=moved)})
    _, eased = pipeline(frame.replace(color=color), state)
    assert target < float(eased.stages["dof"].signals["focus_distance"]) < 50
    _, cut = pipeline(frame.replace(color=color, cut=torch.tensor([True])), state)
    assert float(cut.stages["dof"].signals["focus_distance"]) == pytest.approx(target)


def test_bad_input():
    color, depth, camera = torch.rand(1, 3, 8, 8), torch.ones(1, 1, 8, 8), boxes.camera((8, 8))
    with pytest.raises(ValueError, match="depth must be"):
        depth_of_field(color, depth[..., :4], camera)
    with pytest.raises(ValueError, match="focus_distance must be positive"):
        depth_of_field(color, depth, camera, focus_distance=0.0)
    for name in ("focus_distance", "aperture_radius", "max_radius_px"):
        options: dict[str, Any] = {name: float("nan")}
        with pytest.raises(ValueError, match=f"{name} must .*nan"):
            depth_of_field(color, depth, camera, **options)
    with pytest.raises(ValueError, match="max_radius_px must be finite and at least 1, got inf"):
        depth_of_field(color, depth, camera, max_radius_px=math.inf)
    with pytest.raises(ValueError, match="aperture_radius must be at least 0"):
        depth_of_field(color, depth, camera, aperture_radius=-1.0)
