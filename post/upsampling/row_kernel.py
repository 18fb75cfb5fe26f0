"""Joint bilateral upsampling on the CPU: a row of pixels as a body, whose loops become vector instructions.

Pixels at one place between samples lie a stride apart and have the same four shares, so they are weighed and mixed
together. Those whose nearest samples say too little, and those beside the border, go through the body of
`post.upsampling.kernel` one by one. Names and steps are those of `post.upsampling.reference`, the definition.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import contracted, scalar
from post.filters.constants import HIT
from post.filters.kernel import Guide, guide_row
from post.filters.weight_kernel import Near, edge_weight, edge_with, near_row
from post.upsampling.kernel import ENOUGH, ONE, POWER, SENSITIVITY, SQUARINGS, TINY, ZERO, upsampled_row

NEAREST = 4  # samples
GUIDES, PLANES = 5, 3  # of `edges.Surface.guide` without roughness, and of `weight_kernel.Near`

Room = namedtuple("Room", "near here planes weights total mixed around one")
"""Of a thread: a row of `Near`; of pixels a stride apart, the guide, their `Near`, the weights of their nearest
samples, the sum of these, and a channel; the weights around a single pixel, and its `Near`."""
Between = namedtuple("Between", "x left count across down step_x step_y")
"""Pixels a stride apart: the first and the sample to its left, how many, and where they lie between samples, in shares
and in pixels."""


@scalar
def _between(phase, y, grid, span):
    """The pixels of a span that are ``phase`` right of a sample and have samples on both sides, or lie on one."""
    before, stride = grid.column + phase, np.float32(grid.stride)
    first = max(-((before - span[0]) // grid.stride), 0)
    last = min(grid.columns - (1 if phase == 0 else 2), (span[1] - 1 - before) // grid.stride)
    down = (y - grid.row) % grid.stride
    x, count = before + first * grid.stride, max(last + 1 - first, 0)
    return Between(x, first, count, np.float32(phase) / stride, np.float32(down) / stride, phase, down)


@scalar
def _spread_out(room, guide, y, at, stride):
    """Copy every ``stride``-th pixel of a row of the guide and of `Near`."""
    for k in range(GUIDES):
        row, given = room.here[k], guide[k, y]
        for i in range(at.count):
            row[i] = given[at.x + i * stride]
    for k in range(PLANES):
        row, given = room.planes[k], room.near[k]
        for i in range(at.count):
            row[i] = given[at.x + i * stride]


@contracted
@scalar
def _weigh_one(weights, here, planes, there, share, dx, dy, edge):
    for i in range(weights.shape[0]):
        weights[i] = share * edge_weight(i, here, planes, i, there, dx, dy, edge, ZERO)


@contracted
@scalar
def _mix_two(mixed, one, two, first, second):
    for i in range(mixed.shape[0]):
        mixed[i] += one[i] * first[i] + two[i] * second[i]


@scalar
def _weigh(room, there, top, at, grid, edge):
    """Weights of the nearest samples, which add up to 1, and before that to ``room.total``."""
    n, total = at.count, room.total
    here = Guide(
        room.here[0, :n], room.here[1, :n], room.here[2, :n], room.here[3, :n], room.here[4, :n], room.here[4, :n]
    )
    planes = Near(room.planes[0, :n], room.planes[1, :n], room.planes[2, :n])
    for tap in range(NEAREST):
        weights, right, below = room.weights[tap, :n], tap % 2, tap // 2
        share = (at.across if right else ONE - at.across) * (at.down if below else ONE - at.down)
        if share == ZERO:
            weights[:] = ZERO
            continue
        dx, dy = np.float32(right * grid.stride - at.step_x), np.float32(below * grid.stride - at.step_y)
        row = guide_row(there, top + below, at.left + right, at.left + right + n)
        _weigh_one(weights, here, planes, row, share, dx, dy, edge)
    one, two, three, four = room.weights[0], room.weights[1], room.weights[2], room.weights[3]
    for i in range(n):
        total[i] = one[i] + two[i] + three[i] + four[i]
    for tap in range(NEAREST):
        weights = room.weights[tap]
        for i in range(n):
            weights[i] /= max(total[i], TINY)


@scalar
def _mix(out, low, room, y, top, at, grid):
    """All channels of the pixels from their nearest samples."""
    n, right, below = at.count, 1 if at.step_x else 0, 1 if at.step_y else 0
    mixed, weights = room.mixed[:n], room.weights
    begin, end = at.left + right, at.left + right + n
    for c in range(out.shape[0]):
        mixed[:] = ZERO
        _mix_two(mixed, weights[0, :n], weights[1, :n], low[c, top, at.left : at.left + n], low[c, top, begin:end])
        if below:
            upper = low[c, top + 1]
            _mix_two(mixed, weights[2, :n], weights[3, :n], upper[at.left : at.left + n], upper[begin:end])
        row = out[c, y]
        for i in range(n):
            row[at.x + i * grid.stride] = mixed[i]


@scalar
def _copy(out, low, y, top, at, grid):
    for c in range(out.shape[0]):
        row, given = out[c, y], low[c, top]
        for i in range(at.count):
            row[at.x + i * grid.stride] = given[at.left + i]


@scalar
def _hit_span(hit, y):
    """The first pixel of a row that was hit, and the one after the last."""
    first, end = 0, hit.shape[1]
    while first < end and hit[y, first] == ZERO:
        first += 1
    while end > first and hit[y, end - 1] == ZERO:
        end -= 1
    return first, end


@scalar
def upsampled_picture_row(out, low, guide, there, plane, clear, room, y, grid, perspective):
    """A row from samples ``low`` ``(C, h, w)``; ``there`` ``(5, h, w)`` is the guide of the samples."""
    span = _hit_span(guide[HIT], y)
    for c in range(out.shape[0]):
        out[c, y, : span[0]] = clear[c]
        out[c, y, span[1] :] = clear[c]
    edge, top = edge_with(guide, perspective, SQUARINGS, POWER), (y - grid.row) // grid.stride
    near_row(room.near, plane, y, 0, out.shape[2], SENSITIVITY / np.float32(grid.stride))
    inside = top >= 0 and (top + 1 < grid.rows or (top < grid.rows and (y - grid.row) % grid.stride == 0))
    for phase in range(grid.stride):
        at = _between(phase, y, grid, span)
        count, sampled = at.count if inside else 0, at.step_x == 0 and at.step_y == 0
        if count > 0 and sampled:
            _copy(out, low, y, top, at, grid)
        elif count > 0:
            _spread_out(room, guide, y, at, grid.stride)
            _weigh(room, there, top, at, grid, edge)
            _mix(out, low, room, y, top, at, grid)
        for x in range(span[0] + (grid.column + phase - span[0]) % grid.stride, span[1], grid.stride):
            i = (x - at.x) // grid.stride
            known = x >= at.x and i < count
            if guide[HIT, y, x] == ZERO:
                for c in range(out.shape[0]):
                    out[c, y, x] = clear[c]
            elif not known or not (sampled or room.total[i] >= ENOUGH):
                upsampled_row(out, low, guide, plane, clear, room.around, room.one, y, x, x + 1, grid, perspective)
