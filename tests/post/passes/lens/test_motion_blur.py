"""Motion blur against many renders of the open shutter."""

from __future__ import annotations

import math

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pipeline
from post.passes.lens.motion_blur import MotionBlur, motion_blur

MOVER = 2  # the box in the middle
SIZE = (90, 120)


def moment(time: float, box: Tensor, travel: Tensor) -> tuple[Frame, Tensor, Tensor]:
    """Frame, textured colour and mask of the mover at ``time`` (in frames); box and camera move evenly."""
    world = boxes.ROOM.clone()
    world[MOVER] += box * time
    eye, target = torch.tensor([2.0, 4.0, 9.0]), torch.tensor([0.0, 1.0, 0.0])
    camera = Camera.look_at(eye + travel * time, target + travel * time, size=SIZE, fov_y=50.0, far=100.0)
    frame = boxes.frame(camera, boxes=world)
    g = frame.gbuffer
    mover = g.object_id == 1
    assert g.albedo is not None
    points = camera.to_world(g.points_view()) - mover * (box * time)[None, :, None, None]
    checker = torch.sin(points * 2.6 + 0.5).prod(dim=1, keepdim=True) > 0
    color = torch.where(g.hit, g.albedo * (0.2 + 0.8 * checker), torch.tensor([0.4, 0.55, 0.9])[None, :, None, None])
    return frame, color, mover


def exposed(box, travel, position: str, shutter: float = 0.5) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Colour, depth and motion at the frame's time; the mover's mask; the mean over the open shutter."""
    box, travel = torch.tensor(box), torch.tensor(travel)
    frame, color, mover = moment(0.0, box, travel)
    before = moment(-1.0, box, travel)[0].gbuffer.camera
    g = frame.gbuffer
    still, _ = g.camera.static_motion(before, g.depth, g.hit)
    earlier = g.camera.to_world(g.points_view()) - box[None, :, None, None]
    moving = before.project(before.to_view(earlier)) - g.camera.pixel_centers()
    start = -shutter / 2 if position == "center" else -shutter
    truth = sum((moment(start + shutter * (i + 0.5) / 32, box, travel)[1] for i in range(32)), torch.zeros(())) / 32
    return color, g.depth, torch.where(mover, moving, still), mover, truth


def psnr(image: Tensor, truth: Tensor) -> float:
    return -10 * math.log10(float((image - truth).square().mean()))


@pytest.mark.parametrize(("position", "bound"), [("center", 4.5), ("trailing", 4.2)])
@pytest.mark.parametrize("case", ["box", "camera"])
def test_gains_on_the_open_shutter(case, position, bound):
    box, travel = ([1.6, 0.0, 0.0], [0.0] * 3) if case == "box" else ([0.0] * 3, [0.9, 0.0, 0.0])
    color, depth, motion, _, truth = exposed(box, travel, position)
    blurred = motion_blur(color, depth, motion, position=position)  # type: ignore[arg-type]
    assert psnr(blurred, truth) > psnr(color, truth) + bound


def test_similarity_weights_gain_too():
    color, depth, motion, _, truth = exposed([0.0] * 3, [0.9, 0.0, 0.0], "center")
    blurred = motion_blur(color, depth, motion, weights="similarity")
    assert psnr(blurred, truth) > psnr(color, truth) + 4


def test_background_stays_sharp_and_mover_spills_over_it():
    color, depth, motion, mover, truth = exposed([1.6, 0.0, 0.0], [0.0] * 3, "center")
    blurred = motion_blur(color, depth, motion, position="center")
    untouched = ((truth - color).abs().amax(1, keepdim=True) < 1e-6) & ~mover
    away = torch.nn.functional.max_pool2d((~untouched).float(), 5, 1, 2) == 0
    assert int(away.sum()) > 5000
    assert float((blurred - color).abs()[away.expand_as(color)].max()) < 0.02
    spilled = (blurred - color).abs().amax(1, keepdim=True) > 0.02
    assert int((spilled & ~mover).sum()) > 100
    similar = motion_blur(color, depth, motion, weights="similarity")
    assert torch.allclose(similar[(~mover).expand_as(color)], color[(~mover).expand_as(color)], atol=1e-4)


def fan(time: float, turn: float, size: tuple[int, int] = (96, 96)) -> tuple[Tensor, Tensor, Tensor]:
    """Colour, mask and motion of four blades that turn by ``turn`` radians a frame, before a dark wall."""
    y, x = torch.meshgrid(*(torch.arange(n) + 0.5 - n / 2 for n in size), indexing="ij")
    angle, radius = torch.atan2(y, x) - turn * time, torch.hypot(y, x)
    along, across = radius * torch.cos(2 * angle).abs(), radius * torch.sin(2 * angle).abs()
    blades = ((across / 2 < 4) & (along > 0) & (torch.cos(2 * angle).abs() > 0.7) & (radius < 42))[None, None]
    cosine, sine = math.cos(turn), math.sin(turn)
    before = torch.stack([cosine * x + sine * y - x, cosine * y - sine * x - y])[None]
    return torch.where(blades, 0.9, 0.1).expand(-1, 3, -1, -1), blades, torch.where(blades, before, 0.0)


@pytest.mark.parametrize("position", ["center", "trailing"])
def test_all_parts_of_a_spinning_fan_spill(position):
    """Near its hub too, where nothing moves as fast as the tips of the blades, whose path leads past what comes by."""
    turn, shutter = 0.3, 1.0
    color, blades, motion = fan(0.0, turn)
    start = -shutter / 2 if position == "center" else -shutter
    moments = [fan(start + shutter * (i + 0.5) / 64, turn)[0] for i in range(64)]
    truth = torch.stack(moments).mean(0)
    depth = torch.where(blades, 3.0, 9.0)
    blurred = motion_blur(color, depth, motion, shutter=shutter, position=position)  # type: ignore[arg-type]
    y, x = torch.meshgrid(*(torch.arange(96) - 47.5,) * 2, indexing="ij")
    inner = ~blades & (torch.hypot(y, x) < 30) & ((truth - color).abs().amax(1, keepdim=True) > 0.05)
    assert int(inner.sum()) > 100
    error, sharp = ((image - truth).square()[inner.expand_as(truth)].mean() for image in (blurred, color))
    assert float(error) < 0.2 * float(sharp)


@pytest.mark.parametrize(("position", "bound"), [("center", 28), ("trailing", 21)])
def test_the_rim_of_a_wheel_stays_sharp(position, bound):
    """All of it moves along itself, on arcs: paths as straight as the chord of a frame would leave it."""
    y, x = torch.meshgrid(*(torch.arange(96) - 47.5,) * 2, indexing="ij")
    radius, turn = torch.hypot(y, x)[None, None], 0.6
    rim, cosine, sine = (radius > 34) & (radius < 42), math.cos(turn), math.sin(turn)
    motion = torch.stack([cosine * x + sine * y - x, cosine * y - sine * x - y])[None]
    color = torch.where(rim, 0.9, 0.1).expand(-1, 3, -1, -1)
    depth, motion = torch.where(rim, 3.0, 9.0), torch.where(rim, motion, 0.0)
    blurred = motion_blur(color, depth, motion, position=position)
    assert psnr(blurred, color) > bound


def test_cells_stay_small_where_paths_may_be_long():
    """Beside something that goes far past, what comes by is found: a tile's quarter would show the faster alone."""
    color, motion = torch.zeros(1, 3, 128, 400), torch.zeros(1, 2, 128, 400)
    color[..., 20:50, 100:160], motion[:, 0, 20:50, 100:160] = 1.0, 100.0
    color[..., 80:110, 240:300], motion[:, 0, 80:110, 240:300] = 1.0, 390.0
    depth = torch.where(color[:, :1] > 0, 3.0, 9.0)
    row = motion_blur(color, depth, motion, shutter=1.0, samples=64, tile=400)[0, 0, 35]
    assert torch.allclose(row[165:205], (210 - torch.arange(165, 205) - 0.5) / 100, atol=0.15)


def test_something_slower_spills_beside_something_fast():
    """Two movers a tile apart: the faster one, which does not come by, is not taken for the slower."""
    color, motion = torch.zeros(1, 3, 40, 96), torch.zeros(1, 2, 40, 96)
    color[..., 8:32, 20:32], motion[:, 0, 8:32, 20:32] = 1.0, 9.0
    color[..., 8:32, 60:72], motion[:, 1, 8:32, 60:72] = 1.0, 24.0
    depth = torch.where(color[:, :1] > 0, 3.0, 9.0)
    row = motion_blur(color, depth, motion, shutter=1.0, samples=64)[0, 0, 20]
    want = [(i - 15.0) / 9 for i in range(16, 24)]
    assert torch.allclose(row[16:24], torch.tensor(want), atol=0.1)


def test_a_line_under_even_motion_becomes_a_box():
    """All of the picture moves by 8 px: the blur is a box of 8 px, ahead of the line when trailing."""
    color = torch.zeros(1, 3, 9, 64)
    color[..., 32] = 1.0
    depth, motion = torch.ones(1, 1, 9, 64), torch.zeros(1, 2, 9, 64)
    motion[:, 0] = 8.0  # it was 8 px to the right
    row = motion_blur(color, depth, motion, shutter=1.0, samples=64)[0, 0, 4]
    assert float(row[29:36].mean()) == pytest.approx(1 / 8, rel=0.05)
    assert float(row.sum()) == pytest.approx(1.0, rel=0.05)
    assert float(row[:27].sum() + row[38:].sum()) == 0.0
    trail = motion_blur(color, depth, motion, shutter=1.0, samples=64, position="trailing")[0, 0, 4]
    assert float(trail[33:40].mean()) == pytest.approx(1 / 8, rel=0.05)
    assert float(trail[:31].sum()) == 0.0


@pytest.mark.parametrize("weights", ["reconstruction", "similarity"])
def test_what_comes_in_over_the_border_counts(weights):
    """All moves by 16 px, and beyond an edge near the border all is one colour: the edge becomes a ramp up to there."""
    color, depth, motion = torch.zeros(1, 3, 9, 48), torch.ones(1, 1, 9, 48), torch.zeros(1, 2, 9, 48)
    color[..., 4:], motion[:, 0] = 1.0, 16.0
    row = motion_blur(color, depth, motion, shutter=1.0, samples=64, weights=weights)[0, 0, 4]
    want = [(8 - 4 + i + 0.5) / 16 for i in range(12)]
    assert torch.allclose(row[:12], torch.tensor(want), atol=0.02)


def test_the_nearer_hides_the_farther():
    """A mover behind a still pole does not show through it."""
    color, depth, motion = torch.zeros(1, 3, 16, 48), torch.full((1, 1, 16, 48), 10.0), torch.zeros(1, 2, 16, 48)
    color[:, 0, :, 10:22], motion[:, 0, :, 10:22] = 1.0, 12.0  # a red mover
    color[:, 1, :, 22:26], depth[..., 22:26] = 1.0, 5.0  # a green pole before it
    blurred = motion_blur(color, depth, motion, shutter=1.0)
    assert torch.allclose(blurred[..., 22:26], color[..., 22:26], atol=0.02)
    depth[..., 22:26] = 20.0  # now behind it
    assert float(motion_blur(color, depth, motion, shutter=1.0)[:, 0, :, 22:26].max()) > 0.2


def test_stillness_changes_nothing_and_length_is_limited():
    color, depth = torch.rand(1, 3, 20, 30), torch.ones(1, 1, 20, 30)
    still = torch.zeros(1, 2, 20, 30)
    assert torch.equal(motion_blur(color, depth, still), color)
    assert torch.allclose(motion_blur(color, depth, still, weights="similarity"), color, atol=1e-6)
    line = torch.zeros(1, 1, 8, 200)
    line[..., 100] = 1.0
    fast = torch.zeros(1, 2, 8, 200)
    fast[:, 0] = 1000.0
    row = motion_blur(line, torch.ones(1, 1, 8, 200), fast, tile=16)[0, 0, 4]
    reached = row.nonzero().flatten()
    assert int(reached.min()) >= 80
    assert int(reached.max()) <= 120


@pytest.mark.parametrize("weights", ["reconstruction", "similarity"])
def test_gradients(weights):
    torch.manual_seed(3)
    color = torch.rand(1, 2, 6, 9, dtype=torch.float64, requires_grad=True)
    depth = torch.full((1, 1, 6, 9), 3.0, dtype=torch.float64)
    motion = (torch.rand(1, 2, 6, 9, dtype=torch.float64) * 0.2 + 5.03).requires_grad_()

    def blurred(c: Tensor, m: Tensor) -> Tensor:
        return motion_blur(c, depth, m, shutter=0.8, samples=2, tile=8, weights=weights)  # type: ignore[arg-type]

    for gradient in torch.autograd.grad(blurred(color, motion).square().sum(), (color, motion)):
        assert float(gradient.abs().max()) > 1e-3
    assert torch.autograd.gradcheck(blurred, (color, motion), eps=1e-7, atol=1e-4)


def test_module_equals_function():
    previous = boxes.camera(SIZE, dx=-0.5)
    frame = boxes.frame(boxes.camera(SIZE), previous=previous, index=3)
    frame = frame.replace(color=frame.radiance)
    g = frame.gbuffer
    assert g.motion is not None
    expected = motion_blur(frame.read("color"), g.depth, g.motion, shutter=0.7, index=3)
    assert torch.equal(MotionBlur(shutter=0.7)(frame).read("color"), expected)
    without = frame.replace(gbuffer=g.replace(motion=None))
    assert torch.equal(MotionBlur(shutter=0.7)(without).read("color"), expected)
    cut = frame.replace(cut=torch.tensor([True]))
    assert torch.equal(MotionBlur()(cut).read("color"), frame.read("color"))


def test_target_frame_time_keeps_the_length():
    frame = boxes.frame(boxes.camera(SIZE), previous=boxes.camera(SIZE, dx=-0.5))
    frame = frame.replace(color=frame.radiance)
    pipeline = Pipeline(blur=MotionBlur(shutter=0.5, target_frame_time=1 / 60), given={"color"})
    _, state = pipeline(frame.replace(time=1.0))
    slow, _ = pipeline(frame.replace(time=1.0 + 1 / 30), state)
    assert torch.allclose(slow.read("color"), MotionBlur(shutter=0.25)(frame).read("color"), atol=1e-4)


def test_bad_input():
    color, depth, motion = torch.rand(1, 3, 8, 8), torch.ones(1, 1, 8, 8), torch.zeros(1, 2, 8, 8)
    with pytest.raises(ValueError, match=r"motion must be \(1, ?2, ?8, ?8\)"):
        motion_blur(color, depth, motion.permute(0, 2, 3, 1))
    with pytest.raises(ValueError, match="samples must be at least 1"):
        motion_blur(color, depth, motion, samples=0)
    with pytest.raises(ValueError, match=r"depth must be .* if color is \(B,H,W,C\), use .permute"):
        motion_blur(color.permute(0, 2, 3, 1), depth, motion)
    with pytest.raises(ValueError, match="shutter must be at least 0, got nan"):
        motion_blur(color, depth, motion, shutter=float("nan"))
    with pytest.raises(ValueError, match="shutter must be at least 0, got -1"):
        motion_blur(color, depth, motion, shutter=-1.0)
    with pytest.raises(ValueError, match="position"):
        motion_blur(color, depth, motion, position="middle")  # type: ignore[arg-type]
