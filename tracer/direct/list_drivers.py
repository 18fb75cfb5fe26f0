"""Which lamps matter to the pixels of a band of a picture: a tile at a time on CPU threads, a pixel on those of a GPU.

A GPU finds the candidates of all tiles first, see `tracer.direct.choice_kernel`.
"""

from __future__ import annotations

import math
from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each
from gbufrt.compute.kernel import driver, scalar
from tracer.direct.choice_kernel import (
    BLOCK,
    CLOSE,
    EVEN,
    FLAT,
    GROUPS,
    MOST_ALONE,
    TILE,
    center_of,
    draw_rest,
    extent,
    find_candidates,
    importance,
    list_lamps,
)
from tracer.direct.kernel import Sources
from tracer.direct.near_kernel import closest, gather, importances, new_near
from tracer.sampling.scatter_kernel import along, dot
from tracer.traversal.kernel import triple

cuda: Any = numba.cuda


@scalar
def _tile(n, width, height):
    """First row, row after the last, and likewise columns."""
    across = (width + TILE - 1) // TILE
    y, x = n // across * TILE, n % across * TILE
    return y, min(y + TILE, height), x, min(x + TILE, width)


@scalar
def _candidates(sources, surface, width, few, tile, group, candidates, others, most, low, high):
    """What `find_candidates` returns for a tile, and leaves in ``candidates`` and ``others``."""
    i, clearest, least, _ = extent(surface, width, tile, group, low, high)
    if i < 0:
        return 0, 0, 0.0
    point, normal = triple(surface[0], i, 0), triple(surface[1], i, 0)
    return find_candidates(sources, few, point, normal, least, clearest, low, high, candidates, others, most)


@scalar
def _area(y, x, side, within):
    """The square of pixels, of so many on a ``side``, that begins at a row and column, cut by another."""
    return y, min(y + side, within[1]), x, min(x + side, within[3])


@scalar
def _ball(low, high):
    """Centre, normal and radius of what `extent` leaves in ``low`` and ``high``."""
    center = (low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2
    normal = (low[3] + high[3]) / 2, (low[4] + high[4]) / 2, (low[5] + high[5]) / 2
    corner = high[0] - center[0], high[1] - center[1], high[2] - center[2]
    return center, normal, math.sqrt(dot(corner, corner))


@scalar
def _alike(low, high, least, greatest):
    """Whether pixels face one way, and about as much light is known of all."""
    return max(high[3] - low[3], high[4] - low[4], high[5] - low[5]) <= FLAT and greatest <= EVEN * least


@scalar
def _list_at(near, place, known, seen, given, rays, drawn):
    """What `list_lamps` returns at a place: a point, a normal, and the reach of the pixels there."""
    used, _, sent, power, row = given
    importances(near, place[0], place[1], place[2], power)
    return list_lamps(used, known, seen, sent, power, rays, drawn, row)


@scalar
def _list_area(sources, surface, dice, width, rays, out, area, group, near, others, given, low, high):
    """List and draw for the pixels of one group in an ``area``, or return False where they are too far apart."""
    (lists, counts, chosen, scale), (used, count, _, power, row) = out, given
    i, clearest, least, greatest = extent(surface, width, area, group, low, high)
    if i < 0:
        return True
    place = _ball(low, high)
    if not _alike(low, high, least, greatest) or place[2] > CLOSE * closest(near, place[0], len(used)):
        return False
    length, draws = _list_at(near, place, least, clearest, given, rays, scale.shape[1])
    for y in range(area[0], area[1]):
        for p in range(y * width + area[2], y * width + area[3]):
            if surface[4][p] == group:
                counts[p] = length
                for k in range(length):
                    lists[p, k] = row[k]
                draw_rest(used, power, others, count, dice[p], draws, chosen[p], scale[p])
    return True


@scalar
def _list_pixels(sources, surface, dice, width, rays, out, area, group, near, others, given, low, high):
    """List and draw for the pixels of one group in an ``area``, each for itself."""
    (lists, counts, chosen, scale), (used, count, _, power, row) = out, given
    for y in range(area[0], area[1]):
        for p in range(y * width + area[2], y * width + area[3]):
            if surface[4][p] == group:
                place = triple(surface[0], p, 0), triple(surface[1], p, 0), 0.0
                counts[p], draws = _list_at(near, place, surface[3][p], surface[2][p], given, rays, scale.shape[1])
                for k in range(counts[p]):
                    lists[p, k] = row[k]
                draw_rest(used, power, others, count, dice[p], draws, chosen[p], scale[p])


@scalar
def _list_group(sources, surface, dice, width, rays, out, tile, group, near, others, given, low, high):
    """List and draw for the pixels of one group in a tile, by squares whose pixels lie close together."""
    at, by = (sources, surface, dice, width, rays, out), (group, near, others, given, low, high)
    for y in range(tile[0], tile[1], BLOCK):
        for x in range(tile[2], tile[3], BLOCK):
            block = _area(y, x, BLOCK, tile)
            if not _list_area(*at, block, *by):
                for v in range(block[0], block[1], 2):
                    for u in range(block[2], block[3], 2):
                        pair = _area(v, u, 2, block)
                        if not _list_area(*at, pair, *by):
                            _list_pixels(*at, pair, *by)


@scalar
def _list_tile(sources, surface, dice, width, few, many, rays, out, tile, candidates, others, scratch):
    (power, row, near, low, high), there = scratch, 0
    for y in range(tile[0], tile[1]):
        for p in range(y * width + tile[2], y * width + tile[3]):
            out[1][p], out[3][p, :] = 0, np.float32(0)
            there |= 1 << surface[4][p] if surface[4][p] >= 0 else 0
    for group in range(GROUPS):
        if not there & 1 << group:
            continue
        given = sources, surface, width, few, tile, group, candidates, others, power, low, high
        found, count, sent = _candidates(*given)
        if found + count > 0:
            used = candidates[:found]
            gather(near, sources, used, low, high)
            at = sources, surface, dice, width, rays, out, tile, group
            by = near, others, (used, count, sent, power[:found], row), low, high
            if found > many:
                _list_group(*at, *by)
            else:
                _list_pixels(*at, *by)


@driver
def list_all(sources, surface, dice, width, few, many, rays, lists, counts, chosen, scale, lanes):
    lamps, height = sources.lamps.shape[1], len(counts) // width
    tiles = ((width + TILE - 1) // TILE) * ((height + TILE - 1) // TILE)
    for lane in prange(lanes):
        candidates, numbers = np.empty(lamps, np.int32), np.empty(lamps, np.int32)
        power, upto, near = np.empty(lamps), np.empty(lamps), new_near(sources)
        row, low, high = np.empty(MOST_ALONE, np.int32), np.empty(6), np.empty(6)
        for n in range(lane, tiles, lanes):
            given = sources, surface, dice, width, few, many, rays, (lists, counts, chosen, scale)
            others, scratch = (numbers, upto), (power, row, near, low, high)
            _list_tile(*given, _tile(n, width, height), candidates, others, scratch)


@scalar
def candidates_tile(n, table, surface, width, few, size, candidates, numbers, upto, most, found, sent):
    """Candidates of a group in a tile: their number and that of the others in ``found``; see `find_candidates`."""
    low, high = cuda.local.array(6, np.float64), cuda.local.array(6, np.float64)
    tile, others = _tile(n // GROUPS, width, size // width), (numbers[n], upto[n])
    given = surface, width, few, tile, n % GROUPS, candidates[n], others, most[n], low, high
    found[n, 0], found[n, 1], sent[n] = _candidates(Sources(*table), *given)


@scalar
def _closest(sources, numbers, point):
    """As `tracer.direct.near_kernel.closest`."""
    least = np.inf
    for k in range(len(numbers)):
        way = along(center_of(sources.lamps, numbers[k]), point, -1.0)
        least = min(least, dot(way, way))
    return math.sqrt(least)


@scalar
def list_pixel(p, table, surface, dice, width, many, rays, tiles, power, lists, counts, chosen, scale):
    """As `list_all`, one pixel; ``tiles`` is what `candidates_tile` found."""
    candidates, numbers, upto, _, found, sent = tiles
    sources, group = Sources(*table), surface[4][p]
    low, high = cuda.local.array(6, np.float64), cuda.local.array(6, np.float64)
    row = cuda.local.array(MOST_ALONE, np.int32)
    counts[p] = 0
    for draw in range(scale.shape[1]):
        scale[p, draw] = 0
    if group >= 0:
        y, x = p // width, p % width
        n = (y // TILE * ((width + TILE - 1) // TILE) + x // TILE) * GROUPS + group
        used, mine = candidates[n, : found[n, 0]], power[p, : found[n, 0]]
        square, tile = BLOCK if len(used) > many else 1, _tile(n // GROUPS, width, len(counts) // width)
        while True:
            area = _area(y // square * square, x // square * square, square, tile)
            _, clearest, least, greatest = extent(surface, width, area, group, low, high)
            point, normal, reach = _ball(low, high)
            alike = square == 1 or _alike(low, high, least, greatest)
            if alike and (square == 1 or reach <= CLOSE * _closest(sources, used, point)):
                break
            square //= 2
        for k in range(len(used)):
            mine[k] = importance(sources, used[k], point, normal, reach)
        counts[p], draws = list_lamps(used, least, clearest, sent[n], mine, rays, scale.shape[1], row)
        for k in range(counts[p]):
            lists[p, k] = row[k]
        draw_rest(used, mine, (numbers[n], upto[n]), found[n, 1], dice[p], draws, chosen[p], scale[p])


candidates_each, list_each = Each(candidates_tile), Each(list_pixel)


@scalar
def pack_pixel(p, lists, offsets, marked):
    """The list of a pixel after those of the pixels before it."""
    for k in range(offsets[p], offsets[p + 1]):
        marked[k] = lists[p, k - offsets[p]]


pack_each = Each(pack_pixel)
