"""One pixel of the layers of like blur: what the discs of the pixels around bring to it, for a GPU.

Names and steps are those of the torch reference in `post.lens.reference`, the definition; how layers lie over one
another is compiled from `post.lens.tile_kernel`, as on the CPU. A pixel has shares in two layers at most, so one walk
over the pixels around fills all layers, and a second one fills what lies behind those in front of the focal plane.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.lens import constants
from post.lens.spread_kernel import ONE, ZERO, Window, share_of
from post.lens.tile_kernel import ROUNDING, add_fill, finish, lay_under, ramp_at

EDGE = np.float32(constants.EDGE)

Picture = namedtuple("Picture", "color coc first radii ramps reach")
"""``first``: the nearer layer of the two in which each pixel has shares; ``reach``: pixels to the farthest disc."""


@inlined
def _disc(radius, away):
    """The weight of a disc some pixels from its middle."""
    if radius == ZERO:
        return ONE if away == ZERO else ZERO
    return min(max(radius + EDGE - away, ZERO), ONE)


@scalar
def _add(sums, color, share, row, column):
    """Add a pixel's share of light, and the share."""
    for c in range(color.shape[0]):
        sums[c] += share * color[c, row, column]
    sums[color.shape[0]] += share


@scalar
def gather(layers, picture, y, x):
    """Add to each layer what its discs bring to a pixel."""
    coc, reach = picture.coc, picture.reach[y, x]
    height, width = coc.shape
    for dy in range(-reach, reach + 1):
        row = min(max(y + dy, 0), height - 1)
        for dx in range(-reach, reach + 1):
            column = min(max(x + dx, 0), width - 1)
            away, square = math.sqrt(np.float32(dx * dx + dy * dy)), coc[row, column] * abs(coc[row, column])
            first = picture.first[row, column]
            for i in range(first, min(first + 2, picture.radii.shape[0])):
                weight = _disc(picture.radii[i], away)
                if weight > ZERO:
                    share = weight * share_of(square, ramp_at(picture.ramps, i, 0))
                    _add(layers[i], picture.color, share, row, column)


@scalar
def gather_behind(fill, layers, picture, level, y, x):
    """Add what lies behind the layers in front of the focal plane; the last plane of ``layers`` is what they cover."""
    coc, color, reach = picture.coc, picture.color, picture.reach[y, x]
    channels, height, width = color.shape
    scale = ONE / np.float32(channels)
    for dy in range(-reach, reach + 1):
        row = min(max(y + dy, 0), height - 1)
        for dx in range(-reach, reach + 1):
            column = min(max(x + dx, 0), width - 1)
            away, square = math.sqrt(np.float32(dx * dx + dy * dy)), coc[row, column] * abs(coc[row, column])
            share = ZERO
            for i in range(picture.radii.shape[0] // 2):  # the middle layer is in focus
                weight = layers[i, channels] * _disc(picture.radii[i], away)
                if weight > ZERO:
                    share += weight * share_of(square, ramp_at(picture.ramps, i, 1))
            if share > ZERO:
                total = ZERO
                for c in range(channels):
                    total += color[c, row, column]
                _add(fill, color, share / (ONE + total * scale / level), row, column)


@scalar
def layered_pixel(out, layers, scratch, picture, level, y, x):
    """Lay the layers over one another at a pixel; ``scratch``: its light, what lies behind, and what stays free."""
    channels, (result, fill, free) = picture.color.shape[0], scratch
    layers[:], result[:], fill[:], free[:] = ZERO, ZERO, ZERO, ONE
    window = Window(y, y + 1, x, x + 1)
    gather(layers, picture, y, x)
    for i in range(picture.radii.shape[0]):
        before = free[0, 0]
        lay_under(result, free, layers[i : i + 1], window, channels)
        layers[i, channels] = before - free[0, 0]
    if free[0, 0] > ROUNDING:
        gather_behind(fill[0], layers, picture, level, y, x)
        add_fill(result, free, fill, window, window, channels)
    finish(out, result, free, window)
