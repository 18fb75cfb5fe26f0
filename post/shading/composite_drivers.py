"""Run the row bodies of `post.shading.composite_kernel` over pictures on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver
from post.shading.composite_kernel import Light, specular_row, sum_row


@driver
def sum_rows(out, light, physical, of_gi, of_reflection, threads):
    batch, _, height, _ = out.shape
    radiance, ambient, emission, visibility, gi, reflection, behind, specular = light
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            given = radiance[b], ambient[b], emission[b], visibility[b], gi[b], reflection[b], behind[b], specular[b]
            sum_row(out[b], Light(*given), y, physical, np.float32(of_gi), np.float32(of_reflection))


@driver
def specular_rows(out, normal, hit, roughness, lens, pose, table, parallel, threads):
    batch, height, width = out.shape
    for thread in prange(threads):
        cosines = np.empty(width, np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            given = normal[b], hit[b], roughness[b], lens[b], pose[b]
            specular_row(out[b], cosines, *given, table, parallel, y)
