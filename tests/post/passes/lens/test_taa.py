"""Temporal anti-aliasing."""

# pyright: reportPossiblyUnboundVariable=false

from __future__ import annotations

import math
from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pipeline
from gbufrt.noise.noise import halton_jitter
from post.history.catmull_rom import catmull_rom
from post.history.op import anti_alias
from post.passes.lens.taa import TAA, taa

SIZE = (48, 64)


def frame_at(jitter: tuple[float, float] | None, *, dx: float = 0.0, previous: Camera | None = None) -> Frame:
    """A tilted camera, so that every edge is slanted."""
    camera = boxes.camera(SIZE, dx=dx).with_jitter(jitter)
    frame = boxes.frame(camera, previous=previous)
    return frame.replace(color=frame.radiance)


def area_sampled(side: int = 6, dx: float = 0.0) -> Tensor:
    """Mean over a grid of positions in each pixel, in the tone-mapped space in which edges are judged."""
    total = torch.zeros(())
    for y in range(side):
        for x in range(side):
            color = frame_at(((x + 0.5) / side - 0.5, (y + 0.5) / side - 0.5), dx=dx).read("color")
            total = total + tone(color)
    return total / side**2


def tone(color: Tensor) -> Tensor:
    return color / (1 + color)


def run(count: int, **tunables: Any) -> list[Tensor]:
    state, previous, results, stage = None, None, [], TAA(**tunables)
    for index in range(count):
        frame = frame_at(halton_jitter(index), previous=previous)
        out, state = stage(frame, state)
        results.append(out.read("color"))
        previous = frame.gbuffer.camera
    return results


def rms(value: Tensor) -> float:
    return float((value**2).mean().sqrt())


def test_slanted_edges_come_near_the_area_sampled_truth():
    truth, results = area_sampled(), run(16)
    aliased = rms(tone(frame_at(None).read("color")) - truth)
    late = rms(tone(results[-1]) - truth)
    assert late < 0.5 * aliased
    assert late < 0.75 * rms(tone(results[0]) - truth)


def test_still_content_neither_blurs_nor_flickers():
    state, first = None, frame_at(None)
    out = first
    white = torch.rand(first.read("color").shape, generator=torch.Generator().manual_seed(0))
    first = first.replace(color=white)
    for _ in range(40):
        out, state = TAA()(first, state)
    assert torch.allclose(out.read("color"), white, atol=1e-3)
    results = run(64)
    sharp = [float((tone(r)[..., 1:] - tone(r)[..., :-1]).abs().mean()) for r in (results[15], results[63])]
    assert sharp[1] > 0.97 * sharp[0]


def test_constant_stays_constant_and_bright_light_stays_bright():
    for value in (0.5, 3000.0):
        state, out = None, frame_at(None)
        for index in range(6):
            frame = frame_at(halton_jitter(index))
            out, state = TAA()(frame.replace(color=torch.full_like(frame.read("color"), value)), state)
        assert torch.allclose(out.read("color"), torch.full((), value), rtol=2e-3)


def test_moving_camera_leaves_no_trails():
    """Behind the thin pole the wall comes back within four frames."""
    state, previous, out = None, None, frame_at(None)
    for index in range(12):
        frame = frame_at(halton_jitter(index), dx=0.15 * index, previous=previous)
        pole = (frame.gbuffer.material_id == 4).expand(-1, 3, -1, -1)
        frame = frame.replace(color=torch.where(pole, 4.0, 0.2))
        out, state = TAA()(frame, state)
        previous = frame.gbuffer.camera
    near = torch.nn.functional.max_pool2d(pole.float(), 5, 1, 2) > 0
    assert float((out.read("color") - 0.2).abs()[~near].max()) < 1e-4


def test_moving_camera_still_anti_aliases():
    state, previous, step, out = None, None, 0.04, frame_at(None)
    for index in range(16):
        frame = frame_at(halton_jitter(index), dx=step * index, previous=previous)
        out, state = TAA()(frame, state)
        previous = frame.gbuffer.camera
    truth = area_sampled(dx=step * 15)
    aliased = frame_at(None, dx=step * 15).read("color")
    assert rms(tone(out.read("color")) - truth) < 0.9 * rms(tone(aliased) - truth)


def test_a_spinning_plate_that_leans_does_not_drift():
    """Neighbours on one surface are nearer by a little and move unlike: their motion is not the pixel's own."""
    turn, camera, state, color = 0.12, boxes.camera(SIZE), None, torch.zeros(())
    y, x = torch.meshgrid(*(torch.arange(n) + 0.5 - n / 2 for n in SIZE), indexing="ij")
    depth = (5.0 - 0.02 * x + 0.01 * y)[None, None]
    cosine, sine = math.cos(turn), math.sin(turn)
    motion = torch.stack([cosine * x + sine * y - x, cosine * y - sine * x - y])[None]
    g = boxes.frame(camera, previous=camera).gbuffer
    g = g.replace(depth=depth, hit=torch.ones_like(depth, dtype=torch.bool), motion=motion)
    for index in range(16):
        c, s = math.cos(index * turn), math.sin(index * turn)
        u, v = c * x + s * y, c * y - s * x
        color = (0.5 + 0.4 * torch.sin(0.8 * u) * torch.sin(0.7 * v)).expand(1, 3, -1, -1)
        out, state = taa(color, g, state)
    inner = torch.hypot(y, x) < 18
    assert rms((out - color)[..., inner]) < 0.08 * rms(color[..., inner] - 0.5)


def test_cut_resets():
    pipeline, state = Pipeline(given={"color"}, taa=TAA()), None
    out = frame_at(None)
    for index in range(4):
        frame = frame_at(None)
        cut = torch.tensor([index == 3])
        frame = frame.replace(color=torch.full_like(frame.read("color"), float(index)), cut=cut)
        out, state = pipeline(frame, state)
    assert torch.allclose(out.read("color"), torch.full((), 3.0), rtol=1e-5)
    assert state is not None
    assert bool((state.stages["taa"].length == 1).all())


def test_catmull_rom_is_exact_at_pixels_and_on_straight_ramps():
    ramp = torch.arange(12.0)[None, None, None].expand(1, 1, 8, 12)
    centers = torch.stack(torch.meshgrid(torch.arange(2.5, 6), torch.arange(2.5, 9), indexing="ij")[::-1])[None]
    for shift in (0.0, 0.25, 0.5):
        at = centers + torch.tensor([shift, 0.0])[None, :, None, None]
        assert torch.allclose(catmull_rom(ramp, at), at[:, :1] - 0.5, atol=1e-5)
        aslant = centers + torch.tensor([shift, 0.3])[None, :, None, None]
        assert torch.allclose(catmull_rom(ramp, aslant), aslant[:, :1] - 0.5, atol=0.03), "corners are left out"
    white = torch.rand((1, 3, 8, 12), generator=torch.Generator().manual_seed(1))
    assert torch.allclose(catmull_rom(white, centers), white[..., 2:6, 2:9], atol=1e-5)


@pytest.mark.parametrize("case", ["orthographic", "odd", "sky", "pixel", "row", "double"])
def test_awkward_frames(case):
    size = {"odd": (127, 73), "pixel": (1, 1), "row": (1, 9)}.get(case, (24, 32))
    state, previous, out = None, None, frame_at(None)
    for index in range(3):
        camera = boxes.camera(size, orthographic=case == "orthographic", dx=0.1 * index)
        camera = camera.with_jitter(halton_jitter(index))
        frame = boxes.frame(camera, previous=previous, boxes=boxes.ROOM + 500 if case == "sky" else boxes.ROOM)
        frame = frame.replace(color=frame.radiance)
        frame = frame.to(torch.float64) if case == "double" else frame
        out, state = TAA()(frame, state)
        assert bool(torch.isfinite(out.read("color")).all())
        assert out.read("color").dtype == frame.read("color").dtype
        previous = frame.gbuffer.camera


def test_module_equals_function_and_batch_equals_loop():
    frames = [frame_at((0.2, 0.1), dx=dx) for dx in (0.0, 0.6)]
    camera = Camera(
        intrinsics=torch.cat([f.gbuffer.camera.intrinsics for f in frames]),
        world_from_view=torch.cat([f.gbuffer.camera.world_from_view for f in frames]),
        size=SIZE,
        far=frames[0].gbuffer.camera.far,
        jitter=torch.tensor([[0.2, 0.1]] * 2),
    )
    both = boxes.frame(camera)
    color = torch.cat([f.read("color") for f in frames])
    together, history = taa(color, both.gbuffer)
    together, _ = taa(color * 0.9, both.gbuffer, history)
    for i, frame in enumerate(frames):
        out, state = TAA()(frame, None)
        out, _ = TAA()(frame.replace(color=frame.read("color") * 0.9), state)
        assert torch.allclose(together[i], out.read("color")[0], atol=1e-5)


def test_gradients():
    camera = boxes.camera((4, 5)).with_jitter((0.2, -0.1))
    g = boxes.frame(camera).to(torch.float64).gbuffer
    generator = torch.Generator().manual_seed(2)
    one, two = (torch.rand((1, 3, 4, 5), dtype=torch.float64, generator=generator) + 0.5 for _ in range(2))
    inputs = (one.requires_grad_(), two.requires_grad_())

    def run_twice(first: Tensor, second: Tensor) -> Tensor:
        _, history = taa(first, g)
        return taa(second, g, history)[0]

    assert torch.autograd.gradcheck(run_twice, inputs, fast_mode=True)
    (run_twice(*inputs) ** 2).sum().backward()
    assert all(t.grad is not None and float(t.grad.abs().max()) > 1e-3 for t in inputs)


def test_errors_help():
    frame = frame_at(None)
    _, history = taa(frame.read("color"), frame.gbuffer)
    with pytest.raises(ValueError, match="blend must lie in 0 to 1, got -1"):
        taa(frame.read("color"), frame.gbuffer, blend=-1)
    small = boxes.frame(boxes.camera((8, 8)))
    with pytest.raises(ValueError, match="start with state=None"):
        taa(torch.ones(1, 3, 8, 8), small.gbuffer, history)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize(("step", "frames"), [(0.0, 14), (1.0, 14), (0.25, 5), (0.5, 4)])
def test_what_moves_by_parts_of_pixels_stays_sharp(step: float, frames: int, compiled: bool):
    """Each read of a history between pixels softens it; waves of four pixels show how much is left."""
    length, before = torch.zeros(1, 1, 8, 96), None
    motion = torch.zeros(1, 2, 8, 96)
    motion[:, 0] = -step
    for index in range(24):
        color = (0.5 + 0.3 * torch.sin((torch.arange(96) - index * step) * (math.pi / 2))).expand(1, 3, 8, 96)
        planes = color.contiguous(), None, torch.ones(1, 1, 8, 96), motion, before, length
        result, before, length = anti_alias(*planes, blend=0.93, gamma=1.25, compiled=compiled)
    middle = slice(40, 80)  # what came into the picture lately is younger
    assert float(result[..., middle].std() / color[..., middle].std()) > 0.7
    assert int(length[0, 0, 4, 60]) == frames
