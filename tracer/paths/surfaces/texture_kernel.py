"""The compiled form of `tracer.texture`: what the surface is like where one ray hits it."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from tracer.sampling.scatter_kernel import along, combined, dot, scaled
from tracer.scene.textures import TILT
from tracer.texture import GRAZING, OCTAVES

FIRST, SIDE = 5, 11
"""Columns of `tracer.paths.interaction_kernel.Tables.materials` that begin with those of the first face."""


@scalar
def size(row):
    """Length of the first three numbers of a transform's row: voxels a world unit."""
    return math.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2])


@scalar
def texel(materials, hit, scale, pixels):
    """Row of the texel that shows; see `tracer.texture`. ``scale``: world units a voxel."""
    _, _, material, face, _, voxel, place = hit
    side, axis = int(materials[material, SIDE + face]), face // 2
    crowd, width = side / max(pixels, 1e-9), side
    while width > 1 and crowd >= math.sqrt(2.0):
        crowd, width = crowd / 2, width >> 1
    u = _in_block(voxel[0], place[0], scale) if axis != 0 else _in_block(voxel[1], place[1], scale)
    v = _in_block(voxel[2], place[2], scale) if axis != 2 else _in_block(voxel[1], place[1], scale)
    at = min(int(v * width), width - 1) * width + min(int(u * width), width - 1)
    return int(materials[material, FIRST + face]) + 4 * (side * side - width * width) // 3 + at


@scalar
def _in_block(cell, place, scale):
    begin = cell * scale
    begin -= math.floor(begin + 1e-6)
    return min(max(begin + min(max(place - cell, 0.0), 1.0) * scale, 0.0), 1.0)


@scalar
def turned(transform, face, flat, direction, row):
    """The normal of a face, turned by a texel, and never away from the ray."""
    x, y, axis = np.float64(row[TILT]), np.float64(row[TILT + 1]), face // 2
    u, v = transform[0 if axis != 0 else 1], transform[2 if axis != 2 else 1]
    u, v = scaled((u[0], u[1], u[2]), 1 / size(u)), scaled((v[0], v[1], v[2]), 1 / size(v))
    normal = combined(u, v, flat, x, y, math.sqrt(max(1 - x * x - y * y, 0.0)))
    least = min(GRAZING, -dot(flat, direction))
    normal = along(normal, direction, -max(least + dot(normal, direction), 0.0))
    return scaled(normal, 1 / math.sqrt(dot(normal, normal)))


@scalar
def variation(voxel, place, face, entry, pixels):
    """See `tracer.texture.variation`."""
    key = int(voxel[0]) * 73856093 + int(voxel[1]) * 19349663 + int(voxel[2]) * 83492791
    key += int(face + 6 * entry) * 2654435761
    key, axis = _mix(key), face // 2
    u = place[0] - voxel[0] if axis != 0 else place[1] - voxel[1]
    v = place[2] - voxel[2] if axis != 2 else place[1] - voxel[1]
    u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
    total = 0.0
    for side, amplitude in OCTAVES:
        onscreen = min(max((pixels / side - 0.75) / 1.25, 0.0), 1.0)
        cell = min(int(u * side), side - 1) * side + min(int(v * side), side - 1)
        number = _mix(key + (cell + 64 * side) * 668265263)
        total += amplitude * onscreen * (number * (2.0 / 0xFFFFFFFF) - 1.0)
    return total


@scalar
def _mix(value):
    value = value & 0xFFFFFFFF
    value = ((value ^ (value >> 16)) * 0x7FEB352D) & 0xFFFFFFFF
    value = ((value ^ (value >> 15)) * 0x846CA68B) & 0xFFFFFFFF
    return value ^ (value >> 16)
