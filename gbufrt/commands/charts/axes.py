"""Axes of charts: where values lie on them, and round ticks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

FEW = 8.0  # times the least value that the most must be for ticks at 1, 2 and 5, rather than at even steps
MOST_TICKS = 8  # where they crowd at one end
ALIKE = 1e-6  # times the largest value: values that differ by less count as one
WIDE = 300.0  # the same for ticks at powers of ten alone


@dataclass(frozen=True, kw_only=True)
class Axis:
    """Values to places from 0 to 1, by their logarithm or as they are."""

    low: float
    high: float
    ticks: Sequence[float]
    log: bool = False

    @staticmethod
    def of(values: Sequence[float], *, log: bool = False) -> Axis:
        """An axis over the values, with round ticks; a logarithmic one needs positive values."""
        if not log:
            low, high, ticks = _span(values)
            return Axis(low=low, high=high, ticks=ticks)
        low, high = min(values), max(values)
        margin = max((high / low) ** 0.04, 1.02)
        low, high = low / margin, high * margin
        if high / low < FEW:
            ticks = _span([low, high], MOST_TICKS)[2]
        else:
            decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
            steps = (1, 2, 5) if high / low < WIDE else (1,)
            ticks = [step * 10.0**decade for decade in decades for step in steps]
        return Axis(low=low, high=high, ticks=[t for t in ticks if low <= t <= high], log=True)

    def share(self, value: float) -> float:
        """Where a value lies, from 0 at the low end to 1 at the high one."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


def short(value: float) -> str:
    """A tick's number: 1000000 as 1M, 36000 as 36k."""
    if abs(value) >= 1e6:
        return f"{value / 1e6:.3g}M"
    return f"{value / 1e3:.3g}k" if abs(value) >= 1e4 else f"{value:g}"


def _span(values: Sequence[float], count: int = 5) -> tuple[float, float, list[float]]:
    """Round axis limits around the values, and round ticks between them, about ``count``."""
    low, high = min(values), max(values)
    largest = max(abs(low), abs(high))
    if high - low <= ALIKE * largest:
        low, high = low - 0.1 * (largest or 1.0), high + 0.1 * (largest or 1.0)
    raw = (high - low) / count
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if m * power >= raw * (1 - ALIKE))
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return first * step, last * step, [float(f"{i * step:.10g}") for i in range(first, last + 1)]
