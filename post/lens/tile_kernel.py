"""The compiled form of layers of like blur, laid over one another: a tile of the picture as a body.

Names and steps are those of the torch reference in `post.lens.reference`, the definition. The layers in front of the
focal plane are spread a second time to find what lies behind them, but only in the part of a tile that no layer covers.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import allocating, scalar
from post.lens import constants
from post.lens.spread_kernel import ONE, ZERO, Disc, Ramp, Window, row_ranges, spread

CONFIDENT, TINY = np.float32(constants.CONFIDENT), np.float32(constants.TINY)
ROUNDING = np.float32(1e-5)  # what long sums in float32 leave uncovered where the layers cover a pixel


@scalar
def lay_under(result, free, layer, window, channels):
    """Lay a layer under those before it, and clear it."""
    planes = channels + 1
    for y in range(window.bottom - window.top):
        spread_light, kept, left = layer[y], result[y], free[y]
        for x in range(window.right - window.left):
            coverage = spread_light[x * planes + channels]
            if coverage > ZERO:
                taken = min(coverage, left[x])
                share = taken / max(coverage, TINY)
                left[x] -= taken
                for c in range(channels):
                    kept[x * planes + c] += share * spread_light[x * planes + c]
        spread_light[:] = ZERO


@allocating
def disc_at(i, reach, weights, inner, outer):
    """The disc of a layer."""
    return Disc(reach[i], weights[i], inner[i], outer[i])


@scalar
def ramp_at(ramps, i, which):
    """A layer's own share (0), or the share of what lies clearly behind it (1)."""
    row = ramps[i, which]
    return Ramp(row[0], row[1], row[2], row[3], row[4])


@scalar
def uncovered(free, window):
    """The smallest window around the pixels that no layer covers."""
    top, bottom, left, right = window.bottom, window.top, window.right, window.left
    for y in range(window.bottom - window.top):
        for x in range(window.right - window.left):
            if free[y, x] > ROUNDING:
                top, bottom = min(top, window.top + y), max(bottom, window.top + y + 1)
                left, right = min(left, window.left + x), max(right, window.left + x + 1)
    return Window(top, bottom, left, right)


@scalar
def take(taken, free, coverage, window):
    """What a layer covers of a window, which is no longer free, and clear it."""
    for y in range(window.bottom - window.top):
        for x in range(window.right - window.left):
            taken[y, x] = min(max(coverage[y, x], ZERO), free[y, x])
            free[y, x] -= taken[y, x]
        coverage[y] = ZERO


@scalar
def add_taken(fill, taken, layer, window, planes):
    """Add what a layer covers times what lies behind it, and clear that."""
    for y in range(window.bottom - window.top):
        for x in range(window.right - window.left):
            for c in range(planes):
                fill[y, x * planes + c] += taken[y, x] * layer[y, x * planes + c]
        layer[y] = ZERO


@scalar
def finish(out, result, free, window):
    """Write a tile."""
    channels = out.shape[0]
    for c in range(channels):
        for y in range(window.bottom - window.top):
            row = out[c, window.top + y, window.left : window.right]
            for x in range(row.shape[0]):
                row[x] = result[y, x * (channels + 1) + c] / max(ONE - free[y, x], TINY)


@scalar
def add_fill(result, free, fill, window, whole, channels):
    """Let the background show in that part of a whole tile; ``free`` becomes what even that leaves."""
    planes, down, right = channels + 1, window.top - whole.top, window.left - whole.left
    for y in range(window.bottom - window.top):
        for x in range(window.right - window.left):
            known = fill[y, x * planes + channels]
            trusted = free[y + down, x + right] * known / (known + CONFIDENT)
            for c in range(channels):
                light = trusted * fill[y, x * planes + c] / max(known, TINY)
                result[y + down, (x + right) * planes + c] += light
            free[y + down, x + right] -= trusted


@allocating
def tile(out, color, coc, level, reach, weights, inner, outer, ramps, window):
    """Spread all layers of a tile and lay them over one another."""
    channels, margin = color.shape[0], reach.max()
    planes, height, width = channels + 1, window.bottom - window.top, window.right - window.left
    layer, result = np.zeros((height, width * planes), np.float32), np.zeros((height, width * planes), np.float32)
    free, rows = np.ones((height, width), np.float32), np.empty((4, (width + 2 * margin) * planes), np.float32)
    low, high = np.empty(height + 2 * margin, np.float32), np.empty(height + 2 * margin, np.float32)
    row_ranges(low, high, coc, window, margin)
    for i in range(ramps.shape[0]):
        disc, ramp = disc_at(i, reach, weights, inner, outer), ramp_at(ramps, i, 0)
        if spread(layer, rows, color, coc, low, high, ZERO, disc, ramp, window, margin):
            lay_under(result, free, layer, window, channels)
    part = uncovered(free, window)
    if part.bottom > part.top:
        fill = behind(part, color, coc, level, reach, weights, inner, outer, ramps)
        add_fill(result, free, fill, part, window, channels)
    finish(out, result, free, window)


@allocating
def behind(window, color, coc, level, reach, weights, inner, outer, ramps):
    """What lies behind the layers in front of the focal plane, as much of it as they cover."""
    channels, margin = color.shape[0], reach.max()
    planes, height, width = channels + 1, window.bottom - window.top, window.right - window.left
    layer, fill = np.zeros((height, width * planes), np.float32), np.zeros((height, width * planes), np.float32)
    coverage, taken = np.zeros((height, width), np.float32), np.empty((height, width), np.float32)
    free, rows = np.ones((height, width), np.float32), np.empty((4, (width + 2 * margin) * planes), np.float32)
    low, high = np.empty(height + 2 * margin, np.float32), np.empty(height + 2 * margin, np.float32)
    row_ranges(low, high, coc, window, margin)
    for i in range(ramps.shape[0] // 2):  # the middle layer is in focus
        disc, own, other = disc_at(i, reach, weights, inner, outer), ramp_at(ramps, i, 0), ramp_at(ramps, i, 1)
        if spread(coverage, rows, color[:0], coc, low, high, ZERO, disc, own, window, margin):
            take(taken, free, coverage, window)
            if spread(layer, rows, color, coc, low, high, level, disc, other, window, margin):
                add_taken(fill, taken, layer, window, planes)
    return fill
