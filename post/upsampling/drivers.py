"""Run the row body of `post.upsampling.kernel` over pictures on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver
from post.upsampling.kernel import SPAN, Grid, upsampled_row


@driver
def upsampled_rows(out, low, guide, plane, clear, stride, row, column, perspective, threads):
    batch, _, height, _ = out.shape
    grid = Grid(stride, row, column, low.shape[2], low.shape[3])
    for thread in prange(threads):
        weights, near = np.empty(SPAN * SPAN, np.float32), np.empty((3, out.shape[3]), np.float32)
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            upsampled_row(out[b], low[b], guide[b], plane[b], clear, weights, near, y, grid, perspective)
