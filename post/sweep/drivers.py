"""Run the slices of `post.sweep.sweep_kernel` for all receivers of a picture on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver, scalar
from post.sweep.slice_kernel import Around, dice_at, receiver_at
from post.sweep.sweep_kernel import Scratch, gather, occlude


@scalar
def _scratch(radii, groups, steps):
    """Scratch memory of one thread."""
    covered, light = np.empty(max(radii.shape[0], 1), np.int32), np.empty(3, np.float32)
    return Scratch(covered, light, np.empty((groups, 3), np.float32), np.empty(steps, np.float32))


@scalar
def _clear(sums, hit):
    """Set to zero, but the weight to 1 where nothing was hit, so that it can be divided by."""
    sums[:] = 0
    sums[:, 0] = not hit


@driver
def sweep_all(out, picture, rays, planes, hit, random, radii, sky, terms, margin, steps, parallel, gathers, threads):
    _, batch, height, width = planes.shape
    for thread in prange(threads):
        sums, scratch = np.empty(out.shape[:2], np.float32), _scratch(radii, terms.shape[1] // 2, steps)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            around = Around(picture[b], rays[b], radii, sky[b], terms, margin, parallel)
            for x in range(width):
                _clear(sums, hit[b, y, x])
                if hit[b, y, x]:
                    at = receiver_at(planes, rays[b, 4], b, y, x)
                    for which in range(random.shape[0]):
                        dice = dice_at(random, which, y, x)
                        if gathers:
                            gather(sums, scratch, around, at, dice)
                        else:
                            occlude(sums, scratch, around, at, dice)
                out[:, :, b, y, x] = sums
