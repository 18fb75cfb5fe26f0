"""Paths from the surfaces of a picture, a batch at a time: their numbers are drawn, and their first rays go in lanes.

See `tracer.traversal.batch_kernel`. A GPU has a path at a time in each thread.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import Lanes, allocating, in_lanes, scalar
from tracer.paths.waiting_kernel import new_waiting
from tracer.sampling.scatter_kernel import cosine_direction
from tracer.sampling.sequence import BELOW_ONE
from tracer.scene.scene import MASK_SECONDARY
from tracer.traversal import batch_kernel
from tracer.traversal.kernel import nearest, triple
from tracer.traversal.lane_kernel import BATCH
from tracer.traversal.rays import FARTHEST

ONE, MOST = np.float32(1.0), np.float32(BELOW_ONE)

# Rows of the scratch memory for directions: normals, and directions about them.
NX, NY, NZ, DX, DY, DZ = map(Lanes, range(0, 6 * BATCH, BATCH))
ROWS = Lanes(6 * BATCH)
NONE = (-1, 0, (0, 0, 0))  # what a ray begins in that begins in the air

Paths = namedtuple("Paths", "waiting u rows origins directions spans weights left numbers ids found")
"""Scratch of one thread: rays that wait; numbers of each path; its first ray, with two numbers for its weight; what it
hits; and ``(3, BATCH)`` light that paths find."""


@allocating
def new_paths(dims):
    """Scratch memory of one thread for paths of ``dims`` numbers."""
    return Paths(
        new_waiting(),
        np.zeros((dims, BATCH), np.float32),
        np.zeros(ROWS),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 3)),
        np.zeros((BATCH, 2)),
        np.zeros((BATCH, 2)),
        np.zeros((0, 5), np.int32),
        np.zeros((BATCH, 4)),
        np.zeros((BATCH, 7), np.int32),
        np.zeros((3, BATCH)),
    )


@scalar
def draw(paths, points, rotation, pixels):
    """The numbers of as many paths from each pixel as there are points; see `tracer.sampling.sequence.Sequence`."""
    for d in range(len(paths.u)):
        j = 0
        for pixel in pixels:
            turn = rotation[d, pixel]
            for k in range(len(points)):
                number = points[k, d] + turn
                paths.u[d, j] = min(number - ONE if number >= ONE else number, MOST)
                j += 1


@scalar
def even_directions(paths, count):
    """See `tracer.sampling.scatter_kernel.cosine_direction`."""
    rows, first, second = paths.rows, paths.u[0], paths.u[1]
    for j in range(count):
        x, y, z = rows[NX + j], rows[NY + j], rows[NZ + j]
        rows[DX + j], rows[DY + j], rows[DZ + j] = cosine_direction((x, y, z), first[j], second[j])


@scalar
def put_ray(paths, j, origin, direction, t_end):
    """Give a path its first ray."""
    paths.origins[j, 0], paths.origins[j, 1], paths.origins[j, 2] = origin
    paths.directions[j, 0], paths.directions[j, 1], paths.directions[j, 2] = direction
    paths.spans[j, 1] = min(t_end, FARTHEST)


@scalar
def _trace_alone(paths, count, transforms, grids):
    for j in range(count):
        origin, direction, t_end = triple(paths.origins, j, 0), triple(paths.directions, j, 0), paths.spans[j, 1]
        t, entry, material, face, back, voxel, place = nearest(
            transforms, grids, origin, direction, 0.0, t_end, NONE, MASK_SECONDARY
        )
        paths.numbers[j, 0], paths.ids[j, 0], paths.ids[j, 1], paths.ids[j, 2] = t, material, entry, face
        paths.ids[j, 3] = 1 if back else 0
        for k in range(3):
            paths.numbers[j, 1 + k], paths.ids[j, 4 + k] = place[k], voxel[k]


@in_lanes(_trace_alone)
def trace(paths, count, transforms, grids):
    """Find what the first rays of ``count`` paths hit."""
    rays = paths.origins[:count], paths.directions[:count], paths.spans[:count]
    lanes, numbers, ids = paths.waiting.lanes, paths.numbers[:count], paths.ids[:count]
    batch_kernel.nearest(lanes, transforms, grids, rays, paths.left, MASK_SECONDARY, numbers, ids)


@scalar
def hit_of(paths, j):
    """What a path's first ray hits, as `tracer.traversal.kernel.nearest` says it."""
    ids = paths.ids
    return (
        paths.numbers[j, 0],
        int(ids[j, 1]),
        int(ids[j, 0]),
        int(ids[j, 2]),
        ids[j, 3] > 0,
        (int(ids[j, 4]), int(ids[j, 5]), int(ids[j, 6])),
        triple(paths.numbers, j, 1),
    )
