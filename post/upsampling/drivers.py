"""Run the bodies of upsampling over pictures: rows on CPU threads, pixels on a GPU."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import allocating, driver, scalar
from post.upsampling.kernel import SPAN, Grid, upsampled_row
from post.upsampling.remap_kernel import TAPS
from post.upsampling.row_kernel import GUIDES, NEAREST, PLANES, Room, upsampled_picture_row
from post.upsampling.upscale_history_kernel import INDEX, KEPT, SCRATCH, Past, Small, fetch_row
from post.upsampling.upscale_kernel import NOW, SUMS, box_row, colors_row, keep_row, mix_row, sums_row
from post.upsampling.upscale_samples_kernel import SCRATCH as SAMPLE_SCRATCH
from post.upsampling.upscale_samples_kernel import TENSOR, samples_row

cuda: Any = numba.cuda
AROUND = SPAN * SPAN  # samples around a pixel
PIECE = 256  # pixels of a row that are upscaled at a time: rows of scratch stay in the cache


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
def sample_rows(seen, old, length, mirrored, size, luma, motion, lenses, threads):
    """See `post.upsampling.upscale_samples_kernel.samples_row`."""
    batch, _, height, width = seen.shape
    for thread in prange(threads):
        sums = np.empty((TENSOR, width + 2), np.float32)
        scratch = np.empty((TAPS, width), np.int32), np.empty((SAMPLE_SCRATCH, width), np.float32)
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            given = old[b], length[b], mirrored[b], size, luma[b], motion[b], lenses[b]
            samples_row(seen[b, :, y], sums, scratch, *given, y, 0)


@scalar
def samples_pixel(i, seen, old, length, mirrored, size, luma, motion, lenses):
    """As `sample_rows`, one sample."""
    b, y, x = pixel_of(i, seen.shape[2], seen.shape[3])
    sums = cuda.local.array((TENSOR, 3), np.float32)
    scratch = cuda.local.array((TAPS, 1), np.int32), cuda.local.array((SAMPLE_SCRATCH, 1), np.float32)
    given = old[b], length[b], mirrored[b], size, luma[b], motion[b], lenses[b]
    samples_row(seen[b, :, y, x : x + 1], sums, scratch, *given, y, x)


samples_each = Each(samples_pixel)


@driver
def upscaled_rows(
    light, new, lengths, news, toned, surfaces, depths, old, seen, length, planes, across, down, lenses,
    orthographic, low, gamma, frames, lock, stability, weight, threads,
):  # fmt: skip
    """See `post.upsampling.upscale_op.upscaled`."""
    batch, _, height, width = new.shape
    numbers = np.float32(gamma), np.float32(frames), np.float32(stability), np.float32(weight)
    size = min(width, PIECE)
    for thread in prange(threads):
        kept, now = np.empty((KEPT, size), np.float32), np.empty((NOW, size), np.float32)
        scratch = np.empty((TAPS, size), np.int32), np.empty((SCRATCH, size), np.float32)
        sums = np.empty((SUMS, low[1]), np.float32)
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            past = Past(old[b], length[b], planes[b], height, width)
            given = surfaces[b], depths[b], toned[b], seen[b], lenses[b], across[b], down[b], orthographic
            out = new[b], light[b], lengths[b], news[b]
            for begin in range(0, width, size):
                first = min(begin, width - size)
                small = Small(*given, low[0], low[1], y, first, first + size)
                _upscaled_row(out, small, past, np.float32(lock), (kept, now, sums, scratch), numbers)


@scalar
def upscaled_pixel(
    i, light, new, lengths, news, toned, surfaces, depths, old, seen, length, planes, across, down, lenses,
    orthographic, low, gamma, frames, lock, stability, weight,
):  # fmt: skip
    """As `upscaled_rows`, one pixel."""
    b, y, x = pixel_of(i, new.shape[2], new.shape[3])
    kept, now = cuda.local.array((KEPT, 1), np.float32), cuda.local.array((NOW, 1), np.float32)
    scratch = cuda.local.array((TAPS, 1), np.int32), cuda.local.array((SCRATCH, 1), np.float32)
    sums = cuda.local.array((SUMS, 3), np.float32)
    numbers = np.float32(gamma), np.float32(frames), np.float32(stability), np.float32(weight)
    past = Past(old[b], length[b], planes[b], new.shape[2], new.shape[3])
    given = surfaces[b], depths[b], toned[b], seen[b], lenses[b], across[b], down[b], orthographic
    small, out = Small(*given, low[0], low[1], y, x, x + 1), (new[b], light[b], lengths[b], news[b])
    _upscaled_row(out, small, past, np.float32(lock), (kept, now, sums, scratch), numbers)


upscaled_each = Each(upscaled_pixel)


@scalar
def _upscaled_row(out, small, past, lock, room, numbers):
    """Some pixels of a row."""
    (kept, now, sums, scratch), index = room, small.across[INDEX]
    begin, end = max(np.int64(index[small.first]) - 1, 0), min(np.int64(index[small.end - 1]) + 2, small.width)
    some, (new, light, length, planes) = sums[:, : end - begin], out
    fetch_row(kept, small, past, lock, scratch)
    sums_row(some, small, begin)
    box_row(now, some, small, begin)
    colors_row(now, kept, small, scratch)
    mix_row(kept, now, small, scratch[1], numbers, new, light, length)
    keep_row(kept, now, small, scratch, planes)
