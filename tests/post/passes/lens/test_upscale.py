"""Temporal upscaling."""

# pyright: reportPossiblyUnboundVariable=false

from __future__ import annotations

from functools import cache
from typing import Any

import boxes
import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera, Frame
from gbufrt.noise.noise import halton_jitter
from gbufrt.sampling import pixel_centers
from post import Upscale, reactive_mask, upscale
from post.display.sharpen import sharpened

SMALL, LARGE = (30, 40), (60, 80)
STEP = 0.04  # world units a frame


@cache
def frame_at(
    size: tuple[int, int], jitter: tuple[float, float] | None, dx: float = 0.0, before: float | None = None
) -> Frame:
    """The room from a camera at dx, which was at ``before`` a frame ago; its color is its radiance."""
    previous = None if before is None else boxes.camera(size, dx=before)
    frame = boxes.frame(boxes.camera(size, dx=dx).with_jitter(jitter), previous=previous)
    return frame.replace(color=frame.radiance)


def tone(color: Tensor) -> Tensor:
    return color / (1 + color)


def error(result: Tensor, truth: Tensor) -> float:
    return float(((tone(result) - tone(truth))[..., 4:-4, 4:-4] ** 2).mean().sqrt())


def truth_at(dx: float = 0.0, count: int = 16) -> Tensor:
    """The mean of many samples in every pixel of the large picture."""
    jitters = (halton_jitter(i, length=count) for i in range(count))
    return torch.stack([frame_at(LARGE, j, dx=dx).read("color") for j in jitters]).mean(0)


def run(count: int, step: float = 0.0, **tunables: float) -> list[Tensor]:
    state, results, stage = None, [], Upscale(**{"reactivity": 0.0, **tunables})
    for index in range(count):
        frame = frame_at(SMALL, halton_jitter(index, length=32), step * index, step * max(index - 1, 0))
        out, state = stage(frame, state)
        results.append(out.read("color"))
    return results


def bicubic(dx: float = 0.0) -> Tensor:
    return F.interpolate(frame_at(SMALL, None, dx=dx).read("color"), size=LARGE, mode="bicubic")


def test_still_frames_come_near_the_supersampled_truth():
    truth, results = truth_at(), run(32)
    assert error(results[-1], truth) < 0.3 * error(bicubic(), truth)
    assert error(results[0], truth) < 1.2 * error(bicubic(), truth), "one frame alone is as good as interpolated"


def test_moving_frames_are_better_than_bicubic_by_three_decibels():
    truth, results = truth_at(STEP * 19), run(20, STEP)
    assert error(results[-1], truth) < 10 ** (-3 / 20) * error(bicubic(STEP * 19), truth)


def test_locks_keep_thin_features():
    """A pole a third of a small pixel wide, which two frames of three miss."""

    def drawn(jitter: tuple[float, float]) -> Frame:
        frame = frame_at(SMALL, jitter)
        across = pixel_centers(frame.gbuffer.depth)[:, :1] + jitter[0]
        line = ((across - 20.1).abs() < 0.17).expand(-1, 3, *SMALL)
        return frame.replace(color=torch.where(line, 3.0, 0.2))

    def seen(lock: float) -> float:
        state, stage, found = None, Upscale(lock=lock, stability=0.0, reactivity=0.0), []
        for index in range(16):
            out, state = stage(drawn(halton_jitter(index, length=32)), state)
            found.append(float(out.read("color")[..., 39:42].mean(2).max()))
        return sum(found[8:]) / 8

    assert seen(1.0) > 1.5 * seen(0.0)


def test_what_comes_into_sight_starts_anew():
    """A wall that a pole left has nothing of the pole's light after two frames."""
    state, out = None, frame_at(SMALL, None)
    for index in range(12):
        frame = frame_at(SMALL, halton_jitter(index, length=32), 0.15 * index, 0.15 * max(index - 1, 0))
        pole = (frame.gbuffer.material_id == 4).expand(-1, 3, -1, -1)
        out, state = Upscale(reactivity=0.0)(frame.replace(color=torch.where(pole, 4.0, 0.2)), state)
    whole = frame_at((120, 160), None, 0.15 * 11).gbuffer.material_id == 4  # thinner than a small pixel in places
    near = F.max_pool2d(F.max_pool2d(whole.float(), 2), 9, 1, 4) > 0
    assert float((out.read("color") - 0.2).abs().amax(1, keepdim=True)[~near].max()) < 1e-4


def test_lamps_that_move_have_no_black_rings():
    """All but a lamp is as dark as 0.2, in a room past which the camera moves."""
    state, least = None, 1.0
    for index in range(12):
        frame = frame_at(SMALL, halton_jitter(index, length=32), STEP * index, STEP * max(index - 1, 0))
        lamp = (frame.gbuffer.material_id == 4).expand(-1, 3, -1, -1)
        out, state = Upscale(reactivity=0.0)(frame.replace(color=torch.where(lamp, 40.0, 0.2)), state)
        least = min(least, float(out.read("color").min()))
    assert least > 0.199


def test_constant_stays_constant_and_bright_light_stays_bright():
    for value in (0.5, 3000.0):
        state, out = None, frame_at(SMALL, None)
        for index in range(3):
            frame = frame_at(SMALL, halton_jitter(index, length=32))
            out, state = Upscale()(frame.replace(color=torch.full_like(frame.read("color"), value)), state)
        assert torch.allclose(out.read("color"), torch.full((), value), rtol=2e-3)


def test_reactive_pixels_keep_no_history_each_channel_by_itself():
    frame = frame_at(SMALL, None)
    noise = torch.rand(1, 3, *SMALL, generator=torch.Generator().manual_seed(1))
    _, history = upscale(noise, frame.gbuffer)
    mask = torch.tensor([1.0, 0.0, 0.0]).view(1, 3, 1, 1).expand(1, 3, *SMALL)
    unclipped = 9.0  # clipping white noise would move the other channels as well
    held, _ = upscale(noise * 0.9, frame.gbuffer, history, gamma=unclipped)
    free, _ = upscale(noise * 0.9, frame.gbuffer, history, reactive=mask, gamma=unclipped)
    toned = lambda c: c / (1 + c.mul(torch.tensor([0.2126, 0.7152, 0.0722]).view(1, 3, 1, 1)).sum(1, keepdim=True))
    moved = (toned(free) - toned(held)).abs().amax((0, 2, 3))
    assert float(moved[0]) > 20 * float(moved[1:].max())


def test_the_mask_knows_glass_and_mirrors():
    g = frame_at(SMALL, None).gbuffer
    clear = g.replace(transmittance=torch.full_like(g.normal, 0.6), roughness=torch.ones_like(g.depth))
    assert torch.allclose(reactive_mask(clear)[g.hit], torch.tensor(0.6))
    smooth = g.replace(transmittance=None, roughness=torch.zeros_like(g.depth))
    assert bool((reactive_mask(smooth)[g.hit] > 0.03).all())
    assert float(reactive_mask(smooth)[~g.hit].sum()) == 0.0


def test_few_samples_draw_edges_at_once():
    """After four frames a pixel has one sample or so; with round kernels, error is half of bicubic interpolation's."""
    assert error(run(4)[-1], truth_at()) < 0.43 * error(bicubic(), truth_at())


def test_samples_that_lie_beside_pixels_do_not_blur_what_moves():
    """Error is 0.367 of bicubic interpolation's; without what the history shows where they lie, 0.385."""
    assert error(run(20, STEP)[-1], truth_at(STEP * 19)) < 0.376 * error(bicubic(STEP * 19), truth_at(STEP * 19))


def test_sharpening_stays_in_range_and_leaves_flat_places():
    white = torch.rand((1, 3, 12, 12), generator=torch.Generator().manual_seed(3))
    sharp = sharpened(white, 1.0)
    assert float(sharp.min()) >= 0
    assert float(sharp.max()) <= 1
    assert sharp.std() > white.std()
    assert torch.allclose(sharpened(torch.full_like(white, 0.3), 1.0), torch.tensor(0.3))
    plain, _ = upscale(white, frame_at((12, 12), None).gbuffer)
    crisp, _ = upscale(white, frame_at((12, 12), None).gbuffer, sharpness=1.0)
    assert tone(crisp).std() > tone(plain).std()


@pytest.mark.parametrize("case", ["orthographic", "odd", "sky", "pixel", "row", "double", "ratio 1", "ratio 1.5"])
def test_awkward_frames(case):
    size = {"odd": (37, 63), "pixel": (1, 1), "row": (1, 9)}.get(case, (12, 16))
    ratio = {"ratio 1": 1.0, "ratio 1.5": 1.5}.get(case, 3.0)
    state, previous, out = None, None, None
    for index in range(2):
        camera = boxes.camera(size, orthographic=case == "orthographic", dx=0.1 * index)
        camera = camera.with_jitter(halton_jitter(index))
        frame = boxes.frame(camera, previous=previous, boxes=boxes.ROOM + 500 if case == "sky" else boxes.ROOM)
        frame = frame.replace(color=frame.radiance)
        frame = frame.to(torch.float64) if case == "double" else frame
        out, state = Upscale(ratio=ratio)(frame, state)
        assert bool(torch.isfinite(out.read("color")).all())
        assert out.read("color").dtype == frame.read("color").dtype
        assert out.read("color").shape[2:] == (round(size[0] * ratio), round(size[1] * ratio))
        previous = frame.gbuffer.camera


def test_module_equals_function_and_batch_equals_loop():
    frames = [frame_at(SMALL, jitter, dx=dx) for jitter, dx in (((0.2, 0.1), 0.0), ((-0.4, 0.3), 0.6))]
    camera = Camera(
        intrinsics=torch.cat([f.gbuffer.camera.intrinsics for f in frames]),
        world_from_view=torch.cat([f.gbuffer.camera.world_from_view for f in frames]),
        size=SMALL,
        far=frames[0].gbuffer.camera.far,
        jitter=torch.tensor([[0.2, 0.1], [-0.4, 0.3]]),
    )
    both = boxes.frame(camera)
    color = torch.cat([f.read("color") for f in frames])
    together, history = upscale(color, both.gbuffer)
    together, _ = upscale(color * 0.9, both.gbuffer, history)
    for i, frame in enumerate(frames):
        stage = Upscale(reactivity=0.0)
        _, state = stage(frame, None)
        out, _ = stage(frame.replace(color=frame.read("color") * 0.9), state)
        assert torch.allclose(together[i], out.read("color")[0], atol=1e-5)


def test_gradients():
    g = boxes.frame(boxes.camera((4, 5)).with_jitter((0.2, -0.1))).to(torch.float64).gbuffer
    generator = torch.Generator().manual_seed(2)
    one, two = (torch.rand((1, 3, 4, 5), dtype=torch.float64, generator=generator) + 0.5 for _ in range(2))
    inputs = (one.requires_grad_(), two.requires_grad_())

    def run_twice(first: Tensor, second: Tensor) -> Tensor:
        _, history = upscale(first, g, lock=0.0)
        return upscale(second, g, history, lock=0.0)[0]  # locks are light's too, and pass no gradients

    assert torch.autograd.gradcheck(run_twice, inputs, fast_mode=True)
    (run_twice(*inputs) ** 2).sum().backward()
    assert all(t.grad is not None and float(t.grad.abs().max()) > 1e-3 for t in inputs)


def test_errors_help():
    frame = frame_at((8, 8), None)
    color = frame.read("color")
    _, history = upscale(color, frame.gbuffer)
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"ratio": 5.0}, "ratio must lie in 1 to 4, got 5"),
        ({"frames": 0.0}, "frames must be at least 1"),
        ({"sharpness": 2.0}, "sharpness must lie in 0 to 1"),
        ({"reactive": torch.ones(1, 2, 8, 8)}, "reactive must be"),
        ({"ratio": 3.0, "history": history}, "start with state=None"),
    ]
    for what, message in wrong:
        with pytest.raises(ValueError, match=message):
            upscale(color, frame.gbuffer, **what)
    with pytest.raises(ValueError, match=r"color must be .1,3,8,8.*the camera sets the size"):
        upscale(color[..., :4], frame.gbuffer)
