"""Automatic exposure: what it meters, and how it adapts."""

from __future__ import annotations

import math

import boxes
import pytest
import torch

from gbufrt import Frame, Pipeline
from post.passes.display.exposure import Exposure, exposure


def lit(level: float, *, time: float = 0.0, size: tuple[int, int] = (12, 16)) -> Frame:
    frame = boxes.frame(boxes.camera(size))
    return frame.replace(color=torch.full((1, 3, *size), level), time=time)


def test_an_even_picture_lands_on_the_key():
    for level in (0.0125, 0.18, 3.0, 40.0):
        factor, adapted = exposure(torch.full((1, 3, 9, 9), level), key=0.18)
        assert float(factor) * level == pytest.approx(0.18, rel=1e-4)
        assert float(adapted) == pytest.approx(math.log2(level), abs=1e-4)
    assert float(exposure(torch.full((1, 3, 9, 9), 0.5), key=0.5)[0]) == pytest.approx(1.0, rel=1e-4)


def test_night_stays_dark_by_its_share():
    gain = lambda level, **k: float(exposure(torch.full((1, 3, 4, 4), level), **k)[0])
    moonlit = 2.0**-8.5  # two stops below dusk
    assert gain(moonlit, night=0.0) == pytest.approx(0.34 / moonlit, rel=1e-4)
    assert gain(moonlit) == pytest.approx(0.34 / moonlit / 2, rel=1e-4)
    assert gain(moonlit, night=1.0) == pytest.approx(gain(2.0**-6.5), rel=1e-4)
    assert gain(0.02, night=1.0) == gain(0.02, night=0.0)
    with pytest.raises(ValueError, match=r"night must lie in 0 to 1, got 1.5"):
        exposure(torch.ones(1, 3, 4, 4), night=1.5)


def test_only_the_window_counts():
    """Ten dark tenths to ten bright ones; the sixth to ninth are metered, the bin at the end in part."""
    levels = (
        torch.tensor([2.0 ** (i - 5) for i in range(10)])
        .repeat_interleave(10)
        .reshape(1, 1, 10, 10)
        .expand(1, 3, 10, 10)
    )
    _, adapted = exposure(levels, low=0.5, high=0.9)
    assert float(adapted) == pytest.approx((0 + 1 + 2 + 3) / 4, abs=1e-4)
    _, part = exposure(levels, low=0.55, high=0.9)
    assert float(part) == pytest.approx((0.5 * 0 + 1 + 2 + 3) / 3.5, abs=1e-4)
    lamps = levels.clone()
    lamps[..., -1, :5] = 1e5
    assert torch.equal(exposure(lamps, low=0.5, high=0.9)[1], adapted)


def test_brighter_is_adapted_to_faster_than_darker():
    seconds = 0.25
    bright, dark = torch.full((1, 3, 4, 4), 8.0), torch.full((1, 3, 4, 4), 0.125)
    _, up = exposure(bright, torch.tensor([0.0]), elapsed=seconds, speed_up=3.0, speed_down=1.0)
    _, down = exposure(dark, torch.tensor([0.0]), elapsed=seconds, speed_up=3.0, speed_down=1.0)
    assert float(up) == pytest.approx(3 * (1 - math.exp(-3 * seconds)), rel=1e-4)
    assert float(down) == pytest.approx(-3 * (1 - math.exp(-1 * seconds)), rel=1e-4)


def test_adaptation_does_not_depend_on_the_frame_rate():
    def after_a_second(frames: int) -> float:
        stage, state = Exposure(), None
        _, state = stage(lit(1.0), state)
        for i in range(frames):
            _, state = stage(lit(16.0, time=(i + 1) / frames), state)
        return float(state.signals["log_luminance"])

    assert after_a_second(10) == pytest.approx(after_a_second(60), rel=1e-3)
    assert after_a_second(10) == pytest.approx(4 * (1 - math.exp(-3)), rel=1e-3)


def test_first_frame_adapts_at_once_then_converges():
    stage = Exposure(key=0.18)
    frame, state = stage(lit(0.5))
    assert float(frame.read("exposure")) == pytest.approx(0.36, rel=1e-4)
    factors = []
    for _ in range(400):  # frames without time
        frame, state = stage(lit(2.0), state)
        factors.append(float(frame.read("exposure")))
    assert factors == sorted(factors, reverse=True)
    assert factors[0] > 0.3
    assert factors[-1] == pytest.approx(0.09, rel=1e-3)


def test_a_cut_adapts_at_once():
    pipeline = Pipeline(exposure=Exposure(key=0.18), given={"color"})
    _, state = pipeline(lit(0.1))
    slow, _ = pipeline(lit(10.0), state)
    cut, _ = pipeline(lit(10.0).replace(cut=torch.tensor([True])), state)
    assert float(cut.read("exposure")) == pytest.approx(0.018, rel=1e-3)
    assert float(slow.read("exposure")) > 0.5


def test_black_and_blinding_pictures_stay_within_the_stops():
    for level, expected in ((0.0, 2.0**6), (1e30, 2.0**-5)):
        factor, adapted = exposure(torch.full((1, 3, 5, 7), level), min_ev=-5, max_ev=6, night=0)
        assert float(factor) == pytest.approx(expected, rel=1e-4)
        assert torch.isfinite(adapted).all()


def test_batch_elements_are_metered_alone():
    color = torch.rand(3, 3, 11, 13) * torch.tensor([0.1, 1.0, 30.0])[:, None, None, None]
    together, _ = exposure(color, torch.tensor([0.0, torch.nan, 2.0]))
    for b, before in enumerate((0.0, torch.nan, 2.0)):
        alone, _ = exposure(color[b : b + 1], torch.tensor([before]))
        assert torch.allclose(alone[0], together[b])


def test_module_equals_function():
    color = torch.rand(1, 3, 12, 16) * 4
    frame, _ = Exposure(key=0.3, low=0.2)(lit(1.0).replace(color=color))
    assert torch.equal(frame.read("exposure"), exposure(color, key=0.3, low=0.2)[0])


def test_gradients():
    torch.manual_seed(2)
    color = (torch.rand(1, 3, 5, 6, dtype=torch.float64) + 0.1).requires_grad_()
    (gradient,) = torch.autograd.grad(exposure(color)[0].sum(), color)
    assert float(gradient.abs().max()) > 1e-4
    assert torch.autograd.gradcheck(lambda c: exposure(c), (color,), eps=1e-7)


def test_bad_input():
    with pytest.raises(ValueError, match="low and high"):
        exposure(torch.rand(1, 3, 4, 4), low=0.9, high=0.5)
    with pytest.raises(ValueError, match="key must be positive"):
        exposure(torch.rand(1, 3, 4, 4), key=0.0)


def test_pixels_without_light_do_not_count_unless_all_are_so():
    lit = torch.rand(1, 3, 8, 10) + 0.1
    black = torch.zeros_like(lit)
    alone, beside = exposure(lit)[0], exposure(torch.cat([lit, black], dim=3))[0]
    assert torch.allclose(alone, beside)
    assert torch.isfinite(exposure(black)[0]).all()
    both = exposure(torch.cat([torch.cat([lit, black], dim=3), torch.cat([black, black], dim=3)]))[0]
    assert torch.allclose(both[:1], alone), "batch equals loop"
