"""Run the bodies of `post.history.accumulate_kernel` over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import driver, scalar
from post.filters.constants import COARSE_POWER, MOST_PLANES
from post.filters.kernel import edge_of
from post.history.accumulate_kernel import (
    age_row,
    alike_row,
    blend_row,
    difference_row,
    explained_row,
    fast_row,
    noise_row,
    sample_row,
)
from post.history.constants import POOL

cuda: Any = numba.cuda
POOLED = 1 + 2 * POOL


@driver
def sample_rows(sample, noise, bits, signal, state, guide, plane, perspective, lead, firefly, follows, threads):
    """See `_sample_row`."""
    batch, _, height, width = signal.shape
    for thread in prange(threads):
        scratch = np.empty(width, np.float32), np.empty((5, width + 2 * POOL), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            given = signal[b], state[b], guide[b], plane[b], perspective, lead, firefly, follows
            _sample_row(sample[b], noise[b], bits[b], scratch, given, y, 0, width)


@scalar
def sample_pixel(i, sample, noise, bits, signal, state, guide, plane, perspective, lead, firefly, follows):
    b, y, x = pixel_of(i, signal.shape[2], signal.shape[3])
    scratch = cuda.local.array(1, np.float32), cuda.local.array((5, POOLED), np.float32)
    given = signal[b], state[b], guide[b], plane[b], perspective, lead, firefly, follows
    _sample_row(sample[b], noise[b], bits[b], scratch, given, y, x, x + 1)


@scalar
def _sample_row(sample, noise, bits, scratch, given, y, first, end):
    """What is known before histories move: the samples without fireflies, their noise, and which neighbours count."""
    signal, state, guide, plane, perspective, lead, firefly, follows = given
    weights, sums = scratch
    own = noise[y, first:end]
    noise_row(own, sums, state, signal.shape[0] + lead, y, first, end)
    sample_row(sample, sums, signal, state, own, lead, np.float32(firefly), y, first, end)
    if follows:
        edge = edge_of(guide, perspective, 1.0, COARSE_POWER)
        alike_row(bits, weights, guide, plane, state[state.shape[0] - 1], edge, y, first, end)


@driver
def fast_rows(fast, sample, noise, bits, state, lead, clamp, threads):
    """See `_fast_row`."""
    batch, _, height, width = sample.shape
    for thread in prange(threads):
        sums, rows = np.zeros((lead, width), np.float32), np.ones((2, width), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            given = sample[b], noise[b], bits[b], state[b]
            _fast_row(fast[b], given, sums, rows, lead, sample.shape[1], clamp, y, 0, width)


@scalar
def fast_pixel(i, fast, sample, noise, bits, state, lead, channels, clamp):
    """One pixel; ``lead`` and ``channels`` are as long as what they count, so that sums stay in registers."""
    b, y, x = pixel_of(i, sample.shape[2], sample.shape[3])
    sums, rows = cuda.local.array((MOST_PLANES, 1), np.float32), cuda.local.array((2, 1), np.float32)
    sums[:] = 0
    rows[:] = 1
    given = sample[b], noise[b], bits[b], state[b]
    _fast_row(fast[b], given, sums, rows, len(lead), len(channels), clamp, y, x, x + 1)


@scalar
def _fast_row(fast, given, sums, rows, lead, channels, clamp, y, first, end):
    """The fast history after it has followed the sample."""
    (sample, noise, bits, state), limit = given, np.float32(clamp)
    if clamp > 0:
        difference_row(sums, rows[0], bits, sample, state[channels:], lead, y, first, end)
        explained_row(rows[1], sums, rows[0], noise, state, lead, channels, limit, False, y, first, end)
    fast_row(fast, sums, state, lead, channels, y, first, end)


@driver
def blend_rows(out, fast, sample, noise, bits, state, longest, lead, clamp, threads):
    """See `_blend_row`."""
    batch, _, height, width = sample.shape
    for thread in prange(threads):
        sums, rows = np.zeros((lead, width), np.float32), np.ones((2, width), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            given = fast[b], sample[b], noise[b], bits[b], state[b], longest[b]
            _blend_row(out[b], given, sums, rows, lead, sample.shape[1], clamp, y, 0, width)


@scalar
def blend_pixel(i, out, fast, sample, noise, bits, state, longest, lead, channels, clamp):
    """One pixel; see `fast_pixel`."""
    b, y, x = pixel_of(i, sample.shape[2], sample.shape[3])
    sums, rows = cuda.local.array((MOST_PLANES, 1), np.float32), cuda.local.array((2, 1), np.float32)
    sums[:] = 0
    rows[:] = 1
    given = fast[b], sample[b], noise[b], bits[b], state[b], longest[b]
    _blend_row(out[b], given, sums, rows, len(lead), len(channels), clamp, y, x, x + 1)


@scalar
def _blend_row(out, given, sums, rows, lead, channels, clamp, y, first, end):
    """The state after this frame: the slow history follows the fast one, and both take the sample in."""
    (fast, sample, noise, bits, state, longest), limit = given, np.float32(clamp)
    if clamp > 0:
        difference_row(sums, rows[0], bits, fast, state, lead, y, first, end)
        explained_row(rows[1], sums, rows[0], noise, state, lead, channels, limit, True, y, first, end)
    age_row(out, rows[0], rows[1], state, longest, y, first, end)
    blend_row(out, sums, rows[0], sample, fast, state, lead, channels, y, first, end)


sample_each, fast_each, blend_each = Each(sample_pixel), Each(fast_pixel), Each(blend_pixel)
