"""Changes of light that the samples of one frame tell from noise, against what the cells of a cache hold."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.luminance import luminance
from tracer.cache.cells import COARSE, FINE, around, level_of

REGION = 16  # world units: side of the cubes whose cells are tested together
DEVIATIONS = 3.0  # of the noise, below which a difference is no change
NOTICED = 0.1  # of the light: smaller changes are left to what cells forget by themselves
LEAST = 8  # samples below which their spread is unknown
POWER = 4  # of how far a change goes beyond noise, by which cells forget


@dataclass(frozen=True, eq=False, kw_only=True)
class Batch:
    """Samples of one frame in each of N cells.

    Args:
        count: ``(N,)`` how many.
        total: ``(N, 3)`` sum of their radiance.
        squares: ``(N,)`` sum of squares of their luminance.
    """

    count: Tensor
    total: Tensor
    squares: Tensor


def unchanged(keys: Tensor, mean: Tensor, weight: Tensor, batch: Batch) -> Tensor:
    """Share of what each cell holds that a frame's samples leave credible.

    Coarse cells are tested alone and with all others, whichever way they face, in a cube of `REGION`: what one cell
    has too few samples to tell from noise, a room full of them tells in one frame. The differences of samples from
    what their own cells hold are averaged, so that neither edges of light nor bright and dark cells count as noise.
    Noise is the spread of those differences, and the mean of a few samples is as unsure as they are few. Fine cells
    follow their coarse one.

    Args:
        keys: ``(N,)`` int64, ascending, of cells of both levels.
        mean: ``(N, 3)`` what they hold.
        weight: ``(N,)`` samples in it.
        batch: of this frame.

    Returns:
        ``(N,)`` in [0, 1]: 1 where differences are noise, or small, or unknown; (what noise allows / difference)^4
        beyond.
    """
    rows = (level_of(keys) == COARSE).nonzero()[:, 0]
    n, held = batch.count[rows].float(), luminance(mean[rows])[:, 0]
    total, squares = luminance(batch.total[rows])[:, 0], batch.squares[rows]
    tested = (weight[rows] > 0) & (n > 0)
    unsure = n + n * n / weight[rows].clamp_min(1e-9)
    difference, spread = total - n * held, (squares - 2 * held * total + n * held * held).clamp_min(0.0)
    columns = torch.stack([n, difference, spread, unsure, n * held], dim=1) * tested[:, None]
    _, cube, cells = torch.unique(around(keys[rows], REGION), return_inverse=True, return_counts=True)
    together = segments(columns[torch.argsort(cube, stable=True)], cells)
    share = torch.ones_like(weight)
    share[rows] = torch.minimum(_credible(columns), _credible(together)[cube])
    fine = (level_of(keys) == FINE).nonzero()[:, 0]
    wanted = around(keys[fine])
    coarse = torch.searchsorted(keys, wanted).clamp_max(max(len(keys) - 1, 0))
    share[fine] = torch.where(keys[coarse] == wanted, share[coarse], 0.0)  # none reads a fine cell alone
    return share


def segments(values: Tensor, count: Tensor) -> Tensor:
    """``(N, C)`` sums of as many consecutive rows as ``count`` ``(N,)`` says, the same in every run."""
    ends = count.cumsum(0)
    upto = torch.cat([values.new_zeros(1, values.shape[1], dtype=torch.float64), values.double().cumsum(0)])
    return (upto[ends] - upto[ends - count]).to(values.dtype)


def _credible(columns: Tensor) -> Tensor:
    """See `unchanged`; ``columns`` ``(N, 5)`` are sums over samples: of 1, of differences from what is held, of their
    squares, of the variance of the difference in units of a sample's, and of what is held."""
    n, difference, spread, unsure, held = columns.unbind(dim=1)
    noise = (spread / n.clamp_min(1.0) * unsure).sqrt()
    allowed = DEVIATIONS * noise + NOTICED * held.abs()
    share = (allowed / difference.abs().clamp_min(1e-12)).clamp_max(1.0) ** POWER
    return torch.where(n >= LEAST, share, 1.0)
