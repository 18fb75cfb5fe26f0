"""Run the row body of `post.display.kernel` over pictures on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver
from post.display.kernel import agx_row


@driver
def agx_rows(out, color, exposure, contrast, saturation, inset, outset, threads):
    batch, _, height, _ = color.shape
    for thread in prange(threads):
        look = np.float32(contrast), np.float32(saturation)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            agx_row(out[b], color[b], y, exposure[b], *look, inset, outset)
