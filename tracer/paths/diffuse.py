"""Diffuse light transport: light that surfaces reflect diffusely, and the picture in unoccluded light."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.environment import lookup_environment
from tracer.lights.samples import DIMS, Lights, LightSample
from tracer.lights.sky import beyond, sky_along
from tracer.paths.interaction import direct, intersect
from tracer.paths.surfaces.vertices import Vertices
from tracer.sampling.scatter import cosine_direction, dot
from tracer.scene.scene import MASK_PRIMARY, MASK_SECONDARY, Scene
from tracer.traversal.rays import transmission

EVEN = DIMS + 3  # numbers that a bounce of a diffuse path takes


def gathered(scene: Scene, lights: Lights, start: Vertices, u: Tensor, bounces: int, poses: Tensor) -> Tensor:
    """Light of sun, lamps and sky that surfaces reflect, after at most ``bounces`` diffuse bounces.

    Args:
        scene: what is there.
        lights: of the scene.
        start: N surfaces.
        u: ``(EVEN * bounces, N)`` in [0, 1).
        bounces: 1 for light that reaches the surfaces directly.
        poses: ``(I, 4, 4)``.

    Returns:
        ``(N, 3)`` outgoing linear radiance.
    """
    total, rows, at = torch.zeros_like(start.points), torch.arange(len(start), device=u.device), start
    through = torch.ones_like(total)
    for bounce in range(bounces):
        numbers, u = u[:EVEN], u[EVEN:]
        through = through * at.diffuse
        for _, light in direct(scene, lights, at, numbers[:DIMS], partial(even_response, at), poses=poses):
            total[rows] += through * light
        directions = cosine_direction(at.normals, numbers[DIMS : DIMS + 2])
        if bounce == bounces - 1:
            passed = transmission(scene, at.points, directions, poses=poses, mask=MASK_SECONDARY)
            total[rows] += through * passed * sky_along(scene, directions)
            break
        isect = intersect(scene, at.points, directions, numbers[DIMS + 2], poses=poses, inside=at.inside)
        through = through * isect.weight
        away = ~isect.hit
        total[rows[away]] += through[away] * sky_along(scene, directions[away])
        rows, through, u, at = rows[isect.rows], through[isect.rows], u[:, isect.rows], isect.surface
    return total


def unblocked(
    scene: Scene, irradiance: Tensor, origins: Tensor, directions: Tensor, u: Tensor, *, poses: Tensor, **first: Any
) -> Tensor:
    """Radiance along rays from the eye in unoccluded light: the sky, and surfaces lit by the whole sky and the sun.

    All surfaces are diffuse, and lamps light nothing but themselves.

    Args:
        scene: what is there.
        irradiance: of the sky, see `tracer.lights.sky.irradiance_table`.
        origins: ``(N, 3)`` of the rays, world space.
        directions: ``(N, 3)``, unit length.
        u: ``(N,)`` in [0, 1), whether to pass through transmissive surfaces.
        poses: ``(I, 4, 4)``.
        first: ``t_min``, ``t_max``, ``detail`` and ``spreads`` as for `tracer.paths.interaction`.

    Returns:
        ``(N, 3)`` linear radiance; its only noise is that of ``u``.
    """
    isect = intersect(scene, origins, directions, u, poses=poses, mask=MASK_PRIMARY, **first)
    at, total = isect.surface, beyond(scene, directions, torch.ones_like(isect.hit), torch.ones_like(isect.distance))
    arriving = lookup_environment(irradiance, at.normals.T[None, :, None])[0, :, 0].T
    if scene.sun is not None:
        toward = F.normalize(at.normals.new_tensor(scene.sun.direction), dim=0)
        arriving = arriving + (at.normals @ toward).clamp_min(0)[:, None] * toward.new_tensor(scene.sun.irradiance)
    total[isect.rows] = at.emission + at.albedo * at.opacity[:, None] * arriving / math.pi
    return isect.weight * total


def even_response(at: Vertices, sample: LightSample) -> Tensor:
    """Response of a diffuse surface of albedo 1."""
    return (dot(at.normals, sample.direction).clamp_min(0) / math.pi)[:, None].expand(-1, 3)
