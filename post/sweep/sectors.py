"""The sectors of a slice's arc: a bit each, or a fraction each where gradients are wanted."""

from __future__ import annotations

import torch
from torch import Tensor

from post.sweep import arcs
from post.sweep.constants import FIRST_BITS, GROUPS, PER_GROUP, SECTORS
from post.sweep.layout import Slice


def no_cover(like: Tensor, soft: bool) -> Tensor:
    """An empty cover: a mask ``(B, h, w)``, or ``(3, SECTORS, B, h, w)`` when soft.

    The soft form holds each sector's covered fraction and the two ends of its covered part.
    """
    if soft:
        empty = like.new_zeros(3, SECTORS, *like.shape)
        empty[1] = 1.0
        return empty
    return torch.zeros_like(like, dtype=torch.int32)


def cover(covered: Tensor, low: Tensor, high: Tensor, near: Tensor, dither: Tensor) -> tuple[Tensor, Tensor]:
    """Cover the sectors between two shares of the arc; also returns what is newly covered.

    Soft fractions are the mean of dithered bits: two covers of one sector add up except where they overlap.
    """
    if covered.dtype == torch.int32:
        first = (low * SECTORS + dither).int()
        last = torch.maximum((high * SECTORS + dither).int(), first)
        one = torch.ones_like(covered)
        bits = ((one << last) - (one << first)) * near.int()
        return covered | bits, bits & ~covered
    edge = torch.arange(SECTORS, dtype=low.dtype, device=low.device).view(-1, 1, 1, 1)
    begin, end = (low * SECTORS - edge).clamp(0, 1), (high * SECTORS - edge).clamp(0, 1)
    part, (before, first, last) = (end - begin).clamp_min(0), covered
    shared = (torch.minimum(end, last) - torch.maximum(begin, first)).clamp_min(0)
    fresh = torch.maximum((part - shared).clamp_min(0) * near, part * near - before).clamp_min(0)
    fresh = torch.minimum(fresh, 1 - before)
    counts, apart = part * near > 0, (begin > last) | (end < first)
    first = torch.where(counts, torch.where(apart, begin, torch.minimum(first, begin)), first)
    last = torch.where(counts, torch.where(apart, end, torch.maximum(last, end)), last)
    return torch.stack([before + fresh, first, last]), fresh


def group_shares(sectors: Tensor) -> Tensor:
    """``(GROUPS, B, h, w)``: share of each group's sectors that is set."""
    if sectors.dtype == torch.int32:
        counts = sum(((sectors >> bit) & FIRST_BITS for bit in range(1, PER_GROUP)), sectors & FIRST_BITS)
        field = (1 << PER_GROUP) - 1
        counts = torch.stack([(counts >> (PER_GROUP * g)) & field for g in range(GROUPS)])
        return counts.to(torch.float32) / PER_GROUP
    return _fractions(sectors).unflatten(0, (GROUPS, PER_GROUP)).mean(1)


def share(sectors: Tensor) -> Tensor:
    """``(B, h, w)``: share of all sectors that is set."""
    if sectors.dtype != torch.int32:
        return _fractions(sectors).mean(0)
    counts = sum(((sectors >> bit) & FIRST_BITS for bit in range(1, PER_GROUP)), sectors & FIRST_BITS)
    field = (1 << PER_GROUP) - 1
    halves = counts + (counts >> (SECTORS // 2))  # sums of up to 10 still fit a field
    total = (halves & field) + ((halves >> PER_GROUP) & field) + ((halves >> (2 * PER_GROUP)) & field)
    return total.to(torch.float32) / SECTORS


def _fractions(sectors: Tensor) -> Tensor:
    """``(SECTORS, B, h, w)`` of a soft cover, or of its newly covered part."""
    return sectors[0] if sectors.ndim == 5 else sectors


def slice_sums(cut: Slice, covered: Tensor, openness: Tensor | float = 1.0) -> Tensor:
    """One slice's part of the sums of `arcs.finish`; ``openness`` of the uncovered part: ``(GROUPS, B, h, w)``."""
    open_groups = (1 - group_shares(covered).to(cut.n.dtype)) * openness
    rise, run = arcs.mean_directions(cut.sin_n, GROUPS)
    rises = torch.stack([(open_groups * rise).mean(0), rise.mean(0)]) * cut.weight
    runs = torch.stack([(open_groups * run).mean(0), run.mean(0)]) * cut.weight
    lift, slide = torch.stack([cut.hx, cut.hy, cut.hz]), torch.stack([cut.tx, cut.ty, cut.tz])
    return torch.cat(
        [
            torch.stack([cut.weight, open_groups.mean(0) * cut.weight]),
            rises[0] * lift + runs[0] * slide,
            rises[1] * lift + runs[1] * slide,
        ]
    )
