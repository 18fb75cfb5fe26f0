"""Scalar kernels of one ray in an octree; see `tracer.traversal.octree`. Coordinates count voxels from its corner."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.traversal.grid_kernel import cell_at, inside, ray_in_grid, slabs, step, triple

SOLID = -1  # medium of a ray that began inside something opaque and has not left it yet


@inlined
def descend(nodes, path, c, level):
    """The voxel id at a cell and the level of the uniform cube around it, down from the node of ``path`` at a level."""
    node = path[level]
    while True:
        level -= 1
        child = nodes[node, ((c[0] >> level & 1) << 2) | ((c[1] >> level & 1) << 1) | (c[2] >> level & 1)]
        if child <= 0:
            return -child, level
        path[level] = node = child


@scalar
def _find(nodes, path, top, media, box, o, d, inv, c, t, t_end, axis, medium):
    """Step to where the medium changes: t (-1 for none), axis, cell, the voxel id there, and the medium left."""
    level = top
    while True:
        value, level = descend(nodes, path, c, level)
        if value != medium:
            if medium == SOLID:
                if value == 0 or media[value, 0] < 1.0:
                    medium = value
            else:
                return t, axis, c, value, medium
        low = (c[0] >> level << level, c[1] >> level << level, c[2] >> level << level)
        t, axis, c = step(o, d, inv, low, 1 << level)
        if not t < t_end:
            return -1.0, axis, c, 0, 0
        if not inside(c, box):
            return (t if medium > 0 else -1.0), axis, c, 0, medium
        apart = (low[0] ^ c[0]) | (low[1] ^ c[1]) | (low[2] ^ c[2])
        level += 1
        while apart >> level:  # up to the node that both cubes are part of
            level += 1


@scalar
def surface(i, origins, directions, spans, matrix, nodes, box, media, paths, numbers, ids):
    """One ray, written to its rows of ``numbers`` and ``ids`` as in `tracer.traversal.op.surface`."""
    top, path = paths.shape[1] - 1, paths[i]
    path[top] = 0
    numbers[i, 0], ids[i, 1] = np.inf, -1
    o, d, inv = ray_in_grid(matrix, triple(origins, i, 0), triple(directions, i, 0))
    enter, leave, axis = slabs(o, inv, box)
    t_begin, t_end = np.float64(spans[i, 0]), np.float64(spans[i, 1])
    t = max(enter, t_begin)
    if not (t < leave and t < t_end and math.isfinite(leave)):
        return
    c, medium = cell_at(o, d, t, box), 0
    if enter <= t_begin:
        medium = descend(nodes, path, c, top)[0]
        if medium > 0 and media[medium, 0] >= 1.0:
            medium = SOLID
    t, axis, c, value, medium = _find(nodes, path, top, media, box, o, d, inv, c, t, t_end, axis, medium)
    if t < 0:
        return
    back, falls = value == 0, d[axis] < 0
    numbers[i, 0] = t
    ids[i, 0], ids[i, 1], ids[i, 2], ids[i, 3] = medium if back else value, 0, 2 * axis + falls, back
    for k in range(3):
        numbers[i, 1 + k] = o[k] + d[k] * t - matrix[k, 3]
        ids[i, 4 + k] = c[k] - int(matrix[k, 3])
    if back:  # a back face belongs to the voxel before it
        ids[i, 4 + axis] += 1 if falls else -1
