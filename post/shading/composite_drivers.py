"""Run the row bodies of `post.shading.composite_kernel` over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import driver, scalar
from post.shading.composite_kernel import Light, specular_row, sum_row

cuda: Any = numba.cuda


@scalar
def _sum(b, y, first, end, out, light, physical, of_gi, of_reflection):
    radiance, ambient, emission, visibility, gi, reflection, behind, specular = light
    given = radiance[b], ambient[b], emission[b], visibility[b], gi[b], reflection[b], behind[b], specular[b]
    sum_row(out[b], Light(*given), y, first, end, physical, np.float32(of_gi), np.float32(of_reflection))


@driver
def sum_rows(out, light, physical, of_gi, of_reflection, threads):
    batch, _, height, width = out.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            _sum(row // height, row % height, 0, width, out, light, physical, of_gi, of_reflection)


@scalar
def sum_pixel(i, out, light, physical, of_gi, of_reflection):
    b, y, x = pixel_of(i, out.shape[2], out.shape[3])
    _sum(b, y, x, x + 1, out, light, physical, of_gi, of_reflection)


@scalar
def _specular(b, y, first, end, out, cosines, normal, hit, roughness, lens, pose, table, parallel):
    given = normal[b], hit[b], roughness[b], lens[b], pose[b]
    specular_row(out[b], cosines, *given, table, parallel, y, first, end)


@driver
def specular_rows(out, normal, hit, roughness, lens, pose, table, parallel, threads):
    batch, height, width = out.shape
    for thread in prange(threads):
        cosines = np.empty(width, np.float32)
        for row in range(thread, batch * height, threads):
            place = row // height, row % height, 0, width
            _specular(*place, out, cosines, normal, hit, roughness, lens, pose, table, parallel)


@scalar
def specular_pixel(i, out, normal, hit, roughness, lens, pose, table, parallel):
    b, y, x = pixel_of(i, out.shape[1], out.shape[2])
    cosines = cuda.local.array(1, np.float32)
    _specular(b, y, x, x + 1, out, cosines, normal, hit, roughness, lens, pose, table, parallel)


sum_each, specular_each = Each(sum_pixel), Each(specular_pixel)
