"""The compiled form of `post.lens.shutter_reference.similar_reference`: a pixel as a body."""

from __future__ import annotations

import numpy as np

from gbufrt.compute.each import pixel_of
from gbufrt.compute.kernel import scalar

ZERO, HALF, ONE, TINY = np.float32(0), np.float32(0.5), np.float32(1), np.float32(1e-12)


@scalar
def similar_pixel(i, out, color, sharp, path, noise, opening, samples):
    """See `post.lens.op.blur_alike`. What stands still is left alone."""
    channels, height, width = color.shape[1], color.shape[2], color.shape[3]
    b, y, x = pixel_of(i, height, width)
    along, down, weight = path[b, 0, y, x], path[b, 1, y, x], ONE
    square, step = along * along + down * down, ONE / np.float32(samples)
    for c in range(channels):
        out[b, c, y, x] = color[b, c, y, x]
    if square == ZERO:
        return
    for k in range(samples):
        time = np.float32(opening) + (np.float32(k) + noise[y, x]) * step
        column, row = np.float32(x) - along * time, np.float32(y) - down * time
        column, row = min(max(column, ZERO), np.float32(width - 1)), min(max(row, ZERO), np.float32(height - 1))
        near_x, near_y = np.int64(column + HALF), np.int64(row + HALF)
        alike = (path[b, 0, near_y, near_x] * along + path[b, 1, near_y, near_x] * down) / max(square, TINY)
        if alike > ZERO:
            alike = min(alike, ONE)
            weight += alike
            _add_between(out, sharp, b, y, x, row, column, alike)
    for c in range(channels):
        out[b, c, y, x] /= weight


@scalar
def _add_between(out, color, b, y, x, row, column, share):
    """Add the weighted colour at a place between pixels of the picture."""
    left, top = np.int64(column), np.int64(row)
    right, bottom = min(left + 1, color.shape[3] - 1), min(top + 1, color.shape[2] - 1)
    across, down = column - np.float32(left), row - np.float32(top)
    q, r = share * (ONE - down) * (ONE - across), share * (ONE - down) * across
    s, t = share * down * (ONE - across), share * down * across
    for c in range(color.shape[1]):
        upper = q * color[b, c, top, left] + r * color[b, c, top, right]
        out[b, c, y, x] += upper + s * color[b, c, bottom, left] + t * color[b, c, bottom, right]
