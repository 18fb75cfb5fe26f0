"""The compiled form of anti-aliasing by luma edges: a row of pixels as a body.

Names and steps are those of the torch reference in `post.filters.fxaa_reference`, the definition. Rows of luma are
padded by their first and last pixel. Few pixels lie beside an edge, so a vectorised loop finds these, and only they
search.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.filters import constants

ZERO, QUARTER, HALF, ONE = np.float32(0), np.float32(0.25), np.float32(0.5), np.float32(1)
TWO, THREE, TWELVE, LEAST = np.float32(2), np.float32(3), np.float32(12), np.float32(1e-6)
INFINITE = np.float32(np.inf)
RED, GREEN, BLUE = (np.float32(share) for share in constants.LUMA)
STRIDES = tuple(np.float32(stride) for stride in constants.STRIDES)

Edge = namedtuple("Edge", "y x down right")
"""A pixel and the step to its neighbour across the edge; the edge runs along the other axis."""


@inlined
def luma_of(red, green, blue):
    return RED * red + GREEN * green + BLUE * blue


@scalar
def luma_row(luma, image, y):
    """A row of luma, padded by a pixel to each side."""
    red, green, blue, width = image[0, y], image[1, y], image[2, y], image.shape[2]
    inner = luma[y, 1 : 1 + width]
    for x in range(width):
        inner[x] = luma_of(red[x], green[x], blue[x])
    luma[y, 0], luma[y, width + 1] = inner[0], inner[width - 1]


@scalar
def edge_row(is_edge, luma, y, edge_threshold, dark_threshold):
    """Which pixels of a row have an edge beside them."""
    height, width = luma.shape[0], is_edge.shape[0]
    norths, souths = luma[max(y - 1, 0), 1 : 1 + width], luma[min(y + 1, height - 1), 1 : 1 + width]
    wests, centers, easts = luma[y, :width], luma[y, 1 : 1 + width], luma[y, 2 : 2 + width]
    for x in range(width):
        high = max(max(max(norths[x], souths[x]), max(wests[x], easts[x])), centers[x])
        low = min(min(min(norths[x], souths[x]), min(wests[x], easts[x])), centers[x])
        known = norths[x] + souths[x] + wests[x] + easts[x] + centers[x] < INFINITE
        is_edge[x] = known and high - low > max(edge_threshold * high, dark_threshold)


@scalar
def smooth_row(out, is_edge, image, luma, y, subpixel):
    """Read those pixels of a row that lie beside an edge from across it, and copy the others."""
    channels, _, width = image.shape
    for c in range(channels):
        for x in range(width):
            out[c, y, x] = image[c, y, x]
    for x in range(width):
        if is_edge[x]:
            smooth(out, image, luma, y, x, subpixel)


@scalar
def smooth(out, image, luma, y, x, subpixel):
    """Read a pixel beside an edge from across it."""
    channels, height, width = image.shape
    edge, shift = _shift(luma, y, x, subpixel)
    row, column = min(max(y + edge.down, 0), height - 1), min(max(x + edge.right, 0), width - 1)
    for c in range(channels):
        out[c, y, x] = (ONE - shift) * image[c, y, x] + shift * image[c, row, column]


@scalar
def _shift(luma, y, x, subpixel):
    """The edge beside a pixel, and how far to read across it, in pixels."""
    above, below, at = luma[max(y - 1, 0)], luma[min(y + 1, luma.shape[0] - 1)], luma[y]
    nw, north, ne = above[x], above[x + 1], above[x + 2]
    west, center, east = at[x], at[x + 1], at[x + 2]
    sw, south, se = below[x], below[x + 1], below[x + 2]
    across_rows = abs(nw + sw - TWO * west) + TWO * abs(north + south - TWO * center) + abs(ne + se - TWO * east)
    across_columns = abs(nw + ne - TWO * north) + TWO * abs(west + east - TWO * center) + abs(sw + se - TWO * south)
    horizontal = across_rows >= across_columns
    before, after = (north, south) if horizontal else (west, east)
    steep_before = abs(before - center) >= abs(after - center)
    neighbour, side = (before, -1) if steep_before else (after, 1)
    edge = Edge(y, x, side, 0) if horizontal else Edge(y, x, 0, side)

    contrast = max(max(north, south), max(west, east), center) - min(min(north, south), min(west, east), center)
    smooth = (TWO * (north + south + west + east) + nw + ne + sw + se) / TWELVE
    lonely = min(abs(smooth - center) / max(contrast, LEAST), ONE)
    lonely = lonely * lonely * (THREE - TWO * lonely)
    return edge, max(_edge_shift(luma, edge, center, neighbour), lonely * lonely * subpixel / TWO)


@scalar
def _edge_shift(luma, edge, center, neighbour):
    """See `fxaa_reference._edge_shift`."""
    middle, end_step = (center + neighbour) / TWO, abs(center - neighbour) / TWO / TWO
    one, delta = _search(luma, edge, -ONE, middle, end_step)
    other, delta_of_other = _search(luma, edge, ONE, middle, end_step)
    if not one < other:
        delta = delta_of_other
    crosses = (delta < ZERO) != (center < middle)
    return HALF - min(one, other) / (one + other) if crosses else ZERO


@scalar
def _search(luma, edge, direction, middle, end_step):
    """The distance to an end of the edge, and how luma on the edge differs there."""
    distance, delta = ZERO, ZERO
    for stride in STRIDES:
        distance += stride
        delta = _on_edge(luma, edge, direction * distance) - middle
        if not abs(delta) < end_step:
            break
    return distance, delta


@inlined
def _on_edge(luma, edge, distance):
    """Luma between the pixels on both sides of an edge, some pixels along it."""
    whole = np.int64(math.floor(distance))
    part, value = distance - np.float32(whole), _pair(luma, edge, whole)
    return value + part * (_pair(luma, edge, whole + 1) - value) if part > ZERO else value


@inlined
def _pair(luma, edge, along):
    """Mean luma of a pixel some pixels along an edge and of its neighbour across it."""
    last_row, last = luma.shape[0] - 1, luma.shape[1] - 1
    y, x = edge.y + (along if edge.down == 0 else 0), edge.x + 1 + (along if edge.down != 0 else 0)
    here = luma[min(max(y, 0), last_row), min(max(x, 0), last)]
    across = luma[min(max(y + edge.down, 0), last_row), min(max(x + edge.right, 0), last)]
    return HALF * (here + across)
