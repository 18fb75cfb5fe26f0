"""The angles of slices about the ray: drawn in proportion to what each slice holds of the hemisphere.

A slice at angle phi from the normal's own, through a receiver whose normal makes the angle a with the direction toward
the eye, holds cos a + sin a cos(phi) n of the cosine-weighted hemisphere, with n = atan2(sin a cos phi, cos a). From
the normal's angle on, slices together hold F = sin a sin(phi) n + atan2(cos a sin phi, cos phi), which is pi / 2 at a
right angle. With angles drawn evenly in F all slices count the same. Few slices are then unbiased, which the ratio of
two weighted sums is not, and less noisy on surfaces seen at a grazing angle.

Source: the measure is that of Jimenez et al. 2016, section 4; its integral and inversion are ours.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from gbufrt.compute.resident import resident
from post.sweep.constants import COSINES, SHARES, UPRIGHT

if TYPE_CHECKING:
    from post.sweep.layout import Receivers

FINE = 4097  # angles at which F is computed to invert it


def turn(at: Receivers, share: Tensor) -> tuple[Tensor, Tensor]:
    """Cosine and sine of the angle from the first of `tangents` to the slice below which lies ``share`` of all.

    The gradient in the normal is that of these slices, which turn with it.

    Args:
        at: the receivers.
        share: ``(h, w)`` in [0, 1].
    """
    (ax, ay, az), (bx, by, bz) = tangents(at)
    along, aside = at.nx * ax + at.ny * ay + at.nz * az, at.nx * bx + at.ny * by + at.nz * bz
    length = (along * along + aside * aside).clamp_min(UPRIGHT**2).sqrt()
    tilted = length > UPRIGHT
    along = torch.where(tilted, along / length, 1.0)
    aside = torch.where(tilted, aside / length, 0.0)
    signed = 2 * share - 1
    row = (at.nx * at.vx + at.ny * at.vy + at.nz * at.vz).clamp(0, 1) * (COSINES - 1)
    column = (signed.abs() * (SHARES - 1)).expand_as(row)
    i, j = row.floor().clamp_max(COSINES - 2).long(), column.floor().clamp_max(SHARES - 2).long()
    down, right = (row - i)[..., None], (column - j)[..., None]
    known = resident(table, row)
    upper = known[i, j] + (known[i, j + 1] - known[i, j]) * right
    lower = known[i + 1, j] + (known[i + 1, j + 1] - known[i + 1, j]) * right
    cosine, sine = (upper + (lower - upper) * down).unbind(-1)
    scale = (cosine * cosine + sine * sine).rsqrt()
    cosine, sine = cosine * scale, sine * scale * signed.sign()
    return along * cosine - aside * sine, aside * cosine + along * sine


def tangents(at: Receivers) -> tuple[tuple[Tensor, Tensor, Tensor], tuple[Tensor, Tensor, Tensor]]:
    """Two unit vectors across the ray: the view's x axis made perpendicular to it, and the one across both."""
    length = (1 - at.vx * at.vx).rsqrt()
    ax, ay, az = (1 - at.vx * at.vx) * length, -at.vx * at.vy * length, -at.vx * at.vz * length
    return (ax, ay, az), (at.vy * az - at.vz * ay, at.vz * ax - at.vx * az, at.vx * ay - at.vy * ax)


@cache
def table() -> np.ndarray:
    """``(COSINES, SHARES, 2)`` float32: cosine and sine of phi where F is a share of pi / 2, by the cosine of a."""
    phi, found = np.linspace(0, math.pi / 2, FINE), []
    for cosine in np.linspace(0, 1, COSINES):
        sine = math.sqrt(1 - cosine * cosine)
        n = np.arctan2(sine * np.cos(phi), cosine)
        held = sine * np.sin(phi) * n + np.arctan2(cosine * np.sin(phi), np.cos(phi))
        angle = np.interp(np.linspace(0, math.pi / 2, SHARES), held, phi)
        found.append(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    return np.stack(found).astype(np.float32)
