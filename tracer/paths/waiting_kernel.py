"""Rays of paths to lights and to the sky, which wait until there are enough of them to fill lanes; on a GPU none waits.

Nothing else in a path depends on what comes along them. See `tracer.traversal.waiting_kernel`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import allocating, scalar
from tracer.lights.sky_kernel import sky
from tracer.sampling.scatter_kernel import times
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW
from tracer.traversal import waiting_kernel
from tracer.traversal.kernel import transmitted, triple
from tracer.traversal.lane_kernel import BATCH, new_lanes
from tracer.traversal.rays import FARTHEST

Waiting = namedtuple("Waiting", "lanes to_lights to_sky")
"""Scratch of one thread: lanes, and rays that wait for them. None in its place is for where none waits."""
_Bringing = namedtuple("_Bringing", "rays colors places")
"""Rays; the color of the light at the end of each, or its share of the sky's; and the place where that counts, see
`arrive`."""


@allocating
def new_waiting():
    """Scratch memory of one thread."""
    lanes = new_lanes()
    return Waiting(lanes, _new_bringing(lanes), _new_bringing(lanes))


@allocating
def _new_bringing(lanes):
    return _Bringing(waiting_kernel.new_waiting(lanes), np.zeros((BATCH, 3)), np.zeros((BATCH, 3), np.int32))


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
def _fills(bringing, origin, direction, t_end, color, place):
    """Add a ray; whether there is no room for another."""
    i = waiting_kernel.add(bringing.rays, origin, direction, min(t_end, FARTHEST))
    bringing.colors[i, 0], bringing.colors[i, 1], bringing.colors[i, 2] = color
    bringing.places[i, 0], bringing.places[i, 1], bringing.places[i, 2] = place
    return waiting_kernel.is_full(bringing.rays)


@scalar
def _place_of(bringing, i):
    return bringing.places[i, 0], bringing.places[i, 1], bringing.places[i, 2]


@scalar
def _finish_lights(waiting, tables, out):
    bringing, rays = waiting.to_lights, waiting.to_lights.rays
    for i in range(waiting_kernel.trace_all(rays, tables.transforms, tables.grids, MASK_SHADOW)):
        arrive(out, _place_of(bringing, i), times(triple(rays.passed, i, 0), triple(bringing.colors, i, 0)))


@scalar
def _finish_sky(waiting, tables, out):
    bringing, rays = waiting.to_sky, waiting.to_sky.rays
    for i in range(waiting_kernel.trace_all(rays, tables.transforms, tables.grids, MASK_SECONDARY)):
        passed = triple(rays.passed, i, 0)
        if max(passed) > 0:
            share = times(passed, triple(bringing.colors, i, 0))
            arrive(out, _place_of(bringing, i), times(share, sky(tables.lit, triple(rays.directions, i, 0))))
