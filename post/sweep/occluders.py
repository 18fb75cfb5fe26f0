"""What a tap of a slice occludes: the shares of its side, joined to the tap before where both are one body."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from post.margin.view import PaddedView
from post.sweep import arcs
from post.sweep.constants import EDGE
from post.sweep.layout import Receivers, Side, Tap

FADE = 0.1  # of the radius, to either side, over which detached occluders fade


class Front(NamedTuple):
    """The previous tap on the same side of a slice. Planes ``(B, h, w)``."""

    share: Tensor
    rise: Tensor
    run: Tensor
    distance: Tensor
    """0 for the receiver itself."""
    z: Tensor
    back_z: Tensor


class Cover(NamedTuple):
    """Shares of a side between which a tap occludes, and its weight within a radius, 0 to 1. Planes."""

    low: Tensor
    high: Tensor
    near: Tensor


def start(at: Receivers, side: Side, solid: Tensor) -> Front:
    """The receiver itself, as the tap before the first."""
    zero = torch.zeros_like(at.z)
    return Front(side.whole, zero, zero, zero, at.z, at.z + solid)


def own_solid(around: PaddedView, at: Receivers) -> Tensor:
    """Planar depth from front to back at the receivers."""
    return around.at(at.column, at.row, slice(1, 2))[:, 0]


def blocked(
    tap: Tap, before: Front, side: Side, radii: tuple[Tensor, ...], soft: bool, same: Tensor | None = None
) -> tuple[list[Cover], Front]:
    """The part that a tap occludes within each radius, from smallest to largest, or without limit if there is none.

    ``same`` is 1 where the tap is known to continue the surface of the one before.
    """
    joined = arcs.step(overlap(tap, before))
    joined = joined if same is None else torch.maximum(joined, same)
    rise, run = tap.front_rise, tap.front_run
    distance = (rise * rise + run * run + 1e-20).sqrt() if radii else joined
    front = arcs.arc_measure(rise, run, side)
    back = arcs.arc_measure(tap.back_rise, tap.back_run, side)
    high = back + (torch.maximum(back, before.share) - back) * joined
    crossed = _front_at_the_radius(tap, before, side, radii, distance) if radii else front
    covers = []
    for radius in radii or (None,):
        near, crossing = torch.ones_like(joined), torch.zeros_like(joined)
        if radius is not None:
            inside = arcs.step(radius - distance)
            was_inside = arcs.step(radius - before.distance) * arcs.step(before.distance)
            crossing = joined * was_inside * (1 - inside)
            faded = ((radius - distance) / (2 * FADE * radius) + 0.5).clamp(0, 1) if soft else inside
            near = torch.maximum(faded, crossing)
        first = front + (crossed - front) * crossing
        low = first + (torch.minimum(first, before.share) - first) * joined
        if same is not None:
            low = (low - (before.share - first).clamp_min(0) * same * (1 - crossing) * EDGE).clamp_min(0)
        covers.append(Cover(low, high, near))
    return covers, Front(front, tap.front_rise, tap.front_run, distance, tap.z, tap.back_z)


def overlap(tap: Tap, before: Front) -> Tensor:
    """Overlap of the depth ranges of two taps, world units: above 0 they are one body."""
    return torch.minimum(tap.back_z, before.back_z) - torch.maximum(tap.z, before.z)


def _front_at_the_radius(tap: Tap, before: Front, side: Side, radii: tuple[Tensor, ...], distance: Tensor) -> Tensor:
    """Share of the side up to where the line from the previous tap crosses the first radius beyond that tap."""
    radius = radii[-1]
    for smaller in reversed(radii[:-1]):
        radius = radius + (smaller - radius) * arcs.step(smaller - before.distance)
    left = (distance - radius) / (distance - before.distance).abs().clamp_min(1e-9)
    rise, run = tap.front_rise, tap.front_run
    return arcs.arc_measure(rise + (before.rise - rise) * left, run + (before.run - run) * left, side)
