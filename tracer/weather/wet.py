"""Wetness: what rain does to the surfaces that it reaches."""

from __future__ import annotations

from dataclasses import replace

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.resident import numbers, places
from gbufrt.noise.noise import PLASTIC, blue_noise
from tracer.sampling.sequence import disc
from tracer.scene.scene import MASK_SHADOW, Scene
from tracer.scene.weather import Rain
from tracer.texture import Look, facing
from tracer.traversal.hits import Hits
from tracer.traversal.rays import trace
from tracer.weather.noise import noise3
from tracer.weather.ripples import ripple_slopes

RAYS, FIRST = 8, 2  # rays a pixel that look for cover; those that are sent everywhere
REACH = 2  # pixels round a pixel that must agree after the first
LEVEL = 0.5  # cosine from the vertical up to which water stands in puddles
LIFT, LIFT_RELATIVE = 1e-3, 2e-6  # world units that rays begin above a surface, and part of its distance


def wet(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    hits: Hits,
    seen: Look,
    pixels_per_unit: Tensor,
    *,
    poses: Tensor,
    times: list[float],
) -> Look:
    """Surfaces as rain leaves them; those of a scene without rain as they are.

    Rays through a disc above each surface find how much of the rain is kept off. What is wet is smoother, darker and
    less of a metal, more so in puddles, which noise makes on faces of the world that look up. Rain draws rings on
    puddles and on water, which is otherwise as it was.

    Args:
        scene: what is there, and its rain.
        origins: ``(B, H, W, 3)`` of the rays, world space.
        directions: likewise, unit length.
        hits: of these rays.
        seen: the surfaces when dry.
        pixels_per_unit: ``(B, H, W)`` how many pixels a world unit spans in the picture.
        poses: ``(B, I, 4, 4)`` of the instances.
        times: B, seconds.

    Source: BetterRTX's rain puddles.
    """
    rain = scene.rain
    if rain is None or rain.level == 0.0:
        return seen
    points = origins + directions * torch.where(hits.hit, hits.t, 0.0)[..., None]
    up, water = hits.normal[..., 1], scene.materials.water[hits.material.long()] & hits.hit
    exposed = hits.hit & (up > -0.01) & ~hits.back_face & ~(water & (up < LEVEL))
    if scene.waves is not None:  # from waves, rays begin over still water, out of its voxels
        level = torch.where(water & (up > LEVEL), (points[..., 1] - 1e-2).ceil(), points[..., 1])
        points = torch.stack([points[..., 0], torch.maximum(level, points[..., 1]), points[..., 2]], dim=-1)
    lifted = points + hits.normal * (LIFT + LIFT_RELATIVE * hits.t)[..., None]
    surfaces = zip(lifted, hits.normal, exposed, poses, strict=True)
    reached = torch.stack([_reached(scene, rain, *surface) for surface in surfaces])
    ground = (up > LEVEL) & (hits.instance == 0)
    here, puddle = places(ground & (reached > 0)), torch.zeros_like(reached)  # elsewhere none counts
    noise = noise3(points[here] / rain.puddle_scale)
    puddle[here] = _smoothstep(rain.puddle_low, rain.puddle_high, noise)
    share = torch.where(ground, puddle, rain.runoff)
    looks = _dampened(seen, rain, share, torch.where(water, 0.0, reached))
    if rain.ripples == 0.0:
        return looks
    rings = torch.where(water, 1.0, torch.where(ground, puddle, 0.0)) * reached
    return _rippled(looks, hits, rain, rings, points, directions, pixels_per_unit, times)


def _reached(scene: Scene, rain: Rain, points: Tensor, normals: Tensor, exposed: Tensor, poses: Tensor) -> Tensor:
    """``(H, W)`` share of the rain that reaches ``points`` ``(H, W, 3)`` where they are ``exposed`` at all.

    What would come from behind a wall comes from before it: a free wall gets all that there is for it.
    """
    size = exposed.shape
    noise = blue_noise(*size, dims=2, device=points.device).flatten(1)
    falls = points.new_zeros(exposed.numel())
    points, normals = points.reshape(-1, 3), normals.reshape(-1, 3)

    def send(where: Tensor, which: range) -> None:
        pixels = places(where.flatten())[0]
        if len(pixels) == 0:
            return
        wanted = where.flatten()[pixels]
        reach = torch.where(wanted, torch.inf, 0.0)
        for number in which:
            turn = noise[:, pixels] + numbers(((number / PLASTIC,), (number / PLASTIC**2,)), noise)
            x, z = disc(turn % 1.0) * rain.disc_radius
            way = F.normalize(torch.stack([x, torch.ones_like(x), z], dim=-1), dim=-1)
            away = (way * normals[pixels]).sum(dim=-1, keepdim=True).clamp_max(0.0)
            way = way - 2 * away * normals[pixels]
            found = trace(scene, points[pixels], way, poses=poses, mask=MASK_SHADOW, t_max=reach)
            falls[pixels] += (wanted & ~found.hit).float()

    send(exposed, range(FIRST))
    open_, covered = (falls.view(size) / FIRST), 1 - falls.view(size) / FIRST
    differ = (_widest(open_) > 0) & (_widest(torch.where(exposed, covered, 0.0)) > 0) & exposed
    send(differ, range(FIRST, RAYS))
    return torch.where(differ, falls.view(size) / RAYS, open_)


def _widest(plane: Tensor) -> Tensor:
    """The greatest value within `REACH` pixels."""
    return F.max_pool2d(plane[None, None], 2 * REACH + 1, stride=1, padding=REACH)[0, 0]


def _dampened(seen: Look, rain: Rain, share: Tensor, reached: Tensor) -> Look:
    """Surfaces where so much of the rain arrives and a ``share`` of it stays, both of the surfaces' shape."""
    wetness = rain.level * rain.wetness * share * reached
    smooth = torch.maximum(rain.level * rain.uniform_wetness * reached, wetness)
    alpha = torch.lerp(seen.roughness**2, torch.full_like(smooth, rain.puddle_roughness**2), smooth)
    rougher = seen.roughness <= rain.puddle_roughness  # what is smoother than a puddle already
    return replace(
        seen,
        albedo=seen.albedo * (1 - (1 - rain.colour_reduction) * wetness)[..., None],
        roughness=torch.where((smooth == 0) | rougher, seen.roughness, alpha.sqrt()),
        metallic=seen.metallic * (1 - (1 - rain.metalness_reduction) * wetness),
    )


def _rippled(
    seen: Look,
    hits: Hits,
    rain: Rain,
    rings: Tensor,
    points: Tensor,
    directions: Tensor,
    pixels_per_unit: Tensor,
    times: list[float],
) -> Look:
    """Surfaces with the rings of drops in their normals, where ``rings`` is above 0."""
    here = places(rings > 0)
    when = numbers((times,), points)[0][here[0]]
    toward, flat = directions[here], hits.normal[here]
    narrow = pixels_per_unit[here] * (flat * toward).sum(dim=-1).abs()  # as far as the surface is foreshortened
    slopes = ripple_slopes(points[here][:, ::2], when, rain.level, narrow) * (rain.ripples * rings[here])[:, None]
    level = torch.stack([-slopes[:, 0], torch.zeros_like(when), -slopes[:, 1]], dim=-1)
    normal = facing(F.normalize(seen.normal[here] + level, dim=-1), flat, toward)
    turned = (slopes != 0).any(dim=-1)
    return replace(seen, normal=seen.normal.index_put(here, torch.where(turned[:, None], normal, seen.normal[here])))


def _smoothstep(low: float, high: float, x: Tensor) -> Tensor:
    t = ((x - low) / (high - low)).clamp(0.0, 1.0)
    return t * t * (3 - 2 * t)
