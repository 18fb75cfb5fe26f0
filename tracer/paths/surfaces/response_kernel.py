"""The compiled form of `tracer.paths.surfaces.response`: one surface at a time."""

from __future__ import annotations

import math

from gbufrt.compute.kernel import scalar
from gbufrt.specular import DIELECTRIC_F0
from tracer.paths.surfaces.response import LEAST_ALPHA, RARELY
from tracer.sampling.scatter_kernel import (
    added,
    cosine_direction,
    directional_albedo,
    dot,
    fresnel,
    sample_specular,
    scaled,
    specular_response,
)


@scalar
def diffuse_of(at):
    return scaled(at.albedo, (1 - at.metallic) * at.opacity)


@scalar
def f0_of(at):
    some = at.metallic
    return (
        DIELECTRIC_F0 + (at.albedo[0] - DIELECTRIC_F0) * some,
        DIELECTRIC_F0 + (at.albedo[1] - DIELECTRIC_F0) * some,
        DIELECTRIC_F0 + (at.albedo[2] - DIELECTRIC_F0) * some,
    )


@scalar
def response(at, direction, even, mirrors):
    """Reflectance x cosine: diffuse with albedo ``even``, and specular if it ``mirrors``."""
    value = scaled(even, max(dot(at.normal, direction), 0.0) / math.pi)
    if not mirrors:
        return value
    alpha = max(at.roughness * at.roughness, LEAST_ALPHA)
    return added(value, specular_response(at.normal, at.toward, alpha, f0_of(at), direction))


@scalar
def diffuse_share(at):
    """Diffuse reflectance toward the eye."""
    return scaled(diffuse_of(at), 1 - directional_albedo(dot(at.normal, at.toward), at.roughness))


@scalar
def specular_chance(at):
    """Probability that a bounce is specular rather than diffuse."""
    diffuse = diffuse_share(at)
    even = (diffuse[0] + diffuse[1] + diffuse[2]) / 3
    bright = fresnel(f0_of(at), dot(at.normal, at.toward))
    some = (bright[0] + bright[1] + bright[2]) / 3
    return min(max(some / max(some + even, 1e-9), RARELY), 1 - RARELY) if even > 0 else 1.0


@scalar
def scattered(at, a, b, c):
    """A path's next direction, the factor on the light from there, and its density, 0 if the bounce is specular."""
    chance = specular_chance(at)
    if a >= chance:
        direction = cosine_direction(at.normal, b, c)
        density = (1 - chance) * max(dot(at.normal, direction), 0.0) / math.pi
        return direction, scaled(diffuse_share(at), 1 / max(1 - chance, 1e-9)), max(density, 1e-12)
    direction, weight, cosine = sample_specular(at.normal, at.toward, at.roughness * at.roughness, b, c)
    return direction, scaled(fresnel(f0_of(at), cosine), weight / chance), 0.0
