"""The shadow rays of a band of a picture, in three parts: see `tracer.lights.shadows.arriving`.

CPU threads send those of many pixels together; each of a GPU those of one pixel.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.each import Each
from gbufrt.compute.kernel import driver, scalar
from tracer.direct.kernel import Sources
from tracer.direct.pixel_kernel import LEVEL, first_rays, gathered, last_rays, second_rays
from tracer.direct.shadow_kernel import Arrivals, finish, new_shadows
from tracer.lights.shadows import AGREE
from tracer.traversal.kernel import triple

CHUNK = 64  # pixels handed out at a time


@scalar
def _place(surface, turned, i):
    points, normals, _ = surface
    return triple(points, i, 0), triple(normals, i, 0), (turned[0, i], turned[1, i])


@scalar
def _first_of(begin, end, shadows, space, sources, surface, turned, start, offsets, marked, counts, each):
    for p in range(begin, end):
        place = _place(surface, turned, start + p)
        for k in range(offsets[p], offsets[p + 1]):
            first_rays(shadows, space, sources, marked[k] >> LEVEL, place, counts, each, k)


@driver
def first_all(space, sources, widest, surface, turned, start, offsets, marked, counts, sums, out, lanes):
    pixels = len(offsets) - 1
    for lane in prange(lanes):
        each, shadows = np.empty(widest), new_shadows(sums, out)
        for begin in range(lane * CHUNK, pixels, lanes * CHUNK):
            given = shadows, space, sources, surface, turned, start, offsets, marked, counts, each
            _first_of(begin, min(begin + CHUNK, pixels), *given)
        finish(shadows, space, sources)


@scalar
def _second_of(begin, end, shadows, space, sources, surface, turned, start, near, rest, counts, each, opened):
    offsets, (chosen, scale) = near[0], rest
    for p in range(begin, end):
        i = start + p
        if offsets[p + 1] > offsets[p] or scale[p, 0] > 0:
            agree, one = AGREE / max(surface[2][i], 1e-6), (chosen[p], scale[p], i)
            place = _place(surface, turned, i)
            second_rays(shadows, space, sources, near, place, p, agree, one, counts, each, opened)


@scalar
def _last_of(begin, end, shadows, space, sources, surface, turned, start, near, counts, each, opened):
    for p in range(begin, end):
        agree, place = AGREE / max(surface[2][start + p], 1e-6), _place(surface, turned, start + p)
        last_rays(shadows, space, sources, near, place, p, agree, counts, each, opened)


@scalar
def _gather(begin, end, shadows, sources, near, start, opened):
    for p in range(begin, end):
        light = gathered(sources, near, p, shadows.sums, opened)
        for c in range(3):
            shadows.light[c, start + p] += np.float32(light[c])


@driver
def finish_all(space, sources, widest, surface, turned, start, near, counts, rest, rows, more, opened, out, lanes):
    width = near[3]
    last = rows[1] * width
    for lane in prange(lanes):
        each, shadows = np.empty(widest), new_shadows(more, out)
        for begin in range(rows[0] * width + lane * CHUNK, last, lanes * CHUNK):
            given = shadows, space, sources, surface, turned, start, near, rest, counts, each, opened
            _second_of(begin, min(begin + CHUNK, last), *given)
        finish(shadows, space, sources)
        for begin in range(rows[0] * width + lane * CHUNK, last, lanes * CHUNK):
            given = shadows, space, sources, surface, turned, start, near, counts, each, opened
            _last_of(begin, min(begin + CHUNK, last), *given)
        finish(shadows, space, sources)
        for begin in range(rows[0] * width + lane * CHUNK, last, lanes * CHUNK):
            _gather(begin, min(begin + CHUNK, last), shadows, sources, near, start, opened)


@scalar
def first_pixel(p, space, table, each, surface, turned, start, offsets, marked, counts, sums, out):
    """As `first_all`, one pixel; ``each`` has a row for every pixel."""
    given = Arrivals(sums, out), space, Sources(*table), surface, turned, start, offsets, marked, counts, each[p]
    _first_of(p, p + 1, *given)


@scalar
def finish_pixel(n, space, table, each, surface, turned, start, near, counts, rest, rows, more, opened, out):
    """As `finish_all`, one pixel."""
    p, shadows, sources = rows[0] * near[3] + n, Arrivals(more, out), Sources(*table)
    _second_of(p, p + 1, shadows, space, sources, surface, turned, start, near, rest, counts, each[p], opened)
    _last_of(p, p + 1, shadows, space, sources, surface, turned, start, near, counts, each[p], opened)
    _gather(p, p + 1, shadows, sources, near, start, opened)


first_each, finish_each = Each(first_pixel), Each(finish_pixel)
