"""Paths that read a cache of irradiance where it knows a surface, and bring samples for it where they go on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import torch
from torch import Tensor

from tracer.cache.irradiance import IrradianceCache
from tracer.lights.samples import DIMS, Lights
from tracer.lights.sky import beyond
from tracer.paths.interaction import Interaction, direct, intersect
from tracer.paths.radiance import MORE, arriving
from tracer.paths.surfaces.response import response, scattered, sharp
from tracer.scene.scene import Scene

SAMPLE = 10
"""Numbers of a sample: a point, the normal there, radiance that arrives there, and 1 if there is one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Memory:
    """What the paths from M surfaces of a picture know.

    Args:
        cache: of the frames before.
        follows: ``(M,)`` bool: paths that do not read it, so that they can be repeated, and that it stays fresh.
    """

    cache: IrradianceCache
    follows: Tensor


def brought(
    scene: Scene, lights: Lights, memory: Memory | None, isect: Interaction, directions: Tensor, u: Tensor, **given: Any
) -> tuple[Tensor, Tensor]:
    """`remembered`, or without a memory `arriving` and no samples."""
    if memory is not None:
        return remembered(scene, lights, memory, isect, directions, u, **given)
    return arriving(scene, lights, isect, directions, u, **given)[0], directions.new_zeros(0, SAMPLE)


def remembered(
    scene: Scene,
    lights: Lights,
    memory: Memory,
    isect: Interaction,
    directions: Tensor,
    u: Tensor,
    *,
    bounces: int,
    poses: Tensor,
    sees_sun: Tensor,
    sees_lamps: Tensor,
) -> tuple[Tensor, Tensor]:
    """All light that arrives along rays from where they end, if the cache is asked what arrives there in turn.

    In place of the shadow ray to the sky and of a diffuse bounce stands what the cache holds. Sun, lamps and specular
    bounces are sampled as ever. Where the cache knows nothing, a diffuse bounce is followed, and brings a sample.

    Args:
        scene: as for `arriving`, as are all but ``memory``.
        lights: see ``scene``.
        memory: of the N rays' paths.
        isect: see ``scene``, as the rest.
        directions: see ``isect``.
        u: see ``isect``.
        bounces: see ``isect``; at least 0.
        poses: see ``isect``.
        sees_sun: see ``isect``.
        sees_lamps: see ``isect``.

    Returns:
        ``(N, 3)`` linear radiance, and samples for the cache, ``(N, SAMPLE)``.
    """
    light, samples = torch.zeros_like(directions), directions.new_zeros(len(directions), SAMPLE)
    away, rows, at = ~isect.hit, isect.rows, isect.surface
    light[away] = isect.weight[away] * beyond(scene, directions[away], sees_sun[away], torch.ones_like(u[0, away]))
    sharp_sun, sharp_lamp = sharp(scene, at)
    value, numbers = at.emission * sees_lamps[rows, None], u[:, rows]
    for _, sent in direct(scene, lights, at, numbers[:DIMS], partial(response, at, sharp_sun, sharp_lamp), poses=poses):
        value = value + sent
    cached, known = memory.cache.look_up(at.points, at.normals)
    known = known & ~memory.follows[rows]
    value = value + at.diffuse * at.enters * cached * known[:, None]
    onward, factor, density = scattered(at, numbers[DIMS : DIMS + 3])
    diffuse = density > 0
    lives = ((factor.amax(dim=1) > 0) & ~(known & diffuse)).nonzero()[:, 0]
    some, ways = at[lives], onward[lives]
    further = intersect(scene, some.points, ways, numbers[DIMS + 4, lives], poses=poses, inside=some.inside)
    sent, _ = arriving(
        scene, lights, further, ways, numbers[MORE:, lives], bounces=bounces - 1, poses=poses,
        sees_sun=(sharp_sun & ~diffuse)[lives], sees_lamps=(sharp_lamp & ~diffuse)[lives],
    )  # fmt: skip
    value[lives] += factor[lives] * sent
    light[rows] = isect.weight[rows] * value
    brings = diffuse[lives, None].to(sent)
    samples[rows[lives]] = torch.cat([some.points, some.normals, sent, torch.ones_like(brings)], dim=1) * brings
    return light, samples
