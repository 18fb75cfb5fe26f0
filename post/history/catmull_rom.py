"""Catmull-Rom reads of a history, which keep it sharp although it moves every frame."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from gbufrt.sampling import sample

INNER = ((0, 0), (0, 1), (1, 0), (1, 1))  # (row, column) of the four taps of a bilinear footprint
OUTER = tuple((j, i) for j in range(-1, 3) for i in range(-1, 3) if (j, i) not in INNER)


def catmull_rom_taps(
    x: Tensor,
    y: Tensor,
    weight: Tensor,
    fx: Tensor,
    fy: Tensor,
    *,
    whole: Tensor,
    same: Callable[[Tensor, Tensor], Tensor],
) -> tuple[Tensor, Tensor, Tensor]:
    """Sixteen taps in place of the four of a bilinear footprint, where all four are good.

    An outer tap that is not good gives its share to the nearest of the four, as if the surface went on unchanged.

    Args:
        x: ``(B, 4, H, W)`` integer columns of the footprint: top left, top right, bottom left, bottom right.
        y: as ``x``, rows.
        weight: as ``x``, bilinear weights, kept where not ``whole``.
        fx: ``(B, H, W)`` in [0, 1): position to the right of the left taps, in pixels.
        fy: as ``fx``, below the upper taps.
        whole: ``(B, 1, H, W)`` bool: all four are good.
        same: whether pixels at columns and rows ``(B, H, W)`` are good.

    Returns:
        ``x``, ``y`` and ``weight`` ``(B, 16, H, W)``, the four first.

    Source: Catmull and Rom 1974; Yang et al. 2020 (TAA survey), section 4.1, on why histories need it.
    """
    across, down = catmull_rom_weights(fx), catmull_rom_weights(fy)
    inner = [down[j + 1] * across[i + 1] for j, i in INNER]
    xs, ys, outer = [x], [y], []
    for j, i in OUTER:
        column, row = x[:, 0] + i, y[:, 0] + j
        good = same(column, row).to(fx.dtype)
        share, nearest = down[j + 1] * across[i + 1], 2 * min(max(j, 0), 1) + min(max(i, 0), 1)
        inner[nearest] = inner[nearest] + share * (1 - good)
        xs.append(column[:, None])
        ys.append(row[:, None])
        outer.append(share * good)
    middle = torch.where(whole, torch.stack(inner, dim=1), weight)
    around = torch.where(whole, torch.stack(outer, dim=1), torch.zeros_like(fx)[:, None])
    return torch.cat(xs, dim=1), torch.cat(ys, dim=1), torch.cat([middle, around], dim=1)


def catmull_rom_weights(f: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Weights of the taps at -1, 0, 1 and 2 for a position f in [0, 1); they sum to 1."""
    square, cube = f * f, f * f * f
    return (
        square - 0.5 * (f + cube),
        1 - 2.5 * square + 1.5 * cube,
        0.5 * f + 2 * square - 1.5 * cube,
        0.5 * (cube - square),
    )


def catmull_rom(image: Tensor, px: Tensor) -> Tensor:
    """Read a picture between its pixels without softening it; positions outside read the border.

    The 4x4 kernel as five bilinear reads; the corners, a few per cent of the weight, are left out.

    Args:
        image: ``(B, C, H, W)``.
        px: ``(B, 2, h, w)`` pixels, centres at +0.5.

    Returns:
        ``(B, C, h, w)``; may overshoot the values around.

    Source: Catmull and Rom 1974; five reads after Jimenez 2016.
    """
    corner = torch.floor(px - 0.5) + 0.5
    f = px - corner
    before = f * (-0.5 + f * (1.0 - 0.5 * f))  # as `catmull_rom_weights`, by Horner: the last bits show in the dark
    first = 1.0 + f * f * (-2.5 + 1.5 * f)
    second = f * (0.5 + f * (2.0 - 1.5 * f))
    after = f * f * (-0.5 + 0.5 * f)
    middle = first + second
    at_before, at_middle, at_after = corner - 1.0, corner + second / middle, corner + 2.0
    total, result = 0.0, torch.zeros((), dtype=middle.dtype)
    for x, wx, y, wy in (
        (at_middle, middle, at_middle, middle),
        (at_before, before, at_middle, middle),
        (at_after, after, at_middle, middle),
        (at_middle, middle, at_before, before),
        (at_middle, middle, at_after, after),
    ):
        weight = wx[:, 0:1] * wy[:, 1:2]
        total = total + weight
        result = result + weight * sample(image, torch.stack([x[:, 0], y[:, 1]], dim=1))
    return result / total
