"""Run the bodies of `post.history`'s kernels over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import driver, scalar
from post.history.correspondence_kernel import (
    EXPECTED,
    Channels,
    Past,
    closer,
    expected_row,
    image_motion,
    lens_at,
    shift_row,
)  # fmt: skip
from post.history.read_kernel import ALL, ROWS, any_wanted, leave_out, read_row
from post.history.taa_kernel import box_row, fetch_row, front_row, light_row, mix_row, resample_row, tone_row

cuda: Any = numba.cuda
PIECE = 64  # pixels of a row that are read at a time, or not at all where none of them is wanted


@driver
def read_rows(
    out, marks, image, depth, normal, hit, kind, motion, motion_z, look, wanted, was_depth, was_normal, was_hit,
    was_kind, length, lenses, poses, parallel, plane, cosine, search, sharp, threads,
):  # fmt: skip
    """See `post.history.read.read_history_cpu`."""
    batch, _, height, width = out.shape
    size = min(width, PIECE)
    for thread in prange(threads):
        columns, lines = np.empty(size, np.int32), np.empty(size, np.int32)
        places, rows = np.empty((ALL, size), np.uint32), np.empty((ROWS, size), np.float32)
        now, shift = np.empty((EXPECTED, size), np.float32), np.empty((2, size), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            seen, moved = Channels(depth[b], normal[b], hit[b], kind[b]), (motion[b], motion_z[b], look[b])
            was = was_depth[b], was_normal[b], was_hit[b], was_kind[b], length[b]
            past = Past(*was, height, width, lens_at(lenses[b, 1]), parallel)
            views = lens_at(lenses[b, 0]), poses[b]
            options = np.float32(plane), np.float32(cosine), search, sharp
            scratch = columns, lines, places, rows, now, shift
            new = out[b], marks[b]
            for begin in range(0, width, size):
                first = min(begin, width - size)
                _read(new, image[b], seen, moved, wanted[b], past, views, options, scratch, y, first, first + size)


@scalar
def read_pixel(
    i, out, marks, image, depth, normal, hit, kind, motion, motion_z, look, wanted, was_depth, was_normal, was_hit,
    was_kind, length, lenses, poses, parallel, plane, cosine, search, sharp,
):  # fmt: skip
    """As `read_rows`, one pixel."""
    height, width = out.shape[2:]
    b, y, x = pixel_of(i, height, width)
    columns, lines = cuda.local.array(1, np.int32), cuda.local.array(1, np.int32)
    places, rows = cuda.local.array((ALL, 1), np.uint32), cuda.local.array((ROWS, 1), np.float32)
    now, shift = cuda.local.array((EXPECTED, 1), np.float32), cuda.local.array((2, 1), np.float32)
    seen, moved = Channels(depth[b], normal[b], hit[b], kind[b]), (motion[b], motion_z[b], look[b])
    was = was_depth[b], was_normal[b], was_hit[b], was_kind[b], length[b]
    past = Past(*was, height, width, lens_at(lenses[b, 1]), parallel)
    views, options = (lens_at(lenses[b, 0]), poses[b]), (np.float32(plane), np.float32(cosine), search, sharp)
    scratch = columns, lines, places, rows, now, shift
    new = out[b], marks[b]
    _read(new, image[b], seen, moved, wanted[b], past, views, options, scratch, y, x, x + 1)


read_each = Each(read_pixel)


@scalar
def _read(new, image, seen, moved, wanted, past, views, options, scratch, y, first, end):
    """Pixels ``first`` to ``end`` of a row."""
    (out, marks), every = new, wanted.shape[0] == 0
    if not (every or any_wanted(wanted, y, first, end)):
        leave_out(out, wanted, y, first, end)
        leave_out(marks, wanted, y, first, end)
        return
    columns, lines, places, rows, now, shift = scratch
    motion, motion_z, look = moved
    (lens, pose), (plane, cosine, search, sharp) = views, options
    expected_row(now, seen, motion, motion_z, lens, past.lens, pose, past.parallel, y, first, end)
    shift_row(shift, look, y, first, end)
    read_row(
        out, marks, image, now, past, shift, plane, cosine, search, sharp, columns, lines, places, rows, y, first, end
    )
    if not every:
        leave_out(out, wanted, y, first, end)
        leave_out(marks, wanted, y, first, end)


@driver
def tone_rows(toned, color, threads):
    batch, _, height, width = color.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            tone_row(toned[row // height], color[row // height], row % height, 0, width)


@scalar
def tone_pixel(i, toned, color):
    b, y, x = pixel_of(i, color.shape[2], color.shape[3])
    tone_row(toned[b], color[b], y, x, x + 1)


tone_each = Each(tone_pixel)


@driver
def anti_alias_rows(
    out, new, lengths, toned, weights, depth, normal, rays, motion, before, ages, parallel, longest, gamma, threads
):
    """Colours, and the history after this frame."""
    batch, _, height, width = toned.shape
    for thread in prange(threads):
        current, old = np.empty((3, width), np.float32), np.empty((3, width), np.float32)
        mean, extent = np.empty((3, width), np.float32), np.empty((3, width), np.float32)
        sums, which = np.empty((6, width + 2), np.float32), np.empty(width, np.int32)
        age, in_front = np.empty(width, np.float32), np.empty((2, width), np.float32)
        scratch = current, old, mean, extent, sums, which, in_front, age
        for item in range(thread, batch * height, threads):
            b, y = item // height, item % height
            given = toned[b], weights[b], depth[b], normal[b], rays[b], motion[b], before[b], ages[b]
            _alias_row(out[b], new[b], lengths[b], given, scratch, parallel, longest, gamma, y, 0, width)


@scalar
def alias_pixel(
    i, out, new, lengths, toned, weights, depth, normal, rays, motion, before, ages, parallel, longest, gamma
):
    """As `anti_alias_rows`, one pixel."""
    b, y, x = pixel_of(i, toned.shape[2], toned.shape[3])
    current, old = cuda.local.array((3, 1), np.float32), cuda.local.array((3, 1), np.float32)
    mean, extent = cuda.local.array((3, 1), np.float32), cuda.local.array((3, 1), np.float32)
    sums, which = cuda.local.array((6, 3), np.float32), cuda.local.array(1, np.int32)
    in_front, age = cuda.local.array((2, 1), np.float32), cuda.local.array(1, np.float32)
    given = toned[b], weights[b], depth[b], normal[b], rays[b], motion[b], before[b], ages[b]
    scratch = current, old, mean, extent, sums, which, in_front, age
    _alias_row(out[b], new[b], lengths[b], given, scratch, parallel, longest, gamma, y, x, x + 1)


alias_each, image_motion_each, closer_each = Each(alias_pixel), Each(image_motion), Each(closer)


@scalar
def _alias_row(out, new, lengths, given, scratch, parallel, longest, gamma, y, first, end):
    """Pixels ``first`` to ``end`` of a row."""
    toned, weights, depth, normal, rays, motion, before, ages = given
    current, old, mean, extent, sums, which, in_front, age = scratch
    resample_row(current, sums[0], toned, weights, y, first, end)
    front_row(which, in_front[0], in_front[1], depth, normal, rays, parallel, y, first, end)
    fetch_row(old, age, which, motion, before, ages, y, first)
    box_row(mean, extent, sums, toned, current, y, first, end, np.float32(gamma))
    mix_row(new, lengths, current, old, age, mean, extent, np.float32(longest), y, first, end)
    light_row(out, new, y, first, end)
