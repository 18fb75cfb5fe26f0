"""Times that functions are given: one for all cameras, or one for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from torch import Tensor


def seconds(time: float | Tensor | Sequence[float], batch: int, name: str = "time") -> list[float]:
    """One time for each of ``batch`` cameras.

    Raises:
        TypeError: see `moments`.
        ValueError: there is another number of them, or one is not finite.
    """
    times = moments(time, name)
    if len(times) == 1 and (hasattr(time, "__float__") or batch == 1):
        return times * batch
    if len(times) != batch:
        raise ValueError(f"{name} must be one number or one for each of the {batch} cameras, got {len(times)}")
    return times


def moments(time: Any, name: str = "time") -> list[float]:
    """A number of seconds, or several, as they are given.

    Raises:
        TypeError: they are neither numbers nor 0-dim tensors.
        ValueError: there are none, or one is not finite.
    """
    try:
        given = [time] if hasattr(time, "__float__") and not getattr(time, "ndim", 0) else list(time)
        if any(isinstance(t, str) for t in given):
            raise TypeError
        times = [float(t) for t in given]
    except (TypeError, ValueError, RuntimeError):  # of torch's tensors of several numbers
        got = f"one of shape {tuple(time.shape)}" if isinstance(time, Tensor) else repr(time)
        raise TypeError(f"{name} must be seconds, one number or one for each camera, got {got}") from None
    if not times or not all(math.isfinite(t) for t in times):
        raise ValueError(f"{name} must be finite, in seconds, got {time}")
    return times
