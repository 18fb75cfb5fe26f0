"""Light that comes along paths with any number of bounces."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.environment import lookup_environment
from tracer.light_samples import DIMS, Lights, LightSample
from tracer.paths import FINE, Vertices, direct, meet
from tracer.scatter import cosine_direction, dot, fresnel, mirrored, specular_response
from tracer.scene import MASK_PRIMARY, MASK_SECONDARY, Scene
from tracer.sky import sky_radiance, sun_radiance
from tracer.traversal import transmission

SHARP_LAMP = 0.3  # roughness below which lamps are found by mirrored rays, above it by rays to the lamps
EVEN = DIMS + 3  # numbers that a bounce takes where all is scattered evenly
MORE = DIMS + 5  # numbers that a bounce takes
RARELY = 0.1  # least share of rays that a surface mirrors, and that it scatters evenly, if it does both
LEAST_ALPHA = 1e-4  # GGX width below which rays to lights take the surface for slightly rough
SURVIVAL = 0.1  # least chance of a path to go on


def gathered(scene: Scene, lights: Lights, start: Vertices, u: Tensor, bounces: int, poses: Tensor) -> Tensor:
    """What surfaces send of the light of sun, lamps and sky, after at most ``bounces`` of even scattering.

    Args:
        scene: what is there.
        lights: of the scene.
        start: N surfaces.
        u: ``(EVEN * bounces, N)`` in [0, 1).
        bounces: 1 for what reaches the surfaces themselves.
        poses: ``(I, 4, 4)``.

    Returns:
        ``(N, 3)`` outgoing linear radiance.
    """
    total, rows, at = torch.zeros_like(start.points), torch.arange(len(start), device=u.device), start
    through = torch.ones_like(total)
    for bounce in range(bounces):
        numbers, u = u[:EVEN], u[EVEN:]
        through = through * at.diffuse

        for _, light in direct(scene, lights, at, numbers[:DIMS], partial(_even, at), poses=poses):
            total[rows] += through * light
        directions = cosine_direction(at.normals, numbers[DIMS : DIMS + 2])
        if bounce == bounces - 1:
            passed = transmission(scene, at.points, directions, poses=poses, mask=MASK_SECONDARY)
            total[rows] += through * passed * sky(scene, directions)
            break
        met = meet(scene, at.points, directions, numbers[DIMS + 2], poses=poses, inside=at.inside)
        through = through * met.weight
        away = ~met.hit
        total[rows[away]] += through[away] * sky(scene, directions[away])
        rows, through, u, at = rows[met.rows], through[met.rows], u[:, met.rows], met.surface
    return total


def radiance(
    scene: Scene,
    lights: Lights,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    bounces: int,
    poses: Tensor,
    t_min: Tensor | float = 0.0,
    t_max: Tensor | float = torch.inf,
    detail: Tensor | float = FINE,
    spreads: bool = False,
    next_event: bool = True,
) -> Tensor:
    """All light that comes along rays from the eye.

    At each surface one ray goes to the sun and one to a lamp, and the path goes on evenly or mirrored. Sky is found by
    the path itself, and so are sun and lamps where a surface mirrors too sharply for rays to them to count.

    Args:
        scene: what is there.
        lights: of the scene.
        origins: ``(N, 3)`` of the rays, world space.
        directions: ``(N, 3)``, unit length.
        u: ``(1 + MORE * (bounces + 1), N)`` in [0, 1).
        bounces: surfaces between the first one and a light at most.
        poses: ``(I, 4, 4)``.
        t_min: as for `tracer.paths.meet`, for the rays from the eye; and so are the next three.
        t_max: where they end.
        detail: of the colours of what they meet.
        spreads: whether that falls with the distance.
        next_event: False leaves all light to the path, which is the same in the mean and noisier.

    Returns:
        ``(N, 3)`` linear radiance.

    Source: Kajiya 1986; Arvo and Kirk 1990 for ending paths at random.
    """
    total, rows = torch.zeros_like(directions), torch.arange(len(directions), device=directions.device)
    through, sees_sun = torch.ones_like(directions), torch.ones_like(rows, dtype=torch.bool)
    sees_lamps = sees_sun
    first = {"t_min": t_min, "t_max": t_max, "detail": detail, "spreads": spreads}
    met, u = meet(scene, origins, directions, u[0], poses=poses, mask=MASK_PRIMARY, **first), u[1:]
    for bounce in range(bounces + 2):
        through = through * met.weight
        away = ~met.hit
        total[rows[away]] += through[away] * _beyond(scene, directions[away], sees_sun[away])
        at, rows, through, u = met.surface, rows[met.rows], through[met.rows], u[:, met.rows]
        total[rows] += through * at.emission * sees_lamps[met.rows, None]
        if bounce > bounces or not len(rows):
            break
        numbers, u = u[:MORE], u[MORE:]
        sharp_sun, sharp_lamp = _sharp(scene, at)
        if next_event:
            respond = partial(_response, at, sharp_sun, sharp_lamp)
            for _, light in direct(scene, lights, at, numbers[:DIMS], respond, poses=poses):
                total[rows] += through * light
        directions, factor, mirrors = _scattered(at, numbers[DIMS : DIMS + 3])
        sees_sun, sees_lamps = ((mirrors & sharp) | (not next_event) for sharp in (sharp_sun, sharp_lamp))
        through = through * factor
        chance = through.amax(dim=1).clamp(SURVIVAL, 1.0) if bounce else torch.ones_like(through[:, 0])
        lives = ((through.amax(dim=1) > 0) & (numbers[DIMS + 3] < chance)).nonzero()[:, 0]
        through = through[lives] / chance[lives, None]
        rows, directions, u, at = rows[lives], directions[lives], u[:, lives], at[lives]
        sees_sun, sees_lamps = sees_sun[lives], sees_lamps[lives]
        met = meet(scene, at.points, directions, numbers[DIMS + 4, lives], poses=poses, inside=at.inside)
    return total


def unblocked(
    scene: Scene, irradiance: Tensor, origins: Tensor, directions: Tensor, u: Tensor, *, poses: Tensor, **first: Any
) -> Tensor:
    """What rays from the eye show in light that nothing blocks: the sky, and surfaces with the light of the whole sky
    and the sun. All are matt, and lamps light nothing but themselves.

    Args:
        scene: what is there.
        irradiance: of the sky, see `tracer.sky.irradiance_table`.
        origins: ``(N, 3)`` of the rays, world space.
        directions: ``(N, 3)``, unit length.
        u: ``(N,)`` in [0, 1), whether to go through what transmits.
        poses: ``(I, 4, 4)``.
        first: ``t_min``, ``t_max``, ``detail`` and ``spreads`` as for `tracer.paths.meet`.

    Returns:
        ``(N, 3)`` linear radiance, which has no noise but that of ``u``.
    """
    met = meet(scene, origins, directions, u, poses=poses, mask=MASK_PRIMARY, **first)
    at, total = met.surface, _beyond(scene, directions, torch.ones_like(met.hit))
    arriving = lookup_environment(irradiance, at.normals.T[None, :, None])[0, :, 0].T
    if scene.sun is not None:
        toward = F.normalize(at.normals.new_tensor(scene.sun.direction), dim=0)
        arriving = arriving + (at.normals @ toward).clamp_min(0)[:, None] * toward.new_tensor(scene.sun.irradiance)
    total[met.rows] = at.emission + at.albedo * at.opacity[:, None] * arriving / math.pi
    return met.weight * total


def mirrored_lamps(
    scene: Scene, lights: Lights, at: Vertices, u: Tensor, poses: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Lamps mirrored by surfaces, by one ray to a lamp each.

    Args:
        scene: what is there.
        lights: of the scene, among them a lamp.
        at: N surfaces.
        u: ``(6, N)`` in [0, 1).
        poses: ``(I, 4, 4)``.

    Returns:
        ``(N, 3)`` each: radiance, the place on the lamp, and the lamp's normal.
    """
    lamps = replace(lights, sun=None)
    ((sample, light),) = direct(scene, lamps, at, u, lambda s: glossy(at, s.direction), poses=poses)
    facing = torch.zeros_like(at.points) if sample.facing is None else sample.facing
    return light, at.points + sample.direction * sample.distance[:, None], facing


def sky(scene: Scene, directions: Tensor) -> Tensor:
    """``(N, 3)`` radiance of the sky, without the sun's disc, in ``directions`` ``(N, 3)``."""
    return sky_radiance(scene, directions.T[None])[0].T


def _beyond(scene: Scene, directions: Tensor, sees_sun: Tensor) -> Tensor:
    light = sky(scene, directions)
    if scene.sun is not None:
        light = light + sun_radiance(scene.sun, directions.T[None])[0].T * sees_sun[:, None]
    return light


def _even(at: Vertices, sample: LightSample) -> Tensor:
    """Response of a surface that scatters evenly and all."""
    return (dot(at.normals, sample.direction).clamp_min(0) / math.pi)[:, None].expand(-1, 3)


def _response(at: Vertices, sharp_sun: Tensor, sharp_lamp: Tensor, sample: LightSample) -> Tensor:
    """Response of surfaces, without the mirrored share where it is sharp."""
    value = at.diffuse * _even(at, sample)
    rows = (~(sharp_sun if sample.facing is None else sharp_lamp)).nonzero()[:, 0]
    value[rows] += glossy(at[rows], sample.direction[rows])
    return value


def glossy(at: Vertices, directions: Tensor) -> Tensor:
    """Mirrored share ``(N, 3)`` of light from ``directions``, times the cosine; 0 for light from below."""
    return specular_response(at.normals, at.toward, at.alpha.clamp_min(LEAST_ALPHA), at.f0, directions)


def _sharp(scene: Scene, at: Vertices) -> tuple[Tensor, Tensor]:
    """``(N,)`` bool each: whether a surface mirrors the sun, and lamps, too sharply to be lit by rays to them."""
    disc = 0.0 if scene.sun is None else math.sin(math.radians(scene.sun.angular_radius))
    return at.alpha < disc, at.roughness < SHARP_LAMP


def _scattered(at: Vertices, u: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Where paths go on: directions ``(N, 3)``, factors ``(N, 3)`` on the light from there, and ``(N,)`` bool whether
    they were mirrored rather than scattered evenly; from numbers ``(3, N)``."""
    even = at.diffuse.mean(dim=1)
    bright = fresnel(at.f0, dot(at.normals, at.toward)).mean(dim=1)
    chance = torch.where(even > 0, (bright / (bright + even).clamp_min(1e-9)).clamp(RARELY, 1 - RARELY), 1.0)
    mirrors = u[0] < chance
    directions = cosine_direction(at.normals, u[1:])
    factors = at.diffuse / (1 - chance).clamp_min(1e-9)[:, None]
    rows = mirrors.nonzero()[:, 0]
    some = at[rows]
    directions[rows], weight, cosine = mirrored(some.normals, some.toward, some.alpha, u[1:, rows])
    factors[rows] = fresnel(some.f0, cosine) * (weight / chance[rows])[:, None]
    return directions, factors, mirrors
