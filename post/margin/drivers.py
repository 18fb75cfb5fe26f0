"""Run the bodies of `post.margin.kernel` over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import driver, scalar
from post.margin.kernel import padded_row


@driver
def padded_rows(out, depth, normal, reach, hit, light, lens, pose, margin, near, parallel, threads):
    """See `post.margin.op.padded_cpu`."""
    batch, tall, wide = out.shape[:3]
    for thread in prange(threads):
        for row in range(thread, batch * tall, threads):
            b, y = row // tall, row % tall
            given = (depth[b], normal[b], reach[b], hit[b], light[b], lens[b], pose[b])
            padded_row(out[b, y], *given, margin, np.float32(near), parallel, y, 0, wide)


@scalar
def padded_pixel(i, out, depth, normal, reach, hit, light, lens, pose, margin, near, parallel):
    b, y, x = pixel_of(i, out.shape[1], out.shape[2])
    given = (depth[b], normal[b], reach[b], hit[b], light[b], lens[b], pose[b])
    padded_row(out[b, y], *given, margin, np.float32(near), parallel, y, x, x + 1)


padded_each = Each(padded_pixel)
