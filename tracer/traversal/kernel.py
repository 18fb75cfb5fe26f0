"""Kernels of `tracer.traversal.reference`: one ray at a time, with steps as long as the space is empty.

Points, directions and cells are triples, in grid coordinates unless stated otherwise.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.sampling.scatter_kernel import dot, enters_smooth, scaled
from tracer.scene.grids import MASK, MATERIAL, ORIGIN
from tracer.traversal.grid_kernel import (
    SPHERE,
    cell_at,
    counted,
    inside,
    look,
    may_enter,
    ray_in_grid,
    slabs,
    step,
    triple,
)

SOLID = -1  # medium of a ray that began inside something opaque and has not left it yet


@scalar
def _find(bricks, index, media, box, o, d, inv, c, t, t_end, axis, medium, silent):
    """Step to where the medium changes: t (-1 for none), axis, cell, the voxel id there, and the medium left."""
    while True:
        value, low, size = look(bricks, index, box, c)
        if value != medium:
            if medium == SOLID:
                if value == 0 or media[value + box[MATERIAL], 0] < 1.0:
                    medium = value
            elif silent and value == 0:
                medium = 0
            else:
                return t, axis, c, value, medium
        t, axis, c = step(o, d, inv, low, size)
        if not t < t_end:
            return -1.0, axis, c, 0, 0
        if not inside(c, box):
            return (t if medium > 0 and not silent else -1.0), axis, c, 0, medium


@scalar
def nearest(transforms, grids, origin, direction, t_begin, t_end, left, mask):
    """The first surface on a ray: t (inf for none), entry (-1), material, face, whether it is the back, voxel, place.

    ``left`` is entry (-1 for none), material and voxel of what the ray begins in; see `tracer.traversal.op.surface`.
    """
    bricks, index, entries, media = grids
    found, t_found, material, face, back = -1, np.inf, 0, 0, False
    voxel, place = (0, 0, 0), (0.0, 0.0, 0.0)
    for entry in range(entries.shape[0]):
        box = entries[entry]
        if not (box[MASK] & mask and may_enter(transforms[entry, SPHERE], origin, direction, t_end)):
            continue
        o, d, inv = ray_in_grid(transforms[entry], origin, direction)
        enter, leave, axis = slabs(o, inv, box)
        t = max(enter, t_begin)
        if not (t < leave and t < t_end and math.isfinite(leave)):
            continue
        c, medium, silent = cell_at(o, d, t, box), 0, False
        if left[0] == entry:
            c = counted(left[2], box)
            medium, silent = left[1] - box[MATERIAL], True
        elif enter <= t_begin:
            medium = look(bricks, index, box, c)[0]
            if medium > 0 and media[medium + box[MATERIAL], 0] >= 1.0:
                medium = SOLID
        t, axis, c, value, medium = _find(bricks, index, media, box, o, d, inv, c, t, t_end, axis, medium, silent)
        if t < 0:
            continue
        found, t_found, t_end, back = entry, t, t, value == 0
        material = (medium if back else value) + box[MATERIAL]
        falls = d[axis] < 0
        face = 2 * axis + (1 if falls else 0)
        offset = (1 if falls else -1) if back else 0  # a back face belongs to the voxel before it
        voxel = (
            c[0] + box[ORIGIN] + (offset if axis == 0 else 0),
            c[1] + box[ORIGIN + 1] + (offset if axis == 1 else 0),
            c[2] + box[ORIGIN + 2] + (offset if axis == 2 else 0),
        )
        place = (
            o[0] + d[0] * t + box[ORIGIN],
            o[1] + d[1] * t + box[ORIGIN + 1],
            o[2] + d[2] * t + box[ORIGIN + 2],
        )
    return t_found, found, material, face, back, voxel, place


@scalar
def dimmed(light, row, length):
    """Light after a run through a transmissive material."""
    rest = 1.0 - row[0]
    return (
        light[0] * rest * row[1] ** length,
        light[1] * rest * row[2] ** length,
        light[2] * rest * row[3] ** length,
    )


@inlined
def _through(bricks, index, media, box, o, d, inv, t, t_end, axis, light):
    """Light after the grid between ``t`` and ``t_end``.

    It enters through the face across ``axis`` (-1 if it begins inside).
    """
    c, medium, began, within = cell_at(o, d, t, box), 0, t, False
    while True:
        value, low, size = look(bricks, index, box, c)
        if value != medium:
            if medium > 0:
                light = dimmed(light, media[medium + box[MATERIAL]], t - began)
            if value > 0 and media[value + box[MATERIAL], 0] >= 1.0:
                return (0.0, 0.0, 0.0)
            if (value > 0 or within) and axis >= 0:
                light = scaled(light, enters(d, axis))
            medium, began, within = value, t, value > 0 and axis < 0
        t, axis, c = step(o, d, inv, low, size)
        leaves = not inside(c, box)
        if leaves or not t < t_end:
            if medium > 0:
                light = dimmed(light, media[medium + box[MATERIAL]], min(t, t_end) - began)
            return scaled(light, enters(d, axis)) if within and leaves and t < t_end else light


@scalar
def enters(d, axis):
    """See `tracer.sampling.scatter_kernel.enters_smooth`, for a face across an axis."""
    return enters_smooth(abs(d[axis]) / math.sqrt(dot(d, d)))


@scalar
def transmitted(transforms, grids, origin, direction, t_begin, t_end, mask):
    """The share of light transmitted between two places on a ray."""
    bricks, index, entries, media = grids
    light = (1.0, 1.0, 1.0)
    for entry in range(len(entries)):
        box = entries[entry]
        if box[MASK] & mask and may_enter(transforms[entry, SPHERE], origin, direction, t_end):
            o, d, inv = ray_in_grid(transforms[entry], origin, direction)
            enter, leave, axis = slabs(o, inv, box)
            t = max(enter, t_begin)
            if t < leave and t < t_end and math.isfinite(leave):
                axis = axis if enter > t_begin else -1
                light = _through(bricks, index, media, box, o, d, inv, t, t_end, axis, light)
                if max(light) <= 0.0:
                    break
    return light


@scalar
def _run(bricks, index, box, o, d, inv, t, t_end, c, material):
    """Length of the ray through solid voxels, and through the first of the same material."""
    begin, length, same, going = t, 0.0, 0.0, True
    while True:
        value, low, size = look(bricks, index, box, c)
        going = going and value == material
        if value == 0:
            return length, same
        t, _, c = step(o, d, inv, low, size)
        length = max(min(t, t_end) - begin, 0.0)
        same = length if going else same
        if not (t < t_end and inside(c, box)):
            return length, same


@scalar
def run_length(transforms, grids, origin, direction, t, t_end, entry, material, voxel):
    """Length of a ray from a surface through voxels that are not air, and through the first of its material."""
    bricks, index, entries, _ = grids
    box = entries[entry]
    o, d, inv = ray_in_grid(transforms[entry], origin, direction)
    return _run(bricks, index, box, o, d, inv, t, t_end, counted(voxel, box), material - box[MATERIAL])


@scalar
def _own(transforms, i, count):
    """The batch element of ray ``i`` of ``count``."""
    return 0 if transforms.shape[0] == 1 else i // (count // transforms.shape[0])


@scalar
def surface(i, origins, directions, spans, transforms, bricks, index, entries, media, left, mask, numbers, ids):
    """See `tracer.traversal.op.surface`: one ray, written to its rows of ``numbers`` and ``ids``."""
    before = (-1, 0, (0, 0, 0))
    if left.shape[0] > 0:
        before = (int(left[i, 1]), int(left[i, 0]), (int(left[i, 2]), int(left[i, 3]), int(left[i, 4])))
    origin, direction = triple(origins, i, 0), triple(directions, i, 0)
    t_begin, t_end = np.float64(spans[i, 0]), np.float64(spans[i, 1])
    own, grids = transforms[_own(transforms, i, origins.shape[0])], (bricks, index, entries, media)
    t, entry, material, face, back, voxel, place = nearest(own, grids, origin, direction, t_begin, t_end, before, mask)
    numbers[i, 0], ids[i, 0], ids[i, 1], ids[i, 2], ids[i, 3] = t, material, entry, face, back
    for k in range(3):
        numbers[i, 1 + k], ids[i, 4 + k] = place[k], voxel[k]


@scalar
def transmit(i, origins, directions, spans, transforms, bricks, index, entries, media, mask, passed):
    """See `tracer.traversal.op.transmit`: one ray, written to its row of ``passed``."""
    origin, direction = triple(origins, i, 0), triple(directions, i, 0)
    t_begin, t_end = np.float64(spans[i, 0]), np.float64(spans[i, 1])
    own, grids = transforms[_own(transforms, i, origins.shape[0])], (bricks, index, entries, media)
    light = transmitted(own, grids, origin, direction, t_begin, t_end, mask)
    passed[i, 0], passed[i, 1], passed[i, 2] = light


@scalar
def runs(i, origins, directions, spans, transforms, bricks, index, entries, media, starts, lengths):
    """See `tracer.traversal.op.runs`: one ray, written to its row of ``lengths``."""
    if starts[i, 1] < 0:
        return
    origin, direction = triple(origins, i, 0), triple(directions, i, 0)
    t, t_end = np.float64(spans[i, 0]), np.float64(spans[i, 1])
    voxel = (int(starts[i, 2]), int(starts[i, 3]), int(starts[i, 4]))
    own, grids = transforms[_own(transforms, i, origins.shape[0])], (bricks, index, entries, media)
    found = run_length(own, grids, origin, direction, t, t_end, starts[i, 1], starts[i, 0], voxel)
    lengths[i, 0], lengths[i, 1] = found
