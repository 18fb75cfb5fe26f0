"""Reflections in torch, a sample after another: the definition of `post.shading.op.reflect`, with its gradients."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.luminance import luminance
from gbufrt.sampling import gather, pixel_centers
from post.march.attached import attach_hits
from post.march.rays import Hierarchy, Hits, march_rays, off_edge
from post.shading.constants import FIREFLY, GLOSSY, GUESSED, NEXT
from post.shading.fireflies import mean_light
from post.shading.ggx import grazing
from post.shading.incoming import Picture, beyond, border_fade, hidden_share, incoming, open_share, sky_share
from post.shading.lobes import (
    Lobe,
    Surface,
    cone_ray,
    dot,
    ggx_ray,
    rays_of,
    reuse_neighbors,
    surface_of,
    throughput,
    unit,
)

Method = Literal["ggx", "cone"]
LOBES = {"ggx": ggx_ray, "cone": cone_ray}


def reflect_reference(
    picture: Picture,
    hierarchy: Hierarchy,
    camera: Camera,
    noise: Tensor,
    shifts: Tensor,
    *,
    steps: int,
    distance: float,
    bounces: int = 1,
    roughness_cutoff: float = 1.0,
    reuse: int = 0,
    method: Method = "ggx",
) -> Tensor:
    """``(B, 5, H, W)``. Arguments and result are those of `post.shading.op.reflect`."""
    depth, hit, roughness, f0 = picture.depth, picture.hit, picture.roughness, picture.f0
    limit = mean_light(picture.light, hit, f0, picture.environment, picture.visibility)
    surface = surface_of(depth, hit, picture.normal, picture.normal_geo, roughness, camera)
    rays = rays_of(surface, f0, roughness, len(shifts))
    trust = ((roughness_cutoff - roughness) * 10 + 1).clamp(0, 1) * (roughness_cutoff < 1) + (roughness_cutoff >= 1)
    total, shares, known, rated, way, ends = (torch.zeros_like(depth) for _ in range(6))
    of_pixel = shifts[rays[:, 0].long() - 1].movedim((3, 4), (0, 2))
    for i, shift in enumerate(of_pixel):
        taken = (surface.hit & (i < rays)).to(depth)
        u = (noise + shift) % 1.0
        lobe = LOBES[method](surface, u, taken)
        reflected, flies = throughput(lobe), (lobe.weight > 0).to(depth)
        reach = {"bounces": bounces, "steps": steps, "distance": distance}
        brought, hits, confidence = _followed(picture, hierarchy, camera, surface, lobe.direction, trust, **reach)
        brought = brought * _firefly_factor(brought, limit, roughness, hits.blocked)
        if reuse:
            brought, reflected = reuse_neighbors(surface, lobe, _ends(surface, lobe, hits), brought, reuse)
        total = total + (f0 * reflected[:, 0:1] + reflected[:, 1:2]) * brought
        shares, known, rated = shares + reflected[:, 2:], known + confidence, rated + flies
        way, ends = way + hits.distance * (ended := hits.hit | hits.blocked), ends + ended
    distances = torch.where(ends > 0, way / ends.clamp_min(1), torch.where(hit, camera.far, 0.0).to(depth))
    return torch.cat([total / shares.clamp_min(1e-6), known / rated.clamp_min(1), distances], dim=1)


def _followed(
    picture: Picture,
    hierarchy: Hierarchy,
    camera: Camera,
    surface: Surface,
    way: Tensor,
    trust: Tensor,
    *,
    bounces: int,
    steps: int,
    distance: float,
) -> tuple[Tensor, Hits, Tensor]:
    """Radiance along each ray, where it first ended, and how far that is trusted.

    A ray that hits a metal goes on as from a smooth mirror, from the point of the pixel that it hit; from a side that
    the camera does not see, whose normal is unknown, along the pixel's normal. After the last bounce it is not marched:
    it brings what lies beyond the picture, the sky as far as the metal's own openness leaves it. Of what a smooth
    dielectric mirrors there, such as water, that is all that is taken.
    """
    g, points, facing = picture, surface.points, camera.rotate_to_view(picture.normal)
    flat, at = g.normal if g.normal_geo is None else g.normal_geo, pixel_centers(g.depth)
    start, open_here, bent, carried = points, g.visibility, g.bent_normal, torch.ones_like(g.depth)
    total, firsts = torch.zeros_like(way), []
    for bounce in range(bounces + 1):
        flies = (way != 0).any(1, keepdim=True).to(way)
        flown = (flies * trust > 0) & (bounce < bounces)
        hits = march_rays(hierarchy, start, way * flown, camera, steps=steps, distance=distance)
        hits = attach_hits(hits, g.depth, flat, start, way * flown, camera)
        begins = ~flown | hits.blocked & ((hits.px - at).abs() < NEXT).all(1, keepdim=True)
        hits = off_edge(hits._replace(blocked=hits.blocked & ~begins), hierarchy, camera, at)
        hits = hits._replace(px=torch.where(begins, at, hits.px))
        confidence = flies * trust * hits.hit * hits.agreement * border_fade(hits.px, camera)
        world = camera.rotate_to_world(way)
        share = sky_share(world, hits, g.hit, g.visibility, open_here, bent, at)
        over_sky = (way[:, 2:] > 0) & ~gather(g.hit, hits.px[:, 0].floor(), hits.px[:, 1].floor())
        guess = flies * ~hits.blocked * beyond(g, world, share, over_sky)
        total = total + carried * incoming(g.light, hits, confidence, guess)
        firsts.append((hits, confidence))
        if g.metallic is None or bounce == bounces:
            break
        column, row = hits.px[:, 0].floor(), hits.px[:, 1].floor()
        other, f0 = gather(facing, column, row), gather(g.f0, column, row)
        seen, metal = confidence + hidden_share(hits) * hits.blocked, gather(g.metallic, column, row)
        cosine = -dot(way, other)
        edge, goes = grazing(cosine.abs()), seen * metal > 0
        way = torch.where(cosine > 0, unit(way + 2 * cosine * other), other)
        start, at = gather(points, column, row), torch.stack([column, row], dim=1) + 0.5
        open_here = None if g.visibility is None else gather(g.visibility, column, row)
        bent = None if g.bent_normal is None else gather(g.bent_normal, column, row)
        mirrored = carried * seen * (f0 * (1 - edge) + edge)
        gloss = (1 - metal) * (1 - gather(g.roughness, column, row) / GLOSSY).clamp_min(0.0)
        above = camera.rotate_to_world(way)
        sky = beyond(g, above, open_share(open_here, bent, above))
        total = total + torch.where(seen * gloss > 0, mirrored * gloss * sky, 0.0)
        carried, way = torch.where(goes, mirrored * metal, 0.0), torch.where(goes, way, 0.0)
    return total, *firsts[0]


def _firefly_factor(brought: Tensor, limit: Tensor, roughness: Tensor, guessed: Tensor) -> Tensor:
    """At most 1: limits guesses and samples of rough surfaces to a multiple of the frame's mean; mirrors keep all."""
    limit = limit * torch.where(guessed, GUESSED, FIREFLY / roughness.clamp_min(1e-3))
    return (limit / luminance(brought).clamp_min(1e-9)).clamp_max(1.0)


def _ends(surface: Surface, lobe: Lobe, hits: Hits) -> Tensor:
    """Where rays ended: points and 1, or directions and 0."""
    found = (hits.hit | hits.blocked).to(hits.distance)
    reach = torch.where(found > 0, hits.distance, 1.0)
    return torch.cat([lobe.direction * reach + surface.points * found, found], dim=1)
