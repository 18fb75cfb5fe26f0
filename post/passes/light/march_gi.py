"""Indirect diffuse light by marching rays over the screen: the second method beside the bitmask gather."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pass
from gbufrt.compute.resident import number
from gbufrt.demands.pictures import check_pictures
from gbufrt.directions import tangent_frame
from gbufrt.mending import finite, held
from gbufrt.noise.noise import PLASTIC, blue_noise
from gbufrt.numeric import check_counts, check_kind
from gbufrt.sampling import sample
from post.march.attached import attach_hits
from post.march.rays import depth_hierarchy, march_rays
from post.shading.lobes import dot, unit
from post.shading.sent_light import bounce_light
from post.sweep.chords import known_thickness, thickness_from_depth

PLAIN = 4  # one ray in this many is distributed about the normal itself, so that every direction is sampled


def march_gi(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    light: Tensor,
    albedo: Tensor,
    *,
    hit: Tensor | None = None,
    bent_normal: Tensor | None = None,
    normal_geo: Tensor | None = None,
    thickness: Tensor | float | None = None,
    index: int | Tensor = 0,
    rays: int = 8,
    steps: int = 48,
    distance: float = 50.0,
    seed: int = 0,
) -> tuple[Tensor, Tensor]:
    """Diffuse light that surfaces receive from on-screen surroundings, and how much of their sky is visible.

    Three rays of four are cosine-distributed about the direction half way between ``normal`` and ``bent_normal``, the
    fourth about ``normal``. Each is weighted by the true cosine over the density of the mixture, so that the estimate
    is unbiased. A ray that ends at a side hidden from the camera brings neither light nor sky.

    Differentiable in all tensors but ``thickness``: rays turn with ``normal`` and ``bent_normal``, and what they hit
    moves with ``depth`` and ``normal`` of both ends. Which pixel a ray hits, and whether it hits, is held fixed.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit.
        camera: of the picture.
        light: ``(B, 3, H, W)`` linear radiance that each pixel's surface sends; see `bounce_light`.
        albedo: ``(B, 3, H, W)`` of the diffuse part.
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        bent_normal: ``(B, 3, H, W)`` mean open direction, world space, unit.
        normal_geo: ``(B, 3, H, W)`` geometric normal, world space, where it differs.
        thickness: ``(B, 1, H, W)`` of solids along the view ray, world units; or one assumed for everything;
            by default estimated, see `post.thickness_from_depth`.
        index: frame number, for the noise.
        rays: rays a pixel.
        steps: pixels a ray may be compared with, see `post.march.rays.march_rays`.
        distance: how far rays go, world units.
        seed: another seed, another noise.

    Returns:
        ``gi`` ``(B, 3, H, W)`` outgoing linear radiance, albedo included, and ``sky_visibility`` ``(B, 1, H, W)``, the
        cosine-weighted share of rays that hit nothing.

    Raises:
        TypeError: what must be a tensor or a number is none.
        ValueError: rays is below 1, thickness is negative, or a picture is of another size.

    Source: ME1 Path Tracing technical overview (GI); Veach 1997, section 9.2 (the mixture's weights).
    """
    check_counts(rays=rays, index=index, seed=seed)
    if rays < 1:
        raise ValueError(f"rays must be at least 1, got {rays}")
    check_kind(Tensor, "albedo", albedo)
    given = {"depth": depth, "normal": normal, "light": light, "albedo": albedo, "hit": hit, "thickness": thickness}
    check_pictures(camera, **given, bent_normal=bent_normal, normal_geo=normal_geo)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    depth, hit, normal = held(depth, hit, normal, camera.far)
    light = finite(light)
    points, facing = camera.unproject(depth), camera.rotate_to_view(normal)
    facing = torch.where(hit, facing, camera.to_eye(points))
    axis = facing if bent_normal is None else unit(facing + camera.rotate_to_view(bent_normal))
    axis = torch.where(dot(axis, facing) > 0.1, axis, facing)
    with torch.no_grad():
        flat = normal if normal_geo is None else normal_geo
        solid = thickness_from_depth(depth, normal, camera, hit=hit) if thickness is None else thickness
        hierarchy = depth_hierarchy(depth, flat, camera, hit=hit, thickness=solid)
        upward = facing if normal_geo is None else camera.rotate_to_view(normal_geo)
        noise = blue_noise(*camera.size, dims=2, seed=seed, device=depth.device).to(depth)[None]
    gathered, open_sky = torch.zeros_like(light), torch.zeros_like(depth)
    now = number(index, noise.new_empty((), dtype=torch.float64))
    for i in range(rays):
        place = now * rays + i
        direction = _cosine_ray(torch.where(place % PLAIN == PLAIN - 1, facing, axis), noise, place)
        cosine, about = dot(direction, facing).clamp_min(0.0), dot(direction, axis).clamp_min(0.0)
        weight = cosine / ((1 - 1 / PLAIN) * about + cosine / PLAIN).clamp_min(1e-6)
        weight = torch.where(hit & (dot(direction, upward) > 0), weight, 0.0)
        flying = torch.where(weight > 0, direction, 0.0)
        hits = march_rays(hierarchy, points, flying, camera, steps=steps, distance=distance)
        hits = attach_hits(hits, depth, flat, points, flying, camera)
        open_sky = open_sky + weight * ~(hits.hit | hits.blocked)
        gathered = gathered + weight * hits.hit * hits.agreement * sample(light, hits.px)
    sky = torch.where(hit, (open_sky / rays).clamp(0.0, 1.0), 1.0)
    return albedo * gathered / rays, sky


def _cosine_ray(axis: Tensor, noise: Tensor, place: Tensor) -> Tensor:
    """Directions about ``axis``, cosine-distributed: the sequence's point number ``place``, shifted by blue noise."""
    shift = torch.stack([(place + 1) / PLASTIC, (place + 1) / PLASTIC**2]) % 1.0
    u = (noise + shift.to(noise)[None, :, None, None]) % 1.0
    tangent, bitangent = tangent_frame(axis)
    sine, azimuth = u[:, 0:1].sqrt(), 2 * math.pi * u[:, 1:2]
    return tangent * (sine * azimuth.cos()) + bitangent * (sine * azimuth.sin()) + axis * (1 - u[:, 0:1]).sqrt()


class MarchGI(Pass):
    """See `march_gi`; the light that surfaces send is `bounce_light`. Metals have no diffuse part.

    Args:
        assumed_thickness: of solids along the view ray, world units, where the frame has no ``thickness``; by default
            estimated, see `post.thickness_from_depth`.
        rays: see `march_gi`, as the rest.
    """

    reads = frozenset({"depth", "hit", "normal", "albedo", "radiance"})
    optional = frozenset(
        {"metallic", "emission", "normal_geo", "thickness", "ambient", "ao", "sky_visibility", "bent_normal"}
        | {"motion", "motion_z", "object_id"}
    )
    writes = frozenset({"gi", "sky_visibility"})
    recalls = frozenset({"gi"})

    def __init__(
        self,
        *,
        rays: int = 8,
        bounces: int = 2,
        steps: int = 48,
        distance: float = 50.0,
        assumed_thickness: float | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.rays = rays
        self.bounces = bounces
        self.steps = steps
        self.distance = distance
        self.assumed_thickness = assumed_thickness
        self.seed = seed

    def forward(self, frame: Frame) -> Frame:
        g, tunables = frame.gbuffer, self.tunables()
        light = bounce_light(frame, bounces=tunables.pop("bounces"))
        albedo = frame.read("albedo") if g.metallic is None else frame.read("albedo") * (1 - g.metallic)
        assumed = tunables.pop("assumed_thickness")
        known = {"hit": g.hit, "bent_normal": frame.bent_normal, "normal_geo": g.normal_geo, "index": frame.index}
        known |= {"thickness": known_thickness(g, assumed_thickness=assumed)}
        gi, sky_visibility = march_gi(g.depth, g.normal, g.camera, light, albedo, **known, **tunables)
        return frame.replace(gi=gi, sky_visibility=sky_visibility)
