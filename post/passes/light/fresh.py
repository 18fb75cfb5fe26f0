"""More samples for pictures that have no history to average them with."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from gbufrt import Frame
from gbufrt.numeric import check_between, check_counts


def times(count: int, fresh: int) -> int:
    """``fresh`` times a count; it is a whole number of at least 1, or an error names it."""
    check_between(1, math.inf, fresh=fresh)
    check_counts(fresh=fresh)
    return count * fresh


def by_history(
    frame: Frame, estimate: Callable[[int], tuple[Tensor, ...]], *, first: int, later: int
) -> tuple[Tensor, ...]:
    """What an estimate finds with as many samples as each picture of a batch needs.

    Args:
        frame: whose ``previous`` and ``cut`` tell which pictures have none before them.
        estimate: maps a number of samples to ``(B, C, H, W)`` results.
        first: samples of pictures with none before them, which have no others to average with.
        later: samples of the others.
    """
    cut = None if frame.cut is None else frame.cut[:, None, None, None]
    new = len(frame.gbuffer.depth) if frame.previous is None else 0 if cut is None else int(cut.sum())
    if new in (0, len(frame.gbuffer.depth)) or first == later or cut is None:
        return estimate(first if new else later)
    few, many = estimate(later), estimate(first)
    return tuple(torch.where(cut.to(one.device), other, one) for one, other in zip(few, many, strict=True))
