"""Pulse: exposure sinks at the beginning of each period, and nothing else follows."""

from __future__ import annotations

import boxes
import pytest
import torch

from post import Exposure, Pulse, pulse


def test_a_period():
    one = torch.ones(1, 1, 1, 1)
    factors = [float(pulse(one, t, strength=0.4, period=4.0)) for t in (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)]
    assert factors == pytest.approx([0.6, 1 - 0.4 * 0.5**0.5, 1.0, 1.0, 1.0, 0.6])
    assert torch.equal(pulse(one, 0.0), one)


def test_module_equals_function():
    frame = boxes.frame(boxes.camera((6, 8))).replace(time=0.3, exposure=torch.full((1, 1, 1, 1), 2.0))
    assert torch.equal(Pulse(strength=0.5)(frame).read("exposure"), pulse(frame.read("exposure"), 0.3, strength=0.5))
    alone = Pulse(strength=0.5)(frame.replace(exposure=None)).read("exposure")
    assert torch.equal(alone, pulse(torch.ones(1, 1, 1, 1), 0.3, strength=0.5))


def test_adaptation_does_not_follow():
    frame = boxes.frame(boxes.camera((6, 8)))
    frame = frame.replace(color=frame.radiance)
    adapt, beat, state, plain = Exposure(), Pulse(strength=0.5), None, None
    for i in range(4):
        at = frame.replace(index=i, time=0.1 * i)
        got, state = adapt(at, state)
        want, plain = adapt(at, plain)
        assert torch.equal(got.read("exposure"), want.read("exposure"))
        assert (beat(got).read("exposure") < want.read("exposure")).all()


@pytest.mark.parametrize(("strength", "period"), [(1.5, 4.0), (-0.1, 4.0), (0.5, 0.0)])
def test_bad_values_are_told(strength: float, period: float):
    with pytest.raises(ValueError, match="must"):
        pulse(torch.ones(1), 0.0, strength=strength, period=period)
