"""Run the bodies of `post.lens`'s kernels over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import driver, scalar
from post.lens.constants import MOST_CHANNELS, MOST_LAYERS
from post.lens.gather_kernel import Picture, layered_pixel
from post.lens.shutter_kernel import (
    OWN_WEIGHT,
    TOGETHER,
    add_alone_row,
    add_row,
    candidate_row,
    finish_row,
    guess_row,
    look_row,
    moves,
    place_row,
    start_row,
    tap_row,
    time_row,
    weigh_alone_row,
    weigh_row,
)
from post.lens.similar_kernel import similar_pixel
from post.lens.spread_kernel import Window
from post.lens.tile_kernel import tile

cuda: Any = numba.cuda
PLANES = MOST_CHANNELS + 1
TILE = 64  # pixels: what a thread works on fits its cache
RUN = 128  # pixels of a row: what a thread knows of them fits its fastest cache


@driver
def layer_tiles(out, color, coc, level, reach, weights, inner, outer, ramps, threads):
    batch, _, height, width = color.shape
    down, across = (height + TILE - 1) // TILE, (width + TILE - 1) // TILE
    for thread in prange(threads):
        for item in range(thread, batch * down * across, threads):
            b, top, left = item // (down * across), item // across % down * TILE, item % across * TILE
            window = Window(top, min(top + TILE, height), left, min(left + TILE, width))
            tile(out[b], color[b], coc[b], level[b], reach, weights, inner, outer, ramps, window)


@scalar
def layer_pixel(i, out, color, coc, level, first, reach, radii, ramps):
    """As `layer_tiles`, one pixel."""
    b, y, x = pixel_of(i, coc.shape[1], coc.shape[2])
    layers, sums = cuda.local.array((MOST_LAYERS, PLANES), np.float32), cuda.local.array((2, PLANES), np.float32)
    free = cuda.local.array((1, 1), np.float32)
    picture = Picture(color[b], coc[b], first[b], radii, ramps, reach[b])
    layered_pixel(out[b], layers, (sums[:1], sums[1:], free), picture, level[b], y, x)


layer_each = Each(layer_pixel)


@driver
def reconstruct_rows(out, color, depth, path, dominant, picture, known, noise, opening, samples, softness, threads):
    """See `post.lens.op.reconstruct`."""
    batch, _, height, width = color.shape
    for thread in prange(threads):
        rows, sums = np.empty((24, RUN), np.float32), np.zeros((picture.shape[1] * TOGETHER, RUN), np.float32)
        places = np.empty((2, RUN), np.int32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            given = color[b], depth[b], path[b], dominant[b], picture[b], known[b], noise
            for first in range(0, width, RUN):
                end = min(first + RUN, width)
                _reconstruct_run(out[b], given, rows, sums, places, opening, samples, softness, y, first, end)


@scalar
def reconstruct_pixel(
    i, out, color, depth, path, dominant, picture, known, noise, opening, samples, softness
):  # fmt: skip
    """As `reconstruct_rows`, one pixel."""
    b, y, x = pixel_of(i, depth.shape[1], depth.shape[2])
    rows, sums = cuda.local.array((24, 1), np.float32), cuda.local.array((TOGETHER, 1), np.float32)
    places = cuda.local.array((2, 1), np.int32)
    given = color[b], depth[b], path[b], dominant[b], picture[b], known[b], noise
    _reconstruct_run(out[b], given, rows, sums, places, opening, samples, softness, y, x, x + 1)


reconstruct_each = Each(reconstruct_pixel)
similar_each = Each(similar_pixel)


@scalar
def _reconstruct_run(out, given, rows, sums, places, opening, samples, softness, y, first, end):
    """Pixels ``first`` to ``end`` of a row."""
    color, depth, path, dominant, picture, known, noise = given
    count, width, soft = end - first, depth.shape[1], np.float32(softness)
    time, weight, moved_x, moved_y = rows[0, :count], rows[1, :count], rows[2, :count], rows[3, :count]
    a, a_x, a_y, a_found, a_behind = rows[4, :count], rows[5, :count], rows[6, :count], rows[7, :count], rows[8, :count]
    b, b_x, b_y, b_found = rows[9, :count], rows[10, :count], rows[11, :count], rows[12, :count]
    b_behind, a_taps, b_taps = rows[13, :count], rows[14:18], rows[18:22]
    a_place, b_place = places[0, :count], places[1, :count]
    aim_x, aim_y, own_x, own_y = rows[22, :count], rows[23, :count], path[0, y, first:end], path[1, y, first:end]
    start_row(sums, weight, color, OWN_WEIGHT, y, first)
    if moves(dominant, y, first, end):
        for i in range(samples):
            time_row(time, noise, opening, i, samples, y, first)
            moved = b_place, moved_x, moved_y, known, depth
            place_row(a_place, dominant, time, depth.shape, y, first, end)
            look_row(aim_x, aim_y, a_place, known)
            two = guess_row(aim_x, aim_y, own_x, own_y)
            candidate_row(b_x, b_y, b_found, b, b_behind, *moved, own_x, own_y, time, soft, y, first)
            if two:
                moved = a_place, moved_x, moved_y, known, depth
                candidate_row(a_x, a_y, a_found, a, a_behind, *moved, aim_x, aim_y, time, soft, y, first)
                weigh_row(a, b, a_found, b_found, a_behind, b_behind, soft)
                tap_row(a_place, a_taps, weight, a_x, a_y, a, width)
            else:
                weigh_alone_row(b, b_behind)
            tap_row(b_place, b_taps, weight, b_x, b_y, b, width)
            for k in range(picture.shape[0]):
                red, green, blue = sums[3 * k, :count], sums[3 * k + 1, :count], sums[3 * k + 2, :count]
                if two:
                    add_row(red, green, blue, picture[k], a_place, a_taps, b_place, b_taps, width)
                else:
                    add_alone_row(red, green, blue, picture[k], b_place, b_taps, width)
    finish_row(out, color, sums, weight, dominant, y, first, end)
