"""Run the bodies of `post.history.accumulate_kernel` over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import driver, scalar
from post.history.accumulate_kernel import age_row, blend_row, differences_row, noise_row, sample_row, unexplained_row
from post.history.constants import POOL

cuda: Any = numba.cuda
POOLED = 1 + 2 * POOL


@driver
def sample_rows(sample, noise, signal, state, lead, firefly, threads):
    """Samples without fireflies, and their noise."""
    batch, _, height, width = signal.shape
    for thread in prange(threads):
        sums = np.empty((5, width + 2 * POOL), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            _sample_row(sample[b], noise[b, 0], sums, signal[b], state[b], lead, firefly, y, 0, width)


@scalar
def sample_pixel(i, sample, noise, signal, state, lead, firefly):
    b, y, x = pixel_of(i, signal.shape[2], signal.shape[3])
    sums = cuda.local.array((5, POOLED), np.float32)
    _sample_row(sample[b], noise[b, 0], sums, signal[b], state[b], lead, firefly, y, x, x + 1)


@scalar
def _sample_row(sample, noise, sums, signal, state, lead, firefly, y, first, end):
    own = noise[y, first:end]
    noise_row(own, sums, state, signal.shape[0] + lead, y, first, end)
    sample_row(sample, sums, signal, state, own, lead, np.float32(firefly), y, first, end)


@driver
def differences_rows(out, signal, noise, state, first, lead, threads):
    """By how much histories and the frame differ."""
    batch, _, height, width = signal.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            differences_row(out[b], signal[b], noise[b], state[b], first[b], lead, y, 0, width)


@scalar
def differences_pixel(i, out, signal, noise, state, first, lead):
    b, y, x = pixel_of(i, signal.shape[2], signal.shape[3])
    differences_row(out[b], signal[b], noise[b], state[b], first[b], lead, y, x, x + 1)


@driver
def unexplained_rows(out, averaged, state, lead, clamp, slow, threads):
    """What noise does not explain of differences."""
    batch, _, height, width = averaged.shape
    for thread in prange(threads):
        share = np.empty(width, np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            unexplained_row(out[b], share, averaged[b], state[b], lead, np.float32(clamp), slow, y, 0, width)


@scalar
def unexplained_pixel(i, out, averaged, state, lead, clamp, slow):
    b, y, x = pixel_of(i, averaged.shape[2], averaged.shape[3])
    share = cuda.local.array(1, np.float32)
    unexplained_row(out[b], share, averaged[b], state[b], lead, np.float32(clamp), slow, y, x, x + 1)


@driver
def blend_rows(out, sample, state, longest, fast, slow, lead, threads):
    """States after a frame: both histories are moved by how their light has changed, and take the sample in."""
    batch, _, height, width = sample.shape
    for thread in prange(threads):
        alpha = np.empty(width, np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            age_row(out[b], alpha, slow[b], state[b], longest[b], y, 0, width)
            blend_row(out[b], alpha, sample[b], fast[b], slow[b], state[b], lead, y, 0, width)


@scalar
def blend_pixel(i, out, sample, state, longest, fast, slow, lead):
    b, y, x = pixel_of(i, sample.shape[2], sample.shape[3])
    alpha = cuda.local.array(1, np.float32)
    age_row(out[b], alpha, slow[b], state[b], longest[b], y, x, x + 1)
    blend_row(out[b], alpha, sample[b], fast[b], slow[b], state[b], lead, y, x, x + 1)


sample_each, differences_each = Each(sample_pixel), Each(differences_pixel)
unexplained_each, blend_each = Each(unexplained_pixel), Each(blend_pixel)
