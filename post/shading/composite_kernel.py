"""The compiled forms of the sum of all light and of what surfaces reflect as dielectrics: a part of a row as a body.

Names and steps are those of `post.shading.composite_reference`, the definition. An absent channel has no planes.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.each import pixels
from gbufrt.compute.kernel import scalar
from gbufrt.specular import CELLS

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
ROUGH, COSINES = np.float32(CELLS[0]), np.float32(CELLS[1])
LAST_ROUGH, LAST_COSINE = np.int32(CELLS[0] - 1), np.int32(CELLS[1] - 1)

Light = namedtuple("Light", "radiance ambient emission visibility gi reflection behind specular")
"""``(3, H, W)`` each, visibility and specular ``(1, H, W)``, or without planes."""


@scalar
def _add(lit, given, factor):
    for x in range(pixels(lit.shape[0])):
        lit[x] += factor * given[x]


@scalar
def _add_direct(lit, radiance, emission, emits):
    if emits:
        for x in range(pixels(lit.shape[0])):
            lit[x] = (lit[x] + radiance[x]) - emission[x]
    else:
        for x in range(pixels(lit.shape[0])):
            lit[x] += radiance[x]


@scalar
def _darken(lit, share):
    for x in range(pixels(lit.shape[0])):
        lit[x] *= min(max(share[x], ZERO), ONE)


@scalar
def _take(lit, share, factor):
    for x in range(pixels(lit.shape[0])):
        lit[x] *= ONE - factor * share[x]


@scalar
def sum_row(out, light, y, first, end, physical, of_gi, of_reflection):
    """Pixels ``first`` to ``end`` of a row of all three colours; ``out`` ``(3, H, W)``."""
    for c in range(out.shape[0]):
        lit, radiance, emits = out[c, y, first:end], light.radiance[c, y, first:end], light.emission.shape[0] > 0
        emission = light.emission[c, y, first:end] if emits else radiance
        for x in range(pixels(lit.shape[0])):
            lit[x] = ZERO
        if light.ambient.shape[0] > 0:
            _add(lit, light.ambient[c, y, first:end], ONE)
        if not physical:
            _add_direct(lit, radiance, emission, emits)
        if light.visibility.shape[0] > 0:
            _darken(lit, light.visibility[0, y, first:end])
        if physical:
            _add_direct(lit, radiance, emission, emits)
        if light.gi.shape[0] > 0:
            _add(lit, light.gi[c, y, first:end], of_gi)
        if light.behind.shape[0] > 0:
            _add(lit, light.behind[c, y, first:end], ONE)
        reflects = light.reflection.shape[0] > 0
        if reflects and physical and light.specular.shape[0] > 0:
            _take(lit, light.specular[0, y, first:end], min(of_reflection, ONE))
        if emits:
            _add(lit, emission, ONE)
        if reflects:
            _add(lit, light.reflection[c, y, first:end], of_reflection)


@scalar
def specular_row(out, cosines, normal, hit, roughness, lens, pose, table, parallel, y, first, end):
    """Pixels ``first`` to ``end`` of a row of `composite_reference.specular_reference`.

    Args:
        out: ``(H, W)``.
        cosines: room for them.
        normal: ``(3, H, W)`` world space.
        hit: ``(H, W)`` bool.
        roughness: ``(1, H, W)`` or without planes.
        lens: `Camera.lens`.
        pose: ``(3, 3)``, rotation to world space.
        table: of `gbufrt.specular.directional_albedo_table`.
        parallel: whether the camera is orthographic.
        y: the row.
        first: see above.
        end: see above.
    """
    nx, ny, nz, row = normal[0, y, first:end], normal[1, y, first:end], normal[2, y, first:end], out[y, first:end]
    seen, matt = hit[y, first:end], roughness.shape[0] > 0
    rough_row = roughness[0, y, first:end] if matt else row
    xx, xy, xz = pose[0, 0], pose[0, 1], pose[0, 2]
    yx, yy, yz = pose[1, 0], pose[1, 1], pose[1, 2]
    zx, zy, zz = pose[2, 0], pose[2, 1], pose[2, 2]
    focal_x, center_x, jitter_x, begin = lens[0], lens[2], lens[4], np.float32(first) + HALF
    ray_y = ZERO if parallel else (np.float32(y) + HALF + lens[5] - lens[3]) / lens[1]
    for x in range(pixels(row.shape[0])):
        ray_x = ZERO if parallel else (np.float32(x) + begin + jitter_x - center_x) / focal_x
        a, b, c = xx * ray_x + xy * ray_y + xz, yx * ray_x + yy * ray_y + yz, zx * ray_x + zy * ray_y + zz
        along = -(a * nx[x] + b * ny[x] + c * nz[x]) / math.sqrt(ray_x * ray_x + ray_y * ray_y + ONE)
        cosines[x] = min(max(along, ZERO), ONE) * COSINES
    for x in range(pixels(row.shape[0])):
        if not seen[x]:
            row[x] = ZERO
            continue
        rough = min(max(rough_row[x], ZERO), ONE) * ROUGH if matt else ZERO
        i, j = min(np.int32(rough), LAST_ROUGH), min(np.int32(cosines[x]), LAST_COSINE)
        s, t = rough - np.float32(i), cosines[x] - np.float32(j)
        upper = table[i, j] + t * (table[i, j + 1] - table[i, j])
        lower = table[i + 1, j] + t * (table[i + 1, j + 1] - table[i + 1, j])
        row[x] = upper + s * (lower - upper)
