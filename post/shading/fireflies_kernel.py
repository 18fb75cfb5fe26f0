"""The compiled form of `post.shading.fireflies.without_lone_fireflies`, which is the definition: a pixel at a time."""

from __future__ import annotations

import numpy as np

from gbufrt.compute.each import pixel_of
from gbufrt.compute.kernel import inlined, scalar
from gbufrt.luminance import REC709
from gbufrt.specular import MIRROR_ROUGHNESS
from post.shading import constants

ONE, TINY = np.float32(1), np.float32(1e-12)
RED, GREEN, BLUE = (np.float32(share) for share in REC709)
SMOOTH, BROAD = np.float32(MIRROR_ROUGHNESS), np.float32(constants.BROAD)
LIMIT, UNKNOWN = np.float32(constants.LIMIT), np.float32(constants.UNKNOWN)


@inlined
def _luminance(light, b, y, x):
    return light[b, 0, y, x] * RED + light[b, 1, y, x] * GREEN + light[b, 2, y, x] * BLUE


@inlined
def _glossy(rough):
    return rough >= SMOOTH and rough < BROAD


@scalar
def calmed(i, out, light, roughness):
    """One pixel, written to its place in ``out``."""
    height, width = roughness.shape[2:]
    b, y, x = pixel_of(i, height, width)
    scale = ONE
    if _glossy(roughness[b, 0, y, x]):
        around = UNKNOWN
        for row in range(max(y - 1, 0), min(y + 2, height)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                if (row != y or column != x) and _glossy(roughness[b, 0, row, column]):
                    around = max(around, _luminance(light, b, row, column))
        here = _luminance(light, b, y, x)
        if around != UNKNOWN and here > LIMIT * around:
            scale = LIMIT * around / max(here, TINY)
    for c in range(3):
        out[b, c, y, x] = light[b, c, y, x] * scale
