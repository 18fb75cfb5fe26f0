"""Automatic exposure: how bright the scene is, as an eye that adapts would judge."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import Frame, History, TemporalPass
from gbufrt.channels import check_picture
from gbufrt.compute.resident import number
from gbufrt.history import check_history
from gbufrt.mending import finite
from gbufrt.numeric import check_between, check_for_each, check_kind, check_numbers
from post.display.constants import DARKEST
from post.display.op import histogram

DUSK = -6.5  # log2 of luminance below which eyes adapt to a part alone: between a cave by day and a moonlit village
TINY = 1e-6  # pixels
UNTIMED = 1 / 30  # seconds between frames that carry no time


def exposure(
    color: Tensor,
    previous: Tensor | None = None,
    *,
    elapsed: float | Tensor = UNTIMED,
    key: float = 0.34,
    low: float = 0.1,
    high: float = 0.9,
    min_ev: float = -8.0,
    max_ev: float = 8.0,
    speed_up: float = 3.0,
    speed_down: float = 1.0,
    night: float = 0.5,
) -> tuple[Tensor, Tensor]:
    """The factor that brings a picture's typical luminance to ``key``.

    The typical luminance is the geometric mean of the pixels between two percentiles, taken from a histogram of log
    luminance, so that a few lamps or a dark corner do not decide. Its gradient is that of the mean of those pixels.

    Args:
        color: ``(B, 3, H, W)`` linear.
        previous: ``(B,)`` log2 luminance that the eye was adapted to; NaN or None adapts at once.
        elapsed: seconds since then, a float or ``(B,)``.
        key: where the typical luminance is to land; 0.18 is middle grey.
        low: darkest share of pixels to leave out.
        high: share of pixels above which the brightest are left out.
        min_ev: least gain, in stops.
        max_ev: largest gain, in stops, before night takes its share: what is darker gets that of the limit.
        speed_up: rate per second of adapting to a brighter scene.
        speed_down: rate per second of adapting to a darker one, which eyes do more slowly.
        night: share of the stops below dusk (a luminance of 2^-6.5) that stay dark, so that night looks like night; 0
            shows it as bright as day.

    Returns:
        The factor ``(B, 1, 1, 1)`` and the log2 luminance ``(B,)`` to pass on as ``previous``.

    Raises:
        ValueError: a number is out of range.

    Source: Reinhard et al. 2002 (log average and key); percentile window and two speeds as common in engines; a key
        that falls with luminance as in Krawczyk et al. 2005.
    """
    check_picture("color", color, "linear")
    check_numbers(low=low, high=high, key=key, min_ev=min_ev, max_ev=max_ev)
    if not 0 <= low < high <= 1:
        raise ValueError(f"low and high must satisfy 0 <= low < high <= 1, got {low} and {high}")
    if not key > 0:
        raise ValueError(f"key must be positive, got {key}")
    if not min_ev <= max_ev:
        raise ValueError(f"min_ev must not exceed max_ev, got {min_ev} and {max_ev}")
    check_between(0, 1, night=night)
    check_between(0, math.inf, speed_up=speed_up, speed_down=speed_down)
    found = _typical(histogram(finite(color)), low, high).clamp(math.log2(key) - max_ev, math.log2(key) - min_ev)
    if previous is not None:
        check_kind(Tensor, "previous", previous, "; this function returned it, second, for the frame before")
        if previous.shape != found.shape:
            raise ValueError(f"previous must be ({len(color)},), one for each picture, got {tuple(previous.shape)}")
        check_between(0, math.inf, elapsed=0.0 if isinstance(elapsed, Tensor) else elapsed)
        check_for_each(len(color), elapsed=elapsed)
        before = torch.where(previous.isnan(), found, previous).to(found)
        seconds = number(elapsed, found)
        rate = torch.where(found > before, speed_up, speed_down).to(found.dtype)
        found = before + (found - before) * (1 - torch.exp(-rate * seconds))
    dark = (DUSK - found).clamp_min(0.0)
    return (key * torch.exp2(-found - night * dark)).reshape(-1, 1, 1, 1), found


def _typical(counted: Tensor, low: float, high: float) -> Tensor:
    """``(B,)``: mean log2 luminance of the pixels between two percentiles, bins at the ends counting in part.

    Pixels without any light, such as what lies beyond limited sight, do not count; a picture of them alone is as dark
    as the histogram knows.
    """
    count, total = counted.unbind(1)
    last = count.cumsum(1)
    pixels = last[:, -1:]
    inside = (torch.minimum(last, high * pixels) - torch.maximum(last - count, low * pixels)).clamp_min(0)
    mean = (total * inside / count.clamp_min(1)).sum(1) / inside.sum(1).clamp_min(TINY)
    return torch.where(pixels[:, 0] > 0, mean, DARKEST)


class Exposure(TemporalPass):
    """See `exposure`. Its state is what the eye is adapted to, and when; frames without time count as 1/30 s apart."""

    reads = frozenset({"color"})
    writes = frozenset({"exposure"})

    def __init__(
        self,
        *,
        key: float = 0.34,
        low: float = 0.1,
        high: float = 0.9,
        min_ev: float = -8.0,
        max_ev: float = 8.0,
        speed_up: float = 3.0,
        speed_down: float = 1.0,
        night: float = 0.5,
    ) -> None:
        super().__init__()
        self.key, self.low, self.high = key, low, high
        self.min_ev, self.max_ev = min_ev, max_ev
        self.speed_up, self.speed_down = speed_up, speed_down
        self.night = night

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        previous, elapsed = _remembered(frame, state)
        factor, adapted = exposure(frame.read("color"), previous, elapsed=elapsed, **self.tunables())
        value = adapted.detach().reshape(-1, 1, 1, 1)
        now = number(frame.time, value.double()).expand_as(value)
        after = History(length=torch.ones_like(value), signals={"log_luminance": value, "time": now})
        return frame.replace(exposure=factor), after


def _remembered(frame: Frame, state: History | None) -> tuple[Tensor | None, Tensor | float]:
    check_history(frame.gbuffer, state, "log_luminance", "time")
    if state is None:
        return None, UNTIMED
    known = state.length.flatten() > 0
    elapsed = frame.time - state.signals["time"].flatten()
    elapsed = torch.where(elapsed > 0, elapsed, UNTIMED)
    return torch.where(known, state.signals["log_luminance"].flatten(), torch.nan), elapsed
