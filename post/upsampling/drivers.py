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
from post.upsampling.upscale_history_kernel import INDEX, KEPT, bounded, fetch_row
from post.upsampling.upscale_kernel import NOW, SUMS, box_row, colors_row, mix_row, sums_row
from post.upsampling.upscale_samples_kernel import TENSOR, samples_row

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
def sample_rows(seen, old, luma, motion, lenses, threads):
    """See `post.upsampling.upscale_samples_kernel.samples_row`."""
    batch, _, height, width = seen.shape
    for thread in prange(threads):
        sums = np.empty((TENSOR, width + 2), np.float32)
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            samples_row(seen[b, :, y], sums, old[b], luma[b], motion[b], lenses[b], y, 0)


@scalar
def samples_pixel(i, seen, old, luma, motion, lenses):
    """As `sample_rows`, one sample."""
    b, y, x = pixel_of(i, seen.shape[2], seen.shape[3])
    sums = cuda.local.array((TENSOR, 3), np.float32)
    samples_row(seen[b, :, y, x : x + 1], sums, old[b], luma[b], motion[b], lenses[b], y, x)


samples_each = Each(samples_pixel)


@driver
def upscaled_rows(
    light, new, lengths, news, toned, small, farthest, old, seen, length, planes, across, down, lenses,
    orthographic, gamma, frames, lock, stability, weight, threads,
):  # fmt: skip
    """See `post.upsampling.upscale_op.upscaled`."""
    batch, _, height, width = new.shape
    numbers = np.float32(gamma), np.float32(frames), np.float32(stability), np.float32(weight)
    for thread in prange(threads):
        kept, now = np.empty((KEPT, width), np.float32), np.empty((NOW, width), np.float32)
        sums = np.empty((SUMS, toned.shape[3]), np.float32)
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            there = small[b], farthest[b], lenses[b], across[b], down[b], orthographic
            given = *there, old[b], seen[b], length[b], planes[b], np.float32(lock), y, 0
            _upscaled_row((new[b], light[b], lengths[b], news[b]), toned[b], given, (kept, now, sums), numbers, 0)


@scalar
def upscaled_pixel(
    i, light, new, lengths, news, toned, small, farthest, old, seen, length, planes, across, down, lenses,
    orthographic, gamma, frames, lock, stability, weight,
):  # fmt: skip
    """As `upscaled_rows`, one pixel."""
    b, y, x = pixel_of(i, new.shape[2], new.shape[3])
    kept, now = cuda.local.array((KEPT, 1), np.float32), cuda.local.array((NOW, 1), np.float32)
    sums = cuda.local.array((SUMS, 3), np.float32)
    numbers = np.float32(gamma), np.float32(frames), np.float32(stability), np.float32(weight)
    end, begin = x + 1, bounded(np.int64(across[b, INDEX, x]) - 1, toned.shape[3])
    out = new[b, :, :, x:end], light[b, :, :, x:end], lengths[b, :, x:end], news[b, :, :, x:end]
    there = small[b], farthest[b], lenses[b], across[b, :, x:end], down[b], orthographic
    there = *there, old[b], seen[b], length[b], planes[b], np.float32(lock), y, x
    some = sums[:, : min(3, toned.shape[3] - begin)]
    _upscaled_row(out, toned[b], there, (kept, now, some), numbers, begin)


upscaled_each = Each(upscaled_pixel)


@scalar
def _upscaled_row(out, toned, there, scratch, numbers, begin):
    """Pixels of a row, as many as there is room for, with samples from column ``begin`` on.

    ``there`` is what `fetch_row` takes.
    """
    (kept, now, sums), small, lens, across, down = scratch, there[0], there[2], there[3], there[4]
    seen, y = there[7], there[11]
    fetch_row(kept, *there)
    sums_row(sums, toned, down, y, begin)
    box_row(now, sums, across, down, y, begin, toned.shape[2])
    colors_row(now, kept, toned, seen, across, down, lens[22] * lens[23], y)
    mix_row(kept, now, small, across, down, numbers, y, *out)
