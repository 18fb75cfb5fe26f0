"""Straight paths along the arcs of what spins, in torch: the definition of `post.lens.arc_op.turned`."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.sampling import shifted
from post.lens.constants import MOST_SINE, STEEP, TILT, UNTURNED


def turned_reference(motion: Tensor) -> Tensor:
    """``(B, 2, H, W)``. Argument and result are those of `post.lens.arc_op.turned`."""
    (across_x, across_y), (down_x, down_y) = (_slope(motion, *way) for way in ((1, 0), (0, 1)))
    curl = (across_y - down_x) / 2
    shear = ((across_x - down_y).square() + (across_y + down_x).square()) / 4
    trust = (2 - shear / (TILT**2 * curl.square()).clamp_min(UNTURNED)).clamp(0, 1)
    sine = (curl * trust).clamp(-MOST_SINE, MOST_SINE)
    half = sine / (1 + (1 - sine.square()).sqrt())
    longer = (1 + half.square() / 6) / (1 + half.square()).sqrt()  # an arc than its chord
    x, y = motion.split(1, dim=1)
    return torch.cat([x + half * y, y - half * x], dim=1) * longer


def _slope(motion: Tensor, dx: int, dy: int) -> tuple[Tensor, Tensor]:
    """How motion changes from pixel to pixel of one body; a change of 0 tells nothing, as that beyond a border."""
    after, before = shifted(motion, dx, dy) - motion, motion - shifted(motion, -dx, -dy)
    total, count = torch.zeros_like(motion), torch.zeros_like(motion[:, :1])
    for step in (after, before):
        square = step.square().sum(1, keepdim=True)
        counts = ((square > 0) & (square < STEEP**2)).to(step)
        total, count = total + counts * step, count + counts
    return (total / count.clamp_min(1)).split(1, dim=1)  # pyright: ignore[reportReturnType]
