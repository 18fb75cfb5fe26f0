"""Run the tile body of `post.lens.tile_kernel` over pictures on CPU threads."""

from __future__ import annotations

from numba import prange

from gbufrt.compute.kernel import driver
from post.lens.spread_kernel import Window
from post.lens.tile_kernel import tile

TILE = 64  # pixels: what a thread works on fits its cache


@driver
def layer_tiles(out, color, coc, level, reach, weights, inner, outer, ramps, threads):
    batch, _, height, width = color.shape
    down, across = (height + TILE - 1) // TILE, (width + TILE - 1) // TILE
    for thread in prange(threads):
        for item in range(thread, batch * down * across, threads):
            b, top, left = item // (down * across), item // across % down * TILE, item % across * TILE
            window = Window(top, min(top + TILE, height), left, min(left + TILE, width))
            tile(out[b], color[b], coc[b], level[b], reach, weights, inner, outer, ramps, window)
