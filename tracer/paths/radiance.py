"""Radiance along paths with any number of bounces."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import torch
from torch import Tensor

from gbufrt.tree import map_tensors
from tracer.lights.samples import DIMS, Lights
from tracer.lights.sky import beyond, sky_along
from tracer.lights.sky_table import SkyTable
from tracer.paths.interaction import FINE, Interaction, direct, intersect
from tracer.paths.on_screen import Picture
from tracer.paths.surfaces.response import response, scattered, sharp, specular_chance
from tracer.paths.surfaces.vertices import Vertices
from tracer.sampling.scatter import dot
from tracer.scene.scene import MASK_PRIMARY, MASK_SECONDARY, Scene
from tracer.traversal.rays import transmission

MORE = DIMS + 7  # numbers that a bounce takes
SURVIVAL = 0.1  # least probability that a path continues


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
    picture: Picture | None = None,
    known: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """All light that arrives along rays from the eye.

    Each surface sends one shadow ray to the sun, one to a lamp and one to the sky, and the path continues with a
    diffuse or a specular bounce. Where a diffuse bounce hits the sky, the balance heuristic weights it and the shadow
    ray to the sky. Specular bounces find the sky themselves; and sun and lamps, where they are too sharp for shadow
    rays.

    The diffuse light of a dielectric is scaled by what it does not reflect toward the eye, and its transmission by what
    it would not reflect if it were smooth: in uniform light it shows no more than it receives.

    Args:
        scene: what is there.
        lights: of the scene.
        origins: ``(N, 3)`` of the rays, world space.
        directions: ``(N, 3)``, unit length.
        u: ``(1 + MORE * (bounces + 1), N)`` in [0, 1).
        bounces: most surfaces between the first one and a light.
        poses: ``(I, 4, 4)``.
        t_min: as for `tracer.paths.interaction`, for the rays from the eye; as are the next three.
        t_max: where they end.
        detail: of the colours of what they hit.
        spreads: whether that falls with the distance.
        next_event: False sends no shadow rays: the same mean, with more noise.
        picture: what a camera shows.
        known: ``(N,)`` bool, which rays first hit what is on screen; by default all.

    Returns:
        ``(N, 3)`` linear radiance; and ``(N, 3)``, the part of it from paths whose surfaces after the first are all
        on screen in the ``picture``; 0 without one, and where the first hit is not ``known``.

    Source: Kajiya 1986; Veach and Guibas 1995 for the balance heuristic; Arvo and Kirk 1990 for Russian roulette.
    """
    yes = torch.ones_like(directions[:, 0], dtype=torch.bool)
    first = {"t_min": t_min, "t_max": t_max, "detail": detail, "spreads": spreads}
    isect = intersect(scene, origins, directions, u[0], poses=poses, mask=MASK_PRIMARY, **first)
    given: dict[str, Any] = {"bounces": bounces, "poses": poses, "sees_sun": yes, "sees_lamps": yes}
    given |= {"next_event": next_event, "picture": picture, "known": known}
    return arriving(scene, lights, isect, directions, u[1:], **given)


def arriving(
    scene: Scene,
    lights: Lights,
    isect: Interaction,
    directions: Tensor,
    u: Tensor,
    *,
    bounces: int,
    poses: Tensor,
    sees_sun: Tensor,
    sees_lamps: Tensor,
    next_event: bool = True,
    picture: Picture | None = None,
    known: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """All light that arrives along rays from where they end.

    Args:
        scene: see `radiance`, as ``lights``.
        lights: see ``scene``.
        isect: where the N rays end.
        directions: ``(N, 3)`` of the rays, unit length.
        u: ``(MORE * (bounces + 1), N)`` in [0, 1).
        bounces: most surfaces between the one that they hit and a light.
        poses: ``(I, 4, 4)``.
        sees_sun: ``(N,)`` bool: no shadow ray has sampled the sun already.
        sees_lamps: ``(N,)`` bool, likewise.
        next_event: see `radiance`, as ``picture`` and ``known``.
        picture: see ``next_event``.
        known: see ``next_event``.

    Returns:
        See `radiance`.
    """
    rows = torch.arange(len(directions), device=directions.device)
    density, through = torch.zeros_like(directions[:, 0]), torch.ones_like(directions)
    known = torch.full_like(sees_sun, picture is not None) if known is None else known & (picture is not None)
    paths = _Paths(rows=rows, through=through, sees_sun=sees_sun, sees_lamps=sees_lamps, density=density, known=known)
    total, onscreen = torch.zeros_like(directions), torch.zeros_like(directions)

    def add(paths: _Paths, light: Tensor) -> None:
        total[paths.rows] += paths.through * light
        onscreen[paths.rows] += paths.through * light * paths.known[:, None]

    for bounce in range(bounces + 2):
        paths = replace(paths, through=paths.through * isect.weight)
        away = paths[~isect.hit]
        add(
            away, beyond(scene, directions[~isect.hit], away.sees_sun, _share(lights.sky, directions[~isect.hit], away))
        )
        at, paths, u = isect.surface, paths[isect.rows], u[:, isect.rows]
        if bounce and picture is not None:
            shows = picture.sees(*picture.back_project(at.points, at.normals, at.instances))
            paths = replace(paths, known=paths.known & shows)
        add(paths, at.emission * paths.sees_lamps[:, None])
        if bounce > bounces or not len(paths.rows):
            break
        numbers, u = u[:MORE], u[MORE:]
        sharp_sun, sharp_lamp = sharp(scene, at)
        if next_event:
            respond = partial(response, at, sharp_sun, sharp_lamp)
            for _, light in direct(scene, lights, at, numbers[:DIMS], respond, poses=poses):
                add(paths, light)
            if lights.sky is not None:
                add(paths, _from_sky(scene, lights.sky, at, numbers[DIMS + 5 :], poses))
        directions, factor, density = scattered(at, numbers[DIMS : DIMS + 3])
        through, mirrors = paths.through * factor, density == 0
        chance = through.amax(dim=1).clamp(SURVIVAL, 1.0) if bounce else torch.ones_like(through[:, 0])
        lives = ((through.amax(dim=1) > 0) & (numbers[DIMS + 3] < chance)).nonzero()[:, 0]
        paths = replace(
            paths,
            through=through / chance[:, None],
            sees_sun=(mirrors & sharp_sun) | (not next_event),
            sees_lamps=(mirrors & sharp_lamp) | (not next_event),
            density=density * next_event,
        )
        paths, directions, u, at = paths[lives], directions[lives], u[:, lives], at[lives]
        isect = intersect(scene, at.points, directions, numbers[DIMS + 4, lives], poses=poses, inside=at.inside)
    return total, onscreen


@dataclass(frozen=True, eq=False, kw_only=True)
class _Paths:
    """N paths under way.

    Args:
        rows: ``(N,)`` their numbers.
        through: ``(N, 3)`` throughput, the factor on the light that they find.
        sees_sun: ``(N,)`` bool: no shadow ray has sampled the sun already.
        sees_lamps: ``(N,)`` bool, likewise.
        density: ``(N,)`` of the current direction, where a shadow ray to the sky might have found the same; else 0.
        known: ``(N,)`` bool: the picture shows every surface so far.
    """

    rows: Tensor
    through: Tensor
    sees_sun: Tensor
    sees_lamps: Tensor
    density: Tensor
    known: Tensor

    def __getitem__(self, rows: Tensor) -> _Paths:
        return map_tensors(lambda x: x[rows], self)


def _share(table: SkyTable | None, directions: Tensor, paths: _Paths) -> Tensor:
    """``(N,)`` weight of the sky where paths hit it; shadow rays to the sky have the rest."""
    if table is None:
        return torch.ones_like(paths.density)
    return torch.where(paths.density > 0, paths.density / (paths.density + table.density_of(directions)), 1.0)


def _from_sky(scene: Scene, table: SkyTable, at: Vertices, u: Tensor, poses: Tensor) -> Tensor:
    """``(N, 3)`` diffuse reflection of the sky, by one shadow ray each; from numbers ``(2, N)``."""
    directions, density = table.sample(u)
    cosine = dot(at.normals, directions).clamp_min(0) / math.pi
    share = cosine / (density + (1 - specular_chance(at)) * cosine).clamp_min(1e-12)
    value = at.diffuse * at.enters * share[:, None]
    rows = (value.amax(dim=1) > 0).nonzero()[:, 0]
    way = directions[rows]
    passed = transmission(scene, at.points[rows], way, poses=poses, mask=MASK_SECONDARY)
    value[rows] *= passed * sky_along(scene, way)
    return value
