"""The compiled form of GGX lobes: a reflecting pixel, and one reflected ray, as scalar bodies over triples.

Names and steps are those of `post.shading.lobes` and `gbufrt.specular`, which are the definition.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from gbufrt.compute.approximations import cos_sin
from gbufrt.compute.kernel import inlined, scalar

ZERO, HALF, ONE, TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
LEVEL, EDGE_ON = np.float32(1e-4), np.float32(1e-3)
TINY, SMALL, FLATTEST = np.float32(1e-30), np.float32(1e-20), np.float32(1e-7)
GRAZING = np.float32(1e-8)

Mirror = namedtuple("Mirror", "normal tangent bitangent eye cap alpha visible")
"""A pixel of `post.shading.lobes.Surface`, in view space; ``eye`` in the shading frame, ``cap`` the same for the
hemisphere that the microfacets are drawn from; ``visible``: 1 over the masking of the eye."""
Ray = namedtuple("Ray", "direction cosine weight")
"""A ray of `post.shading.lobes.Lobe`; its weight is 0 where it goes below the surface."""


@inlined
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def scaled(a, by):
    return a[0] * by, a[1] * by, a[2] * by


@inlined
def unit(a):
    """``a`` at length 1; zero stays zero."""
    return scaled(a, ONE / math.sqrt(max(dot(a, a), TINY)))


@inlined
def grazing(cosine):
    """Schlick's (1 - cosine)^5 for a cosine in [0, 1]."""
    left = ONE - cosine
    squared = left * left
    return squared * squared * left


@inlined
def _smith_lambda(cosine, alpha):
    square = min(max(cosine * cosine, GRAZING), ONE)
    return HALF * (math.sqrt(ONE + alpha * alpha * (ONE - square) / square) - ONE)


@scalar
def mirror(point, normal, orthographic, alpha):
    """The reflecting pixel at a view-space point, with view-space normals."""
    eye = (ZERO, ZERO, -ONE) if orthographic else scaled(unit(point), -ONE)
    lift = max(EDGE_ON - dot(normal, eye), ZERO)
    normal = unit((normal[0] + eye[0] * lift, normal[1] + eye[1] * lift, normal[2] + eye[2] * lift))
    x, y, z = normal
    sign = ONE if z >= ZERO else -ONE
    a = -ONE / (sign + z)
    b = x * y * a
    tangent, bitangent = (ONE + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)
    local = (dot(eye, tangent), dot(eye, bitangent), dot(eye, normal))
    cap = (alpha * local[0], alpha * local[1], local[2])
    cap = scaled(cap, ONE / math.sqrt(max(dot(cap, cap), SMALL)))
    visible = ONE + _smith_lambda(local[2], alpha)
    return Mirror(normal, tangent, bitangent, local, cap, alpha, visible)


@scalar
def reflected(at, above, u, v):
    """Reflect the eye at a visible microfacet drawn by two numbers in [0, 1): a `Ray`. See `lobes.ggx_ray`."""
    across, along = cos_sin(v)
    height = (ONE - u) * (ONE + at.cap[2]) - at.cap[2]
    radius = math.sqrt(max(ONE - height * height, TINY))
    x, y = at.alpha * (radius * across + at.cap[0]), at.alpha * (radius * along + at.cap[1])
    half = unit((x, y, max(height + at.cap[2], FLATTEST)))
    cosine = min(max(dot(at.eye, half), ZERO), ONE)
    x, y, z = TWO * cosine * half[0] - at.eye[0], TWO * cosine * half[1] - at.eye[1], TWO * cosine * half[2] - at.eye[2]
    direction = unit(
        (
            at.tangent[0] * x + at.bitangent[0] * y + at.normal[0] * z,
            at.tangent[1] * x + at.bitangent[1] * y + at.normal[1] * z,
            at.tangent[2] * x + at.bitangent[2] * y + at.normal[2] * z,
        )
    )
    if not (z > ZERO and dot(direction, above) > LEVEL):
        return Ray(direction, cosine, ZERO)
    return Ray(direction, cosine, at.visible / (at.visible + _smith_lambda(z, at.alpha)))
