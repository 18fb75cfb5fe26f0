"""Pulse: exposure that sinks and comes back, as a heart beats."""

from __future__ import annotations

import math

from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.numeric import check_between, check_kind, check_numbers


def pulse(exposure: Tensor, time: float | Tensor, *, strength: float = 0.0, period: float = 4.0) -> Tensor:
    """Take from the exposure in the first and last quarter of each period.

    Args:
        exposure: factor on colour, of any shape.
        time: seconds; a tensor must be 0-dim and on the device of the exposure.
        strength: the largest share that is taken, at the beginning of each period; 0 changes nothing.
        period: seconds.

    Returns:
        Of the same shape.

    Raises:
        ValueError: ``strength`` is outside [0, 1], or ``period`` is not positive.

    Source: the effect Darkness of Minecraft, whose period is 80 ticks of a twentieth of a second, its strength 0.45.
    """
    check_between(0, 1, strength=strength)
    check_kind(Tensor, "exposure", exposure)
    check_numbers(period=period, time=time)
    if not isinstance(time, Tensor) and not math.isfinite(time):
        raise ValueError(f"time must be finite, in seconds, got {time}")
    if not period > 0:
        raise ValueError(f"period must be positive, in seconds, got {period}")
    turn = 2 * math.pi / period * time
    beat = turn.cos().clamp_min(0).to(exposure) if isinstance(turn, Tensor) else max(0.0, math.cos(turn))
    return exposure * (1 - strength * beat)


class Pulse(Pass):
    """See `pulse`. Adaptation of the exposure does not follow it."""

    optional = frozenset({"exposure"})
    writes = frozenset({"exposure"})

    def __init__(self, *, strength: float = 0.0, period: float = 4.0) -> None:
        super().__init__()
        self.strength, self.period = strength, period

    def forward(self, frame: Frame) -> Frame:
        present = frame.exposure
        if present is None:
            present = frame.gbuffer.depth.new_ones(frame.gbuffer.camera.batch, 1, 1, 1)
        return frame.replace(exposure=pulse(present, frame.time, **self.tunables()))
