"""How surfaces answer light: what they send toward the eye, and where paths go on from them."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt.specular import LAMP_ROUGHNESS
from tracer.lights.samples import LightSample
from tracer.paths.diffuse import even_response
from tracer.paths.surfaces.vertices import Vertices
from tracer.sampling.scatter import cosine_direction, dot, fresnel, sample_specular, specular_response
from tracer.scene.scene import Scene

RARELY = 0.1  # least probability of a specular, and of a diffuse, bounce on a surface that has both
LEAST_ALPHA = 1e-4  # GGX width below which shadow rays take the surface to be slightly rough


def response(at: Vertices, sharp_sun: Tensor, sharp_lamp: Tensor, sample: LightSample) -> Tensor:
    """Response of surfaces, without the specular share where it is sharp."""
    value = at.diffuse * at.enters * even_response(at, sample)
    rows = (~(sharp_sun if sample.facing is None else sharp_lamp)).nonzero()[:, 0]
    value[rows] += glossy(at[rows], sample.direction[rows])
    return value


def glossy(at: Vertices, directions: Tensor) -> Tensor:
    """Specular reflectance ``(N, 3)`` for light from ``directions``, times the cosine; 0 for light from below."""
    return specular_response(at.normals, at.toward, at.alpha.clamp_min(LEAST_ALPHA), at.f0, directions)


def sharp(scene: Scene, at: Vertices) -> tuple[Tensor, Tensor]:
    """``(N,)`` bool each: whether a surface reflects the sun, and lamps, too sharply for shadow rays to them."""
    disc = 0.0 if scene.sun is None else math.sin(math.radians(scene.sun.angular_radius))
    return at.alpha < disc, at.roughness < LAMP_ROUGHNESS


def specular_chance(at: Vertices) -> Tensor:
    """``(N,)`` probability that a bounce is specular rather than diffuse."""
    even = (at.diffuse * at.enters).mean(dim=1)
    bright = fresnel(at.f0, dot(at.normals, at.toward)).mean(dim=1)
    return torch.where(even > 0, (bright / (bright + even).clamp_min(1e-9)).clamp(RARELY, 1 - RARELY), 1.0)


def scattered(at: Vertices, u: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The next bounce, from numbers ``(3, N)``: directions ``(N, 3)``, factors ``(N, 3)`` on the light from there, and
    densities ``(N,)`` of diffuse bounces, 0 for specular ones."""
    chance = specular_chance(at)
    mirrors = u[0] < chance
    directions = cosine_direction(at.normals, u[1:])
    factors = at.diffuse * at.enters / (1 - chance).clamp_min(1e-9)[:, None]
    density = (1 - chance) * dot(at.normals, directions) / math.pi
    density = torch.where(mirrors, 0.0, density.clamp_min(1e-12))
    rows = mirrors.nonzero()[:, 0]
    some = at[rows]
    directions[rows], weight, cosine = sample_specular(some.normals, some.toward, some.alpha, u[1:, rows])
    factors[rows] = fresnel(some.f0, cosine) * (weight / chance[rows])[:, None]
    return directions, factors, density
