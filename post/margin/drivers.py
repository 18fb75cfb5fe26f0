"""Run the bodies of `post.margin.kernel` over pictures on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver
from post.margin.kernel import padded_row


@driver
def padded_rows(out, depth, normal, reach, hit, light, lens, pose, margin, near, parallel, threads):
    """See `post.margin.op.padded_cpu`."""
    batch, tall = out.shape[:2]
    for thread in prange(threads):
        for row in range(thread, batch * tall, threads):
            b, y = row // tall, row % tall
            given = (depth[b], normal[b], reach[b], hit[b], light[b], lens[b], pose[b])
            padded_row(out[b, y], *given, margin, np.float32(near), parallel, y)
