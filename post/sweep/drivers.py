"""Run the slices of `post.sweep.sweep_kernel` for all receivers of a picture, on CPU threads or on a GPU."""

from __future__ import annotations

import math
from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of, pixels
from gbufrt.compute.kernel import driver, inlined, scalar
from post.sweep.constants import FOUND, LIGHT, MOST_RADII, MOST_STEPS, SUMS, UNBOUNDED
from post.sweep.lane_kernel import (
    LANES,
    PAIRS,
    ROWS,
    Around,
    Grid,
    Scratch,
    fill_noise,
    fill_receivers,
    finish,
    new_lanes,
)  # fmt: skip
from post.sweep.sweep_kernel import gather, occlude

cuda: Any = numba.cuda
ONE, HALF = np.float32(1), np.float32(0.5)
FARTHEST = np.float32(UNBOUNDED)
MOST_SUMS = MOST_RADII * (SUMS + LIGHT)


@scalar
def _sweep_lanes(out, lanes, around, grid, noise, directions, used, gathers):
    """Sweep the receivers at ``lanes.place``, of which the first ``used`` count; the other lanes repeat one of them."""
    lanes.place[used:] = lanes.place[0]
    fill_receivers(lanes, around, grid)
    lanes.sums[:] = 0
    for which in range(directions):
        fill_noise(lanes, around, noise, which, directions)
        if gathers:
            gather(lanes, around)
        else:
            occlude(lanes, around)
    radii, found = around.radii.shape[0], FOUND + LIGHT if gathers else FOUND
    each = lanes.sums.shape[0] // radii
    for s in range(radii):
        sums = lanes.sums[s * each : (s + 1) * each]
        finish(lanes, sums, grid)
        for k in range(found):
            for x in range(used):
                out[s * found + k, lanes.place[x]] = sums[k * LANES + x]


@scalar
def _clear(out, found, place):
    """What is known of a receiver that hit nothing: it sees the sky."""
    out[:, place] = 0
    out[::found, place] = 1


@scalar
def _sweep_rows(out, lanes, around, grid, hit, noise, directions, first, every, gathers):
    """Sweep every ``every``-th row of one picture, from row ``first``; receivers that hit nothing are left out.

    Not part of the driver: numba removes from a parallel function what it writes to an array in a tuple.
    """
    (height, width), used = hit.shape, 0
    for y in range(first, height, every):
        for x in range(width):
            if hit[y, x]:
                lanes.place[used] = y * width + x
                used += 1
                if used == LANES:
                    _sweep_lanes(out, lanes, around, grid, noise, directions, used, gathers)
                    used = 0
            else:
                _clear(out, out.shape[0] // around.radii.shape[0], y * width + x)
    if used > 0:
        _sweep_lanes(out, lanes, around, grid, noise, directions, used, gathers)


@scalar
def _left_out(wide, width, margin):
    """Pixels of the margin that the padded picture lacks on a side, see `post.margin.view`."""
    return margin + 1 - (wide - width) // 2


@driver
def sweep_all(
    out, picture, rays, depth, normal, lens, pose, hit, turns, noise, radii, sky, terms, wide, margin, stride, row,
    column, directions, steps, limited, parallel, gathers, threads,
):  # fmt: skip
    tall = picture.shape[1] // wide
    left_out = _left_out(wide, depth.shape[2], margin)
    for thread in prange(threads):
        lanes = new_lanes(radii.shape[0], SUMS + LIGHT if gathers else SUMS, steps)
        for b in range(picture.shape[0]):
            known = radii, limited, sky[b], terms, turns
            around = Around(picture[b], wide, tall, left_out, rays[b, 4], rays[b], *known, margin, parallel)
            grid = Grid(depth[b], normal[b], lens[b], pose[b], hit.shape[2], stride, row, column)
            _sweep_rows(out[:, b], lanes, around, grid, hit[b], noise, directions, thread, threads, gathers)


@scalar
def sweep_pixel(
    i, out, picture, rays, depth, normal, lens, pose, hit, turns, noise, radii, sky, terms, wide, margin, stride, row,
    column, directions, steps, limited, parallel, limits, light,
):  # fmt: skip
    """As `sweep_all`: one receiver on a target of one lane, whose scratch memory has a constant size.

    ``limits`` and ``light`` are as long as there are radii and sums of gathered light: kernels are compiled for both,
    and keep what is known of each radius in registers.
    """
    (height, width), tall = hit.shape[1:], picture.shape[1] // wide
    b, y, x = pixel_of(i, height, width)
    place = y * width + x
    left_out = _left_out(wide, depth.shape[2], margin)
    if not hit[b, y, x]:
        _clear(out[:, b], out.shape[0] // radii.shape[0], place)
        return
    rows, parts = cuda.local.array(ROWS, np.float32), cuda.local.array(MOST_STEPS, np.float32)
    index, places = cuda.local.array(1, np.uint32), cuda.local.array(1, np.int64)
    read, covered = cuda.local.array(PAIRS, np.int64), cuda.local.array(MOST_RADII, np.int32)
    sums, reach = cuda.local.array(MOST_SUMS, np.float32), cuda.local.array(MOST_RADII, np.float32)
    rows[:] = 0
    places[0] = place
    for s in range(len(limits)):
        reach[s] = radii[s]
    used = parts[:steps], index, read, read.view(np.float32), covered[: len(limits)]
    lanes = Scratch(rows, *used, sums[: len(limits) * (SUMS + len(light))], places)
    known = reach[: len(limits)], limited, sky[b], terms, turns
    around = Around(picture[b], wide, tall, left_out, rays[b, 4], rays[b], *known, margin, parallel)
    grid = Grid(depth[b], normal[b], lens[b], pose[b], width, stride, row, column)
    _sweep_lanes(out[:, b], lanes, around, grid, noise, directions, 1, len(light) > 0)


sweep_each = Each(sweep_pixel)


@driver
def backs_rows(out, depth, thickness, lens, parallel, threads):
    """Planar depth of the back that is measured along each pixel's ray, see `post.sweep.thickness`."""
    batch, height, _ = depth.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            back, front, measured = out[b, y], depth[b, y], thickness[b, y]
            for x in range(pixels(back.shape[0])):
                back[x] = _back(front[x], measured[x], _toward(lens[b], parallel, x, y))


@scalar
def backs_pixel(i, out, depth, thickness, lens, parallel):
    """As `backs_rows`, one pixel."""
    b, y, x = pixel_of(i, *depth.shape[1:])
    out[b, y, x] = _back(depth[b, y, x], thickness[b, y, x], _toward(lens[b], parallel, x, y))


backs_each = Each(backs_pixel)


@driver
def bodies_rows(out, depth, hit, back, pixel, stride, hidden, lens, parallel, last, threads):
    """One pass of `post.sweep.reference.bodies_reference`: the deepest back among neighbours that overlap in depth.

    The ``last`` one makes it the planar depth from front to back, with what is ``hidden``.
    """
    batch, height, width = depth.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            _bodies_row(out[b], depth[b], hit[b], back[b], pixel[b], stride, y, 0, width)
            if last:
                deepest, front = out[b, y], depth[b, y]
                for x in range(pixels(deepest.shape[0])):
                    deepest[x] = deepest[x] - front[x] + hidden[0] * _toward(lens[b], parallel, x, y)


@scalar
def bodies_pixel(i, out, depth, hit, back, pixel, stride, hidden, lens, parallel, last):
    """As `bodies_rows`, one pixel: what is deepest so far is not in memory that other threads read."""
    height, width = depth.shape[1:]
    b, y, x = pixel_of(i, height, width)
    front, own = depth[b, y, x], back[b, y, x]
    deepest = own
    for tap in range(9):
        dx, dy = (tap % 3 - 1) * stride, (tap // 3 - 1) * stride
        row, column = y + dy, x + dx
        if 0 <= row < height and 0 <= column < width:
            one, apart = (
                (hit[b, row, column], depth[b, row, column], back[b, row, column]),
                np.float32(dx * dx + dy * dy),
            )
            deepest = _joined(deepest, front, own, pixel[b], one, apart)
    out[b, y, x] = deepest - front + hidden[0] * _toward(lens[b], parallel, x, y) if last else deepest


bodies_each = Each(bodies_pixel)


@inlined
def _toward(lens, parallel, x, y):
    """Planar depth of a world unit along a pixel's ray, see `gbufrt.camera.Camera.along_axis`."""
    across = (np.float32(x) + HALF + lens[4] - lens[2]) / lens[0]
    down = (np.float32(y) + HALF + lens[5] - lens[3]) / lens[1]
    return ONE if parallel else ONE / math.sqrt(across * across + down * down + ONE)


@inlined
def _back(front, measured, toward):
    return front + min(measured, FARTHEST * front) * toward


@scalar
def _bodies_row(out, depth, hit, back, pixel, stride, y, begin, stop):
    """Pixels ``begin`` to ``stop`` of a row."""
    height, width = depth.shape
    deepest, own = out[y, begin:stop], back[y, begin:stop]
    for i in range(deepest.shape[0]):
        deepest[i] = own[i]
    for tap in range(9):
        dx, there = (tap % 3 - 1) * stride, y + (tap // 3 - 1) * stride
        first, end = max(begin, -dx), min(stop, width - dx)
        if 0 <= there < height and first < end:
            deepest, front, own = out[y, first:end], depth[y, first:end], back[y, first:end]
            near, far = depth[there, first + dx : end + dx], back[there, first + dx : end + dx]
            solid = hit[there, first + dx : end + dx]
            apart = np.float32(dx * dx + (there - y) * (there - y))
            for i in range(deepest.shape[0]):
                deepest[i] = _joined(deepest[i], front[i], own[i], pixel, (solid[i], near[i], far[i]), apart)


@inlined
def _joined(deepest, front, own, pixel, other, apart):
    """What is deepest, with the back of another pixel if that shows the same body; ``apart``: squared pixels away."""
    solid, near, far = other
    wide = pixel[0] + pixel[1] * front
    one = solid and near <= own and front <= far and wide * wide * apart <= ONE
    return max(deepest, far) if one else deepest
