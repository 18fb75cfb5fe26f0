"""Run the row body of `post.upsampling.kernel` over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import driver, scalar
from post.upsampling.kernel import SPAN, Grid, upsampled_row

cuda: Any = numba.cuda
AROUND = SPAN * SPAN  # samples around a pixel


@driver
def upsampled_rows(out, low, guide, plane, clear, stride, row, column, perspective, threads):
    batch, _, height, width = out.shape
    grid = Grid(stride, row, column, low.shape[2], low.shape[3])
    for thread in prange(threads):
        weights, near = np.empty(AROUND, np.float32), np.empty((3, width), np.float32)
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            upsampled_row(out[b], low[b], guide[b], plane[b], clear, weights, near, y, 0, width, grid, perspective)


@scalar
def upsampled_pixel(i, out, low, guide, plane, clear, stride, row, column, perspective):
    b, y, x = pixel_of(i, out.shape[2], out.shape[3])
    grid = Grid(stride, row, column, low.shape[2], low.shape[3])
    weights, near = cuda.local.array(AROUND, np.float32), cuda.local.array((3, 1), np.float32)
    upsampled_row(out[b], low[b], guide[b], plane[b], clear, weights, near, y, x, x + 1, grid, perspective)


upsampled_each = Each(upsampled_pixel)
