"""The compiled form of `tracer.paths.on_screen`: one point at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from tracer.paths.on_screen import EDGE_ON, NEIGHBORS, SLACK
from tracer.sampling.scatter_kernel import along, dot, scaled

VIEW, FOCAL, CENTER, JITTER, POSITION, FORWARD, ORTHOGRAPHIC, SIZE, BACK = 0, 12, 14, 16, 18, 21, 24, 25, 27
"""Offsets in the flat numbers of a camera: first view from world, row by row; last, 12 for each instance."""
DEPTH, NORMAL = 0, 1
"""Rows of a picture."""


@scalar
def _carried(camera, first, point, w):
    """A point, or a direction if ``w`` is 0, transformed by the matrix at offset ``first``."""
    row = camera[first : first + 12]
    x = row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3] * w
    y = row[4] * point[0] + row[5] * point[1] + row[6] * point[2] + row[7] * w
    z = row[8] * point[0] + row[9] * point[1] + row[10] * point[2] + row[11] * w
    return x, y, z


@scalar
def back_project(camera, point, normal, instance):
    """See `tracer.paths.on_screen.Picture.back_project`."""
    first = BACK + 12 * (instance - 1)
    if instance < 1 or len(camera) <= first:
        return point, normal
    return _carried(camera, first, point, 1.0), _carried(camera, first, normal, 0.0)


@scalar
def sees(camera, picture, point, normal):
    """See `tracer.paths.on_screen.Picture.sees`."""
    flat = camera[ORTHOGRAPHIC] > 0
    place = (camera[POSITION], camera[POSITION + 1], camera[POSITION + 2])
    toward = along(point, place, -1.0)
    if flat:
        toward = (camera[FORWARD], camera[FORWARD + 1], camera[FORWARD + 2])
    at = _carried(camera, VIEW, point, 1.0)
    if dot(toward, normal) >= 0 or at[2] <= 0:
        return False
    z = 1.0 if flat else max(at[2], 1e-9)
    x = at[0] / z * camera[FOCAL] + camera[CENTER] - camera[JITTER]
    y = at[1] / z * camera[FOCAL + 1] + camera[CENTER + 1] - camera[JITTER + 1]
    height, width = int(camera[SIZE]), int(camera[SIZE + 1])
    if not (0 <= x < width and 0 <= y < height):
        return False
    slack = SLACK * z / camera[FOCAL + 1]
    for dy, dx in NEIGHBORS:
        row, column = min(max(int(y) + dy, 0), height - 1), min(max(int(x) + dx, 0), width - 1)
        depth = np.float64(picture[DEPTH, row * width + column])
        if abs(depth - at[2]) < slack or _on_plane(camera, picture, row, column, depth, at, slack):
            return True
    return False


@scalar
def _on_plane(camera, picture, row, column, depth, at, slack):
    if not math.isfinite(depth):
        return False
    flat, pixel = camera[ORTHOGRAPHIC] > 0, row * int(camera[SIZE + 1]) + column
    normal = (
        np.float64(picture[NORMAL, pixel]),
        np.float64(picture[NORMAL + 1, pixel]),
        np.float64(picture[NORMAL + 2, pixel]),
    )
    z = 1.0 if flat else depth
    point = (
        (column + 0.5 + camera[JITTER] - camera[CENTER]) / camera[FOCAL] * z,
        (row + 0.5 + camera[JITTER + 1] - camera[CENTER + 1]) / camera[FOCAL + 1] * z,
        depth,
    )
    off = dot(along(at, point, -1.0), normal)
    lean = abs(normal[2]) if flat else abs(dot(normal, scaled(at, 1 / max(at[2], 1e-9))))
    return lean > EDGE_ON and abs(off) < slack * lean
