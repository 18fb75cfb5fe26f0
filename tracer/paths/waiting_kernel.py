"""Rays of paths to lights and to the sky, which wait until there are enough of them to fill lanes; on a GPU none waits.

Nothing else in a path depends on what comes along them. See `tracer.traversal.batch_kernel`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, in_lanes, scalar
from tracer.lights.sky_kernel import sky
from tracer.sampling.scatter_kernel import times
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW
from tracer.traversal import batch_kernel
from tracer.traversal.kernel import transmitted, triple
from tracer.traversal.lane_kernel import BATCH
from tracer.traversal.rays import FARTHEST

Waiting = namedtuple("Waiting", "origins directions spans passed colors places used")
"""Rays that wait: what passes along each; the color of the light at its end if that is a light, else its share of the
sky's; and the place where it counts, see `arrive`. And how many rays there are."""


@allocating
def new_waiting():
    """Scratch memory for one batch."""
    return Waiting(
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 2)),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 3), np.int32),
        np.zeros(1, np.int64),
    )


@scalar
def arrive(out, place, light):
    """Light counts in a column of sums and three rows of it from the first on, also in three from another on unless
    that is below 0."""
    i, row, also = place
    for k in range(3):
        out[row + k, i] += light[k]
    if also >= 0:
        for k in range(3):
            out[also + k, i] += light[k]


@scalar
def _wait(waiting, origin, direction, t_end, color, place):
    """Whether there is no room for another ray after this."""
    i = waiting.used[0]
    waiting.origins[i, 0], waiting.origins[i, 1], waiting.origins[i, 2] = origin
    waiting.directions[i, 0], waiting.directions[i, 1], waiting.directions[i, 2] = direction
    waiting.colors[i, 0], waiting.colors[i, 1], waiting.colors[i, 2] = color
    waiting.places[i, 0], waiting.places[i, 1], waiting.places[i, 2] = place
    waiting.spans[i, 1] = min(t_end, FARTHEST)
    waiting.used[0] = i + 1
    return i + 1 == BATCH


@scalar
def _send_alone(paths, tables, origin, direction, t_end, color, place, out):
    t_end = min(t_end, FARTHEST)
    passed = transmitted(tables.transforms, tables.grids, origin, direction, 0.0, t_end, MASK_SHADOW)
    arrive(out, place, times(passed, color))


@in_lanes(_send_alone)
def send(paths, tables, origin, direction, t_end, color, place, out):
    """A ray to a light, along which a color comes to a place."""
    if _wait(paths.to_lights, origin, direction, t_end, color, place):
        _finish_lights(paths, tables, out)


@scalar
def _send_to_sky_alone(paths, tables, origin, direction, share, place, out):
    passed = transmitted(tables.transforms, tables.grids, origin, direction, 0.0, FARTHEST, MASK_SECONDARY)
    if max(passed) > 0:
        arrive(out, place, times(times(passed, share), sky(tables.lit, direction)))


@in_lanes(_send_to_sky_alone)
def send_to_sky(paths, tables, origin, direction, share, place, out):
    """A ray to the sky, along which a share of its light comes to a place."""
    if _wait(paths.to_sky, origin, direction, FARTHEST, share, place):
        _finish_sky(paths, tables, out)


@scalar
def _trace_waiting(paths, waiting, tables, mask):
    """Find what passes along the rays that wait; how many they are."""
    count = waiting.used[0]
    rays = waiting.origins[:count], waiting.directions[:count], waiting.spans[:count]
    batch_kernel.transmitted(paths.lanes, tables.transforms, tables.grids, rays, mask, waiting.passed[:count])
    waiting.used[0] = 0
    return count


@scalar
def _place_of(waiting, i):
    return waiting.places[i, 0], waiting.places[i, 1], waiting.places[i, 2]


@scalar
def _finish_lights(paths, tables, out):
    waiting = paths.to_lights
    for i in range(_trace_waiting(paths, waiting, tables, MASK_SHADOW)):
        arrive(out, _place_of(waiting, i), times(triple(waiting.passed, i, 0), triple(waiting.colors, i, 0)))


@scalar
def _finish_sky(paths, tables, out):
    waiting = paths.to_sky
    for i in range(_trace_waiting(paths, waiting, tables, MASK_SECONDARY)):
        passed = triple(waiting.passed, i, 0)
        if max(passed) > 0:
            share = times(passed, triple(waiting.colors, i, 0))
            arrive(out, _place_of(waiting, i), times(share, sky(tables.lit, triple(waiting.directions, i, 0))))


@scalar
def _none_waits(paths, tables, out):
    pass


@in_lanes(_none_waits)
def finish(paths, tables, out):
    """Trace all rays that wait."""
    _finish_lights(paths, tables, out)
    _finish_sky(paths, tables, out)
