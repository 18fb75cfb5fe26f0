"""Shared by the slice sweeps (GTAO, bitmask, screen-space GI): taps, the arc's measure, and the sums over slices.

A slice is a plane through the ray of a pixel. Angles in it are measured from the direction toward the eye (theta) or
from the normal projected into the slice (alpha = theta - n). A sweep follows the slice in the picture, first to one
side and then to the other. The other side is the mirror image: tangent, n and the sine of n change sign.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache, reduce

import torch
from torch import Tensor

from gbufrt.compute.resident import resident
from post.margin.view import PaddedView
from post.sweep.constants import SNAP, VANISHED
from post.sweep.layout import Receivers, Receiving, Side, Slice, Tap


def sides(around: PaddedView, at: Receivers, cut: Slice) -> tuple[Side, Side]:
    """Both sides of a slice."""
    length = (cut.step_x * cut.step_x + cut.step_y * cut.step_y).sqrt()
    dx, dy, half = cut.step_x / length, cut.step_y / length, 0.5 / cut.measure
    whole = (cut.cos_n + (cut.n + math.pi / 2) * cut.sin_n) * half
    other = cut._replace(tx=-cut.tx, ty=-cut.ty, tz=-cut.tz, place=-cut.place, sin_n=-cut.sin_n, n=-cut.n)
    return (
        Side(cut, dx, dy, length, *_borders(around, at, dx, dy), half, whole),
        Side(other, -dx, -dy, length, *_borders(around, at, -dx, -dy), half, 1 - whole),
    )


def _borders(around: PaddedView, at: Receivers, dx: Tensor, dy: Tensor) -> tuple[Tensor, Tensor]:
    """Distances in pixels to the picture's border and to the end of its margin."""
    height, width = around.size
    ways = []
    for edge in (around.margin + 1, 1):
        x = torch.maximum((width - edge - 0.5 - at.column) * dx, (edge - 0.5 - at.column) * dx)
        y = torch.maximum((height - edge - 0.5 - at.row) * dy, (edge - 0.5 - at.row) * dy)
        ways.append(torch.minimum(x / (dx * dx).clamp_min(1e-12), y / (dy * dy).clamp_min(1e-12)))
    return ways[0], ways[1]


def look(around: PaddedView, at: Receivers, side: Side, px: Tensor, parallel: bool) -> Tap:
    """Read the tap ``px`` pixels from the receivers.

    The tap is the whole pixel nearest to the slice. Its point is slid along the receiver's plane into the slice. This
    keeps its height above that plane, so an open plane never occludes itself, however steep.
    """
    cut = side.cut
    column, row = (at.column + side.dx * px).round(), (at.row + side.dy * px).round()
    picked = around.at(column, row)
    z, solid = picked[:, 0], picked[:, 1]
    x, y = around.origin_x + around.pitch_x * column, around.origin_y + around.pitch_y * row
    rise, run = x * cut.nx + y * cut.ny, x * cut.tx + y * cut.ty
    if parallel:
        rise_by_z, run_by_z = cut.nz, cut.tz
        rise, run = rise + z * cut.nz - cut.level, run + z * cut.tz - cut.place
    else:
        rise_by_z, run_by_z = rise + cut.nz, run + cut.tz
        rise, run = z * rise_by_z - cut.level, z * run_by_z - cut.place
    return Tap(
        front_rise=rise,
        front_run=run,
        back_rise=rise + solid * rise_by_z,
        back_run=run + solid * run_by_z,
        z=z,
        back_z=z + solid,
        x=x,
        y=y,
        rest=picked[:, 2:],
    )


def arc_measure(rise: Tensor, run: Tensor, side: Side) -> Tensor:
    """Share of the arc's cosine-weighted measure between the direction toward the eye and a tap.

    The measure of theta is the integral of cos(t - n) |sin t|, (sin(theta) sin(alpha) + theta sin(n)) / 2.
    A tap below the receiver's plane gets the whole of this side.

    Source: Jimenez et al. 2016, section 4; sectors of equal measure after Therrien et al. 2023.
    """
    cos_n, sin_n = side.cut.cos_n, side.cut.sin_n
    sine, cosine = run * cos_n + rise * sin_n, rise * cos_n - run * sin_n
    theta = torch.atan2(sine, cosine)
    share = (run * sine / (rise * rise + run * run + 1e-20) + theta * sin_n) * side.half
    below = (rise.detach() * -1e30).clamp(SNAP, 9.0)
    return torch.minimum(share + below, side.whole).clamp_min(0)


def step(value: Tensor) -> Tensor:
    """1 where ``value`` is positive, else 0: arithmetic, because a comparison and a select cost ten times as much."""
    return (value.detach() * 1e30).clamp(0, 1)


def finish(at: Receivers, pixels: Receiving, sums: Tensor) -> tuple[Tensor, Tensor]:
    """Visibility and bent normal from sums over slices.

    The mean open direction is corrected by the error of the same slices over the whole hemisphere, whose mean direction
    is known (2/3 of the normal). An open plane therefore returns its normal whatever the slices.

    Args:
        at: all receivers.
        pixels: the same.
        sums: ``(8, B, h, w)``: weight, open weight, open direction (3), whole direction (3), view space.

    Returns:
        visibility ``(B, 1, h, w)``, 1 where nothing was hit, and bent normal ``(B, 3, h, w)``, world space, unit
        length, 0 where nothing was hit.
    """
    hit, normal = pixels.of(pixels.hit), pixels.of(pixels.normal)
    share = (sums[1] / sums[0]).clamp(0, 1)
    known = torch.stack([at.nx, at.ny, at.nz]) * (2 / 3)
    bent = pixels.camera.rotate_to_world((sums[2:5] / sums[0] + share * (known - sums[5:8] / sums[0])).movedim(0, 1))
    length2 = (bent * bent).sum(1, keepdim=True)
    bent = torch.where(length2 > VANISHED, bent * length2.clamp_min(VANISHED).rsqrt(), normal)
    return torch.where(hit, share[:, None], 1.0), torch.where(hit, bent, 0.0)


def mean_of_scales(found: list[tuple[Tensor, Tensor]], hit: Tensor, normal: Tensor) -> tuple[Tensor, Tensor]:
    """Mean of several visibilities, and of their bent normals weighted by visibility."""
    if len(found) == 1:
        return found[0]
    visibility = sum_of(share for share, _ in found) / len(found)
    bent = sum_of(share * direction for share, direction in found) / len(found)
    length2 = (bent * bent).sum(1, keepdim=True)
    bent = torch.where(length2 > VANISHED, bent * length2.clamp_min(VANISHED).rsqrt(), normal)
    return visibility, bent.masked_fill_(~hit, 0.0)


def sum_of(terms: Iterable[Tensor]) -> Tensor:
    """Their sum, without a stack of all of them in memory."""
    return reduce(torch.add, terms)


def mean_directions(sin_n: Tensor, groups: int) -> tuple[Tensor, Tensor]:
    """Mean directions of parts of the arc of equal cosine-weighted measure: along the projected normal and across it.

    Both ``(groups, B, h, w)``.
    """
    terms = resident(direction_polynomials(groups), sin_n)[..., None, None, None]
    value = terms[-1].expand(-1, *sin_n.shape)
    for term in reversed(terms[:-1].unbind(0)):
        value = value * sin_n + term
    return value[:groups], value[groups:]


@cache
def direction_polynomials(groups: int) -> tuple[tuple[float, ...], ...]:
    """Polynomials in sin(n), lowest power first, fitted to the parts' mean cos(alpha) and sin(alpha)."""
    grid = torch.linspace(-torch.pi / 2, torch.pi / 2, 65, dtype=torch.float64)
    alpha = (torch.arange(8192, dtype=torch.float64) + 0.5) / 8192 * torch.pi - torch.pi / 2
    density = alpha.cos() * (alpha + grid[:, None]).sin().abs()
    density = density / density.sum(1, keepdim=True)
    group = ((density.cumsum(1) - density / 2) * groups).long().clamp(0, groups - 1)
    means = []
    for direction in (alpha.cos(), alpha.sin()):
        total = torch.zeros(65, groups, dtype=torch.float64).scatter_add(1, group, density * direction)
        means.append(total * groups)
    powers = grid.sin()[:, None] ** torch.arange(9, dtype=torch.float64)
    return tuple(map(tuple, torch.linalg.lstsq(powers, torch.cat(means, dim=1)).solution.tolist()))
