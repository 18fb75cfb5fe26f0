"""Run the bodies of upsampling over pictures: rows on CPU threads, pixels on a GPU."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import allocating, driver, scalar
from post.upsampling.kernel import SPAN, Grid, upsampled_row
from post.upsampling.row_kernel import GUIDES, NEAREST, PLANES, Room, upsampled_picture_row
from post.upsampling.upscale_history_kernel import KEPT, coefficients_row, fetch_row
from post.upsampling.upscale_kernel import NOW, mix_row, now_row, sums_row

cuda: Any = numba.cuda
AROUND = SPAN * SPAN  # samples around a pixel


@allocating
@scalar
def _room(width, columns):
    rows = np.empty((GUIDES + PLANES + NEAREST + 2, columns), np.float32)
    here, planes = rows[:GUIDES], rows[GUIDES : GUIDES + PLANES]
    weights = rows[GUIDES + PLANES : GUIDES + PLANES + NEAREST]
    near, around, one = (
        np.empty((PLANES, width), np.float32),
        np.empty(AROUND, np.float32),
        np.empty((PLANES, 1), np.float32),
    )
    return Room(near, here, planes, weights, rows[-2], rows[-1], around, one)


@driver
def upsampled_rows(out, low, guide, there, plane, clear, stride, row, column, perspective, threads):
    batch, _, height, width = out.shape
    grid = Grid(stride, row, column, low.shape[2], low.shape[3])
    for thread in prange(threads):
        room = _room(width, low.shape[3])
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            upsampled_picture_row(out[b], low[b], guide[b], there[b], plane[b], clear, room, y, grid, perspective)


@scalar
def upsampled_pixel(i, out, low, guide, plane, clear, stride, row, column, perspective):
    b, y, x = pixel_of(i, out.shape[2], out.shape[3])
    grid = Grid(stride, row, column, low.shape[2], low.shape[3])
    weights, near = cuda.local.array(AROUND, np.float32), cuda.local.array((3, 1), np.float32)
    upsampled_row(out[b], low[b], guide[b], plane[b], clear, weights, near, y, x, x + 1, grid, perspective)


upsampled_each = Each(upsampled_pixel)


@driver
def coefficient_rows(out, image, taps, threads):
    """See `post.upsampling.spline.spline_coefficients`."""
    batch, _, height, width = image.shape
    for thread in prange(threads):
        rows = np.empty(width + len(taps) - 1, np.float32)
        for item in range(thread, batch * height, threads):
            coefficients_row(out[item // height], rows, image[item // height], taps, item % height)


@driver
def upscaled_rows(
    light, new, lengths, news, toned, small, farthest, curve, length, planes, across, down, lenses, orthographic,
    gamma, frames, lock, stability, weight, threads,
):  # fmt: skip
    """See `post.upsampling.upscale_op.upscaled`."""
    batch, _, height, width = new.shape
    numbers = np.float32(gamma), np.float32(frames), np.float32(stability), np.float32(weight)
    area = lenses[0, 22] * lenses[0, 23]
    for thread in prange(threads):
        kept, now = np.empty((KEPT, width), np.float32), np.empty((NOW, width), np.float32)
        sums = np.empty((9, toned.shape[3]), np.float32)
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            tables = across[b], down[b]
            there = small[b], farthest[b], lenses[b], across[b], down[b], orthographic, curve[b], length[b], planes[b]
            fetch_row(kept, *there, np.float32(lock), y)
            sums_row(sums, toned[b], down[b], y)
            now_row(now, kept, sums, toned[b], *tables, area, y)
            mix_row(new[b], light[b], lengths[b], news[b], kept, now, small[b], *tables, numbers, y)
