"""Which lamps matter to the pixels of a band of a picture: a tile at a time on CPU threads, a pixel on those of a GPU.

A GPU finds the candidates of all tiles first, see `tracer.direct.choice_kernel`.
"""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each
from gbufrt.compute.kernel import driver, scalar
from tracer.direct.choice_kernel import SIDES, TILE, draw_rest, extent, find_candidates, importance, list_lamps, side_of
from tracer.direct.kernel import Sources
from tracer.direct.near_kernel import gather, importances, new_near
from tracer.traversal.kernel import triple

cuda: Any = numba.cuda


@scalar
def _tile(n, width, height):
    """First row, row after the last, and likewise columns."""
    across = (width + TILE - 1) // TILE
    y, x = n // across * TILE, n % across * TILE
    return y, min(y + TILE, height), x, min(x + TILE, width)


@scalar
def _candidates(sources, surface, known, start, width, few, tile, side, candidates, others, most, low, high):
    """What `find_candidates` returns for a tile, and leaves in ``candidates`` and ``others``."""
    i, clearest, least = extent(surface, known, start, width, tile, side, low, high)
    if i < 0:
        return 0, 0, 0.0
    point, normal = triple(surface[0], i, 0), triple(surface[1], i, 0)
    return find_candidates(sources, few, point, normal, least, clearest, low, high, candidates, others, most)


@scalar
def _choose(i, p, known, seen, dice, candidates, power, others, count, sent, out):
    """List and draw for pixel ``i``, the ``p``-th of its band; ``power`` is the importance of the candidates there."""
    lists, counts, chosen, scale = out
    counts[p], rest, draws = list_lamps(candidates, known[i], seen[i], sent, power, lists[p])
    draw_rest(candidates, power, rest, others, count, dice[i], draws, chosen[p], scale[p])


@scalar
def _list_tile(sources, surface, known, dice, start, width, few, out, tile, candidates, others, scratch):
    points, normals, seen = surface
    power, near, low, high = scratch
    for row in range(tile[0], tile[1]):
        for p in range(row * width + tile[2], row * width + tile[3]):
            out[1][p], out[3][p, :] = 0, np.float32(0)
    # what pixels of one tile face differs more than where they lie: together they would bound hardly anything
    for side in range(SIDES):
        given = sources, surface, known, start, width, few, tile, side, candidates, others, power, low, high
        found, count, sent = _candidates(*given)
        used, mine = candidates[:found], power[:found]
        if found + count > 0:
            gather(near, sources, used, low, high)
            for row in range(tile[0], tile[1]):
                for p in range(row * width + tile[2], row * width + tile[3]):
                    i = start + p
                    if seen[i] > 0 and side == side_of(normals, i):
                        importances(near, triple(points, i, 0), triple(normals, i, 0), mine)
                        _choose(i, p, known, seen, dice, used, mine, others, count, sent, out)


@driver
def list_all(sources, surface, known, dice, start, width, few, lists, counts, chosen, scale, lanes):
    lamps, height = len(sources.lamps), len(counts) // width
    tiles = ((width + TILE - 1) // TILE) * ((height + TILE - 1) // TILE)
    for lane in prange(lanes):
        candidates, numbers = np.empty(lamps, np.int32), np.empty(lamps, np.int32)
        power, upto, near = np.empty(lamps), np.empty(lamps), new_near(sources)
        low, high = np.empty(6), np.empty(6)
        for n in range(lane, tiles, lanes):
            given = sources, surface, known, dice, start, width, few, (lists, counts, chosen, scale)
            others, scratch = (numbers, upto), (power, near, low, high)
            _list_tile(*given, _tile(n, width, height), candidates, others, scratch)


@scalar
def candidates_tile(n, table, surface, known, start, width, few, size, candidates, numbers, upto, most, found, sent):
    """Candidates of a side of a tile: their number and that of the others in ``found``; see `find_candidates`."""
    low, high = cuda.local.array(6, np.float64), cuda.local.array(6, np.float64)
    tile, others = _tile(n // SIDES, width, size // width), (numbers[n], upto[n])
    given = surface, known, start, width, few, tile, n % SIDES, candidates[n], others, most[n], low, high
    found[n, 0], found[n, 1], sent[n] = _candidates(Sources(*table), *given)


@scalar
def list_pixel(p, table, surface, known, dice, start, width, tiles, power, lists, counts, chosen, scale):
    """As `list_all`, one pixel; ``tiles`` is what `candidates_tile` found."""
    candidates, numbers, upto, _, found, sent = tiles
    (points, normals, seen), sources, i = surface, Sources(*table), start + p
    counts[p] = 0
    for draw in range(scale.shape[1]):
        scale[p, draw] = 0
    if seen[i] > 0:
        n = p // width // TILE * ((width + TILE - 1) // TILE) + p % width // TILE
        n = n * SIDES + side_of(normals, i)
        used, others, mine = candidates[n, : found[n, 0]], (numbers[n], upto[n]), power[p, : found[n, 0]]
        for k in range(len(used)):
            mine[k] = importance(sources, used[k], triple(points, i, 0), triple(normals, i, 0))
        out = lists, counts, chosen, scale
        _choose(i, p, known, seen, dice, used, mine, others, found[n, 1], sent[n], out)


candidates_each, list_each = Each(candidates_tile), Each(list_pixel)


@scalar
def pack_pixel(p, lists, offsets, marked):
    """The list of a pixel after those of the pixels before it."""
    for k in range(offsets[p], offsets[p + 1]):
        marked[k] = lists[p, k - offsets[p]]


pack_each = Each(pack_pixel)
