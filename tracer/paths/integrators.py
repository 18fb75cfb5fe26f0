"""Estimates by one path from each surface of a picture; `tracer.truth.truth` takes the mean over many.

`tracer.paths.op` chooses between these and their compiled form.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from tracer.lights.samples import DIMS, Lights
from tracer.lights.sky import sky_along
from tracer.paths.diffuse import EVEN, even_response, gathered
from tracer.paths.interaction import direct, intersect
from tracer.paths.memory import Memory, brought
from tracer.paths.radiance import MORE
from tracer.paths.receivers import Receivers
from tracer.paths.surfaces.response import glossy, sharp
from tracer.paths.surfaces.vertices import Vertices
from tracer.sampling.progressive import Values
from tracer.sampling.scatter import cosine_direction, fresnel, sample_specular
from tracer.scene.scene import Scene

OCCLUSION_DIMS = 3
DIRECT_DIMS = DIMS
REFLECTION_DIMS = 3 + DIMS + EVEN
MOST_DIMS = 256  # numbers of a path for which a thread of a GPU has room


def occlusion(scene: Scene, at: Receivers, start: Vertices, u: Tensor, radius: float) -> Values:
    """``ao``, ``bent_normal`` and ``ao_onscreen`` of `tracer.truth.truth.ambient_occlusion`, by one ray each.

    Args:
        scene: what is there.
        at: the picture.
        start: N of its surfaces.
        u: ``(OCCLUSION_DIMS, K * N)`` in [0, 1): K rays from each.
        radius: world units.

    Returns:
        ``(K * N, C)`` each.
    """
    start = start.repeat(u.shape[1] // max(len(start), 1))
    directions = cosine_direction(start.normals, u[:2])
    given = {"poses": at.poses, "t_max": radius, "inside": start.inside, "most": 1.0}
    isect = intersect(scene, start.points, directions, u[2], **given)
    open_ = (~isect.hit).to(directions)[:, None]
    known = torch.ones_like(open_)
    known[isect.rows, 0] = 1 - at.picture.sees(isect.surface.points, isect.surface.normals).to(known)
    return {"ao": open_, "bent_normal": directions * open_, "ao_onscreen": known}


def indirect_dims(bounces: int) -> int:
    """How many numbers a path of `indirect` takes."""
    return 3 + EVEN * bounces


def indirect(scene: Scene, at: Receivers, start: Vertices, u: Tensor, bounces: int) -> Values:
    """``gi``, ``gi_onscreen``, ``sky`` and ``sky_visibility`` of `tracer.indirect_diffuse`; see `occlusion`."""
    start = start.repeat(u.shape[1] // max(len(start), 1))
    directions = cosine_direction(start.normals, u[:2])
    isect = intersect(scene, start.points, directions, u[2], poses=at.poses, inside=start.inside)
    weight = start.diffuse * isect.weight
    sent = gathered(scene, at.lights, isect.surface, u[3:, isect.rows], bounces, at.poses)
    gi, onscreen, above = (torch.zeros_like(weight) for _ in range(3))
    gi[isect.rows] = weight[isect.rows] * sent
    onscreen[isect.rows] = gi[isect.rows] * at.picture.sees(isect.surface.points, isect.surface.normals)[:, None]
    above[~isect.hit] = weight[~isect.hit] * sky_along(scene, directions[~isect.hit])
    open_ = isect.weight.mean(dim=1, keepdim=True) * ~isect.hit[:, None]
    return {"gi": gi, "gi_onscreen": onscreen, "sky": above, "sky_visibility": open_}


def lit(scene: Scene, at: Receivers, start: Vertices, u: Tensor) -> Values:
    """``direct``, the diffuse light of sun and lamps by a shadow ray to each kind; see `occlusion`.

    Also found: the shares of light that come along these two rays (``shadow``), 0 where there is none to come.
    """
    start = start.repeat(u.shape[1] // max(len(start), 1))
    light, shares = torch.zeros_like(start.points), torch.zeros_like(start.points[:, :2])
    for sample, value in direct(scene, at.lights, start, u, lambda s: even_response(start, s), poses=at.poses):
        open_ = even_response(start, sample) * sample.energy
        light = light + start.diffuse * value
        share = value.sum(dim=1) / open_.sum(dim=1).clamp_min(1e-12)
        shares[:, 0 if sample.facing is None else 1] = share
    return {"direct": light, "shadow": shares}


def reflected(scene: Scene, at: Receivers, start: Vertices, u: Tensor, sharp: float) -> Values:
    """``reflection`` and ``reflection_onscreen`` of `tracer.truth.truth.reflection`; see `occlusion`.

    Where the roughness is below ``sharp``, the reflected ray itself finds lamps; elsewhere a shadow ray samples one.
    Also found: 1 where the ray ends on screen (``onscreen``), where there is a ray (``flies``) and where it hits
    anything (``ends``); and its length (``distance``).
    """
    start = start.repeat(u.shape[1] // max(len(start), 1))
    directions, weight, cosine = sample_specular(start.normals, start.toward, start.alpha, u[:2])
    flies = weight > 0
    ends = torch.where(flies, torch.inf, 0.0)  # a ray into the surface itself hits nothing
    isect = intersect(scene, start.points, directions, u[2], poses=at.poses, inside=start.inside, t_max=ends)
    rows, surface, rough = isect.rows, isect.surface, start.roughness >= sharp
    factor = fresnel(start.f0, cosine) * weight[:, None] * isect.weight
    light, onscreen = torch.zeros_like(start.points), torch.zeros_like(start.points)
    if at.lights.lamps is not None:
        numbers = u[3 : 3 + DIMS, rough]
        light[rough], places, facing = _specular_lamps(scene, at.lights, start[rough], numbers, at.poses)
        onscreen[rough] = light[rough] * at.picture.sees(places, facing)[:, None]
    sent = gathered(scene, at.lights, surface, u[3 + DIMS :, rows], 1, at.poses)
    sent = factor[rows] * (sent + surface.emission * ~rough[rows, None])
    shows = at.picture.sees(surface.points, surface.normals)
    light[rows] += sent
    onscreen[rows] += sent * shows[:, None]
    away = flies & ~isect.hit
    light[away] += factor[away] * sky_along(scene, directions[away])
    ways, known = torch.zeros_like(weight), torch.zeros_like(weight)
    ways[rows], known[rows] = isect.distance[rows], shows.to(known)
    counts = {"onscreen": known, "distance": ways, "flies": flies.to(ways), "ends": isect.hit.to(ways)}
    return {"reflection": light, "reflection_onscreen": onscreen} | {k: v[:, None] for k, v in counts.items()}


def lobe_dims(bounces: int) -> int:
    """How many numbers the paths of `lobes` take."""
    return 6 + DIMS + 2 * MORE * bounces


def specular_dims(bounces: int) -> tuple[int, int]:
    """Which of the numbers of `lobes` give the direction of the specular ray: from the first to before the second."""
    first = 3 + MORE * bounces
    return first, first + 2


def lobes(
    scene: Scene, at: Receivers, start: Vertices, u: Tensor, bounces: int, memory: Memory | None = None
) -> Values:
    """``indirect`` and ``specular`` of `tracer.SampledLight`, by one path from each lobe; see `occlusion`.

    Of sun and lamps, rough surfaces reflect what a shadow ray brings, and smooth ones what the path itself finds. Also
    found: where there is a specular ray (``flies``), where it hits anything (``ends``), and its length (``distance``).
    With a ``memory`` of the N surfaces, paths read its cache, and find samples for it (``met``), see `remembered`.
    """
    start = start.repeat(u.shape[1] // max(len(start), 1))
    sharp_sun, sharp_lamp = sharp(scene, start)
    given: dict[str, Any] = {"bounces": bounces - 1, "poses": at.poses}
    begun: dict[str, Any] = {"poses": at.poses, "inside": start.inside}
    first, _ = specular_dims(bounces)
    directions, none = cosine_direction(start.normals, u[:2]), torch.zeros_like(sharp_sun)
    isect = intersect(scene, start.points, directions, u[2], **begun)
    even = ((1 - start.metallic) * start.opacity)[:, None]
    given |= {"sees_sun": none, "sees_lamps": none}
    found, met = brought(scene, at.lights, memory, isect, directions, u[3:first], **given)
    even = even * found

    u = u[first:]
    directions, weight, cosine = sample_specular(start.normals, start.toward, start.alpha, u[:2])
    flies = weight > 0
    ends = torch.where(flies, torch.inf, 0.0)  # a ray into the surface itself hits nothing
    isect = intersect(scene, start.points, directions, u[2], t_max=ends, **begun)
    given |= {"sees_sun": sharp_sun, "sees_lamps": sharp_lamp}
    found, _ = brought(scene, at.lights, memory, isect, directions, u[3 + DIMS :], **given)
    light = fresnel(start.f0, cosine) * weight[:, None] * found
    light = light + _specular_sun(scene, at.lights, start, u[3 : 3 + DIMS], at.poses)
    rough = ~sharp_lamp
    if at.lights.lamps is not None:
        light[rough] += _specular_lamps(scene, at.lights, start[rough], u[3 : 3 + DIMS, rough], at.poses)[0]
    distance = torch.where(isect.hit, isect.distance, 0.0)
    counts = {"distance": distance, "flies": flies.to(weight), "ends": isect.hit.to(weight)}
    values = {"indirect": even, "specular": light} | {k: v[:, None] for k, v in counts.items()}
    return values if memory is None else values | {"met": met}


def _specular_lamps(
    scene: Scene, lights: Lights, at: Vertices, u: Tensor, poses: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Specular reflections of lamps, by one shadow ray each.

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


def _specular_sun(scene: Scene, lights: Lights, at: Vertices, u: Tensor, poses: Tensor) -> Tensor:
    """Radiance ``(N, 3)`` of the sun's specular reflections, by one shadow ray each; see `_specular_lamps`.

    None where the surface is so smooth that it shows the disc itself.
    """
    light = torch.zeros_like(at.points)
    if lights.sun is not None:
        blunt = ~sharp(scene, at)[0]
        given = replace(lights, lamps=None), at[blunt], u[:, blunt], lambda s: glossy(at[blunt], s.direction)
        ((_, light[blunt]),) = direct(scene, *given, poses=poses)
    return light
