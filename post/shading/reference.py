"""Reflections in torch, a sample after another: the definition of `post.shading.op.reflect`, with its gradients."""

from __future__ import annotations

from typing import Literal, NamedTuple

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.environment import lookup_environment
from gbufrt.luminance import luminance
from gbufrt.sampling import gather, pixel_centers, sample
from post.march.attached import attach_hits
from post.march.rays import Hierarchy, Hits, march_rays, off_edge
from post.shading.constants import (
    BORDER,
    CONTINUED_SHARE,
    FIREFLY,
    GLOSSY,
    GUESSED,
    HIDDEN_SHARE,
    NEXT,
    OPEN,
    ROW_SLOPE,
)
from post.shading.fireflies import mean_light
from post.shading.ggx import grazing
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


class Picture(NamedTuple):
    """What the camera sees that reflects, and what it reflects; see `post.ssr` for the fields."""

    depth: Tensor
    hit: Tensor
    normal: Tensor
    normal_geo: Tensor | None
    roughness: Tensor
    f0: Tensor
    light: Tensor
    environment: Tensor | None
    visibility: Tensor | None
    bent_normal: Tensor | None
    metallic: Tensor | None = None
    around: Tensor | None = None
    """What lies beyond it, see `post.shading.surroundings`: ``(B, 4, h, w)``; by default nothing but the sky."""


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
        incoming, hits, confidence = _followed(picture, hierarchy, camera, surface, lobe.direction, trust, **reach)
        incoming = incoming * _firefly_factor(incoming, limit, roughness, hits.blocked)
        if reuse:
            incoming, reflected = reuse_neighbors(surface, lobe, _ends(surface, lobe, hits), incoming, reuse)
        total = total + (f0 * reflected[:, 0:1] + reflected[:, 1:2]) * incoming
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
        confidence = flies * trust * hits.hit * hits.agreement * _border_fade(hits.px, camera)
        world = camera.rotate_to_world(way)
        share = _sky_share(world, hits, g.hit, g.visibility, open_here, bent, at)
        over_sky = (way[:, 2:] > 0) & ~gather(g.hit, hits.px[:, 0].floor(), hits.px[:, 1].floor())
        guess = flies * ~hits.blocked * _beyond(g, world, share, over_sky)
        total = total + carried * _incoming(g.light, hits, confidence, guess)
        firsts.append((hits, confidence))
        if g.metallic is None or bounce == bounces:
            break
        column, row = hits.px[:, 0].floor(), hits.px[:, 1].floor()
        other, f0 = gather(facing, column, row), gather(g.f0, column, row)
        seen, metal = confidence + _hidden_share(hits) * hits.blocked, gather(g.metallic, column, row)
        cosine = -dot(way, other)
        edge, goes = grazing(cosine.abs()), seen * metal > 0
        way = torch.where(cosine > 0, unit(way + 2 * cosine * other), other)
        start, at = gather(points, column, row), torch.stack([column, row], dim=1) + 0.5
        open_here = None if g.visibility is None else gather(g.visibility, column, row)
        bent = None if g.bent_normal is None else gather(g.bent_normal, column, row)
        mirrored = carried * seen * (f0 * (1 - edge) + edge)
        gloss = (1 - metal) * (1 - gather(g.roughness, column, row) / GLOSSY).clamp_min(0.0)
        above = camera.rotate_to_world(way)
        sky = _beyond(g, above, _open_share(open_here, bent, above))
        total = total + torch.where(seen * gloss > 0, mirrored * gloss * sky, 0.0)
        carried, way = torch.where(goes, mirrored * metal, 0.0), torch.where(goes, way, 0.0)
    return total, *firsts[0]


def border_width(camera: Camera) -> float:
    """Pixels from the picture's border over which hits fade."""
    return max(BORDER * camera.height, 1.0)


def _border_fade(px: Tensor, camera: Camera) -> Tensor:
    """1 inside the picture, falling to 0 at its border."""
    x, y = px[:, 0:1], px[:, 1:2]
    to_edge = torch.minimum(torch.minimum(x, camera.width - x), torch.minimum(y, camera.height - y))
    return (to_edge / border_width(camera)).clamp(0.0, 1.0)


def _sky_share(
    world: Tensor,
    hits: Hits,
    hit: Tensor,
    everywhere: Tensor | None,
    visibility: Tensor | None,
    bent: Tensor | None,
    at: Tensor,
) -> Tensor:
    """Visibility of the sky to a ray without a hit.

    The ray takes the visibility of the surface it was last in front of, or 1 if that was the sky itself: its end is as
    open as that surface, whatever surrounds its origin. Only a ray that leaves the picture over nothing more open than
    its origin, or is hidden from its beginning, tells no more than the origin does. Then the open part of the origin's
    hemisphere is taken for a cone around the bent normal, see `_open_share`.
    """
    share = _open_share(visibility, bent, world)
    if everywhere is None or visibility is None:
        return share
    last = gather(torch.where(hit, everywhere, 1.0), hits.px[:, 0].floor(), hits.px[:, 1].floor())
    went = ((hits.px - at).abs() > 0.5).any(1, keepdim=True)
    return torch.where(hits.spent & went | (last > visibility), last, share)


def _open_share(visibility: Tensor | None, bent: Tensor | None, world: Tensor) -> Tensor:
    """Visibility of the sky along directions, as far as the openness of a surface tells.

    Cosine-weighted visibility v leaves open a half angle whose sine is sqrt(v) (Jimenez et al. 2016, section 5). A
    surface that is nearly open is taken as open, else rays that leave over a plain would be dark or not by a hair.
    """
    if visibility is None:
        return torch.ones_like(world[:, :1])
    if bent is None:
        return visibility
    edge = (1 - visibility / OPEN).clamp(1e-30, 1.0).sqrt()  # not of 0, where its slope is infinite
    soft = (0.3 * visibility.clamp(1e-30, 1.0).sqrt()).clamp_min(1e-3)
    ramp = ((dot(bent, world) - edge) / soft + 1).clamp(0.0, 1.0)
    return ramp * ramp * (3 - 2 * ramp) * (visibility * 20).clamp(0.0, 1.0)


def _beyond(g: Picture, world: Tensor, share: Tensor, over_sky: Tensor | None = None) -> Tensor:
    """What rays meet that leave the picture: a share of the sky, the rest surfaces.

    A ray that ends over the sky, going away from the camera, meets it. Others find it as far up as the surroundings
    leave it open.
    """
    sky = torch.zeros_like(world) if g.environment is None else lookup_environment(g.environment, world)
    if g.around is None:
        return share * sky
    surface, left = lookup_environment(g.around, off_horizon(world)).split((3, 1), dim=1)
    share = share * (left if over_sky is None else torch.where(over_sky, 1.0, left))
    return torch.lerp(surface, sky, share)


def off_horizon(world: Tensor) -> Tensor:
    """Directions that the rows of a guess next to the horizon lie in, where they would lie between these.

    What is over the horizon is not to be mixed with what is below it.
    """
    x, y, z = world.unbind(dim=1)
    least = ROW_SLOPE * (x * x + z * z).clamp_min(1e-12).sqrt()
    return torch.stack([x, torch.where(y > 0, torch.maximum(y, least), torch.minimum(y, -least)), z], dim=1)


def _incoming(light: Tensor, hits: Hits, confidence: Tensor, guess: Tensor) -> Tensor:
    """Radiance of each ray: light from the screen as far as it is trusted, else a guess."""
    visible = sample(light, hits.px)
    guess = torch.where(hits.blocked, _hidden_share(hits) * visible, guess)
    return guess + (visible - guess) * confidence


def _hidden_share(hits: Hits) -> Tensor:
    """Share of the light next to hidden geometry that it is taken to send: all, where the same surface goes on."""
    return torch.where(hits.agreement > 0, HIDDEN_SHARE, CONTINUED_SHARE)


def _firefly_factor(incoming: Tensor, limit: Tensor, roughness: Tensor, guessed: Tensor) -> Tensor:
    """At most 1: limits guesses and samples of rough surfaces to a multiple of the frame's mean; mirrors keep all."""
    limit = limit * torch.where(guessed, GUESSED, FIREFLY / roughness.clamp_min(1e-3))
    return (limit / luminance(incoming).clamp_min(1e-9)).clamp_max(1.0)


def _ends(surface: Surface, lobe: Lobe, hits: Hits) -> Tensor:
    """Where rays ended: points and 1, or directions and 0."""
    found = (hits.hit | hits.blocked).to(hits.distance)
    reach = torch.where(found > 0, hits.distance, 1.0)
    return torch.cat([lobe.direction * reach + surface.points * found, found], dim=1)
