"""Rays of paths to lights and to the sky, which wait until there are enough of them to fill lanes; on a GPU none waits.

Nothing else in a path depends on what comes along them. See `tracer.traversal.batch_kernel`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, scalar
from tracer.lights.sky_kernel import sky
from tracer.sampling.scatter_kernel import times
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW
from tracer.traversal import batch_kernel
from tracer.traversal.kernel import transmitted, triple
from tracer.traversal.lane_kernel import BATCH, new_lanes
from tracer.traversal.rays import FARTHEST

Waiting = namedtuple("Waiting", "lanes to_lights to_sky")
"""Scratch of one thread: rays that wait. None in its place is for where none waits."""
_Rays = namedtuple("_Rays", "origins directions spans passed colors places used")
"""A batch: what passes along each ray; the color of the light at its end, or its share of the sky's; the place where
that counts, see `arrive`; and how many rays there are."""


@allocating
def new_waiting():
    """Scratch memory of one thread."""
    return Waiting(new_lanes(), _new_rays(), _new_rays())


@allocating
def _new_rays():
    return _Rays(
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
    """Count light in sums: in the column that a place begins with, in three rows from its second number on, and in
    three from its third unless that is below 0."""
    i, row, also = place
    for k in range(3):
        out[row + k, i] += light[k]
    if also >= 0:
        for k in range(3):
            out[also + k, i] += light[k]


@scalar
def send(waiting, tables, origin, direction, t_end, color, place, out):
    """A ray to a light, along which a color comes to a place."""
    if waiting is None:
        t_end = min(t_end, FARTHEST)
        passed = transmitted(tables.transforms, tables.grids, origin, direction, 0.0, t_end, MASK_SHADOW)
        arrive(out, place, times(passed, color))
    elif _fills(waiting.to_lights, origin, direction, t_end, color, place):
        _finish_lights(waiting, tables, out)


@scalar
def send_to_sky(waiting, tables, origin, direction, share, place, out):
    """A ray to the sky, along which a share of its light comes to a place."""
    if waiting is None:
        passed = transmitted(tables.transforms, tables.grids, origin, direction, 0.0, FARTHEST, MASK_SECONDARY)
        if max(passed) > 0:
            arrive(out, place, times(times(passed, share), sky(tables.lit, direction)))
    elif _fills(waiting.to_sky, origin, direction, FARTHEST, share, place):
        _finish_sky(waiting, tables, out)


@scalar
def finish(waiting, tables, out):
    """Trace all rays that wait."""
    if waiting is not None:
        _finish_lights(waiting, tables, out)
        _finish_sky(waiting, tables, out)


@scalar
def _fills(rays, origin, direction, t_end, color, place):
    """Add a ray; whether there is no room for another."""
    i = rays.used[0]
    rays.origins[i, 0], rays.origins[i, 1], rays.origins[i, 2] = origin
    rays.directions[i, 0], rays.directions[i, 1], rays.directions[i, 2] = direction
    rays.colors[i, 0], rays.colors[i, 1], rays.colors[i, 2] = color
    rays.places[i, 0], rays.places[i, 1], rays.places[i, 2] = place
    rays.spans[i, 1] = min(t_end, FARTHEST)
    rays.used[0] = i + 1
    return i + 1 == BATCH


@scalar
def _trace(lanes, waiting, tables, mask):
    """Find what passes along rays that wait; how many they are."""
    count = waiting.used[0]
    rays = waiting.origins[:count], waiting.directions[:count], waiting.spans[:count]
    batch_kernel.transmitted(lanes, tables.transforms, tables.grids, rays, mask, waiting.passed[:count])
    waiting.used[0] = 0
    return count


@scalar
def _place_of(rays, i):
    return rays.places[i, 0], rays.places[i, 1], rays.places[i, 2]


@scalar
def _finish_lights(waiting, tables, out):
    rays = waiting.to_lights
    for i in range(_trace(waiting.lanes, rays, tables, MASK_SHADOW)):
        arrive(out, _place_of(rays, i), times(triple(rays.passed, i, 0), triple(rays.colors, i, 0)))


@scalar
def _finish_sky(waiting, tables, out):
    rays = waiting.to_sky
    for i in range(_trace(waiting.lanes, rays, tables, MASK_SECONDARY)):
        passed = triple(rays.passed, i, 0)
        if max(passed) > 0:
            share = times(passed, triple(rays.colors, i, 0))
            arrive(out, _place_of(rays, i), times(share, sky(tables.lit, triple(rays.directions, i, 0))))
