"""Stochastic screen-space reflections with roughness, Fresnel and a confidence."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pass
from gbufrt.environment import lookup_environment
from gbufrt.mending import finite, held
from gbufrt.noise.noise import PLASTIC, blue_noise, radical_inverse
from gbufrt.sampling import gather, pixel_centers, sample
from gbufrt.specular import DIELECTRIC_F0, MIRROR_ROUGHNESS
from post.filters.signals import luminance
from post.march.attached import attach_hits
from post.march.rays import Hits, depth_hierarchy, march_rays
from post.shading.ggx import specular_f0
from post.shading.lobes import Lobe, Surface, cone_ray, dot, ggx_ray, reuse_neighbors, surface_of, throughput
from post.shading.sent_light import outgoing_light

Method = Literal["ggx", "cone"]
THICKNESS = 0.5  # assumed, world units, where neither a measurement nor a guess is given
BORDER = 0.005  # of the picture's height: hits nearer to its border than this fade out
HIDDEN_SHARE = 0.5  # share of the radiance of the surface next to a hidden one, as a guess of the hidden one's
FIREFLY = 16.0  # times the frame's mean luminance, over roughness: limit of one sample
GUESSED = 4.0  # times that mean: limit of a hidden side, since lamps seldom continue behind their occluders


def ssr(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    light: Tensor,
    roughness: Tensor,
    *,
    hit: Tensor | None = None,
    f0: Tensor | None = None,
    normal_geo: Tensor | None = None,
    thickness: Tensor | float | None = None,
    environment: Tensor | None = None,
    visibility: Tensor | None = None,
    bent_normal: Tensor | None = None,
    index: int = 0,
    samples: int = 4,
    steps: int = 64,
    distance: float | None = None,
    roughness_cutoff: float = 1.0,
    reuse: int = 0,
    method: Method = "ggx",
    seed: int = 0,
) -> tuple[Tensor, Tensor, Tensor]:
    """Specular reflections, from on-screen hits where there are any, else from the environment.

    A ray that hits a visible surface brings ``light``. A ray that hits nothing brings the environment times a sky
    visibility: that of the surface it was last in front of, or that of the cone around ``bent_normal`` that
    ``visibility`` leaves open. So windows reflect the sky, and interiors do not fill with it. A ray that ends at a
    surface hidden from the camera brings some of the light of the surface next to it, at confidence 0.

    Differentiable in all tensors but ``thickness``: rays turn with ``normal`` and ``roughness``, and what they hit
    moves with ``depth`` and ``normal`` of both ends. Which pixel a ray hits, and whether it hits, is held fixed.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit.
        camera: of the picture.
        light: ``(B, 3, H, W)`` linear radiance that each pixel's surface sends; see `outgoing_light`.
        roughness: ``(B, 1, H, W)`` perceptual, in [0, 1].
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        f0: ``(B, 3, H, W)`` reflectance at normal incidence; 0.04 where absent.
        normal_geo: ``(B, 3, H, W)`` geometric normal, world space, where it differs.
        thickness: ``(B, 1, H, W)`` of solids along the view ray, world units; or one assumed for everything;
            by default 0.5.
        environment: ``(B, 3, h, w)`` lat-long sky; black where absent.
        visibility: ``(B, 1, H, W)`` cosine-weighted visibility of the sky, 1 open.
        bent_normal: ``(B, 3, H, W)`` mean open direction, world space, unit.
        index: frame number, for the noise.
        samples: rays a pixel; one for a mirror.
        steps: see `march_rays`.
        distance: how far rays go, world units; None for the camera's far.
        roughness_cutoff: above it rays fade to the environment alone, over the next 0.1.
        reuse: how many neighbours' rays a pixel reuses, 0 to 8.
        method: ``"ggx"`` samples visible microfacets; ``"cone"`` a cone of roughness x 45 degrees.
        seed: another seed, another noise.

    Returns:
        ``reflection`` ``(B, 3, H, W)`` linear radiance, Fresnel included; ``confidence`` ``(B, 1, H, W)`` share of it
        found on screen; and ``distance`` ``(B, 1, H, W)`` mean distance to what was hit, ``far`` where only sky was.

    Raises:
        ValueError: unknown method, samples below 1, or reuse outside 0 to 8.

    Source: Stachowiak 2015; Heitz 2018; ME1 Path Tracing technical overview for ``cone``.
    """
    if method not in ("ggx", "cone"):
        raise ValueError(f'method must be "ggx" or "cone", got {method!r}')
    if samples < 1 or not 0 <= reuse <= 8:
        raise ValueError(f"samples must be at least 1 and reuse 0 to 8, got samples={samples}, reuse={reuse}")
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    depth, hit, normal = held(depth, hit, normal, camera.far)
    light, environment = finite(light), None if environment is None else finite(environment)
    f0 = torch.full_like(light, DIELECTRIC_F0) if f0 is None else f0
    far = camera.far if distance is None else distance
    flat, solid = normal if normal_geo is None else normal_geo, THICKNESS if thickness is None else thickness
    surface = surface_of(depth, hit, normal, normal_geo, roughness, camera)
    hierarchy = depth_hierarchy(depth, flat, camera, hit=hit, thickness=solid)
    with torch.no_grad():
        rays = torch.where(roughness < MIRROR_ROUGHNESS, 1.0, float(samples))
    trust = ((roughness_cutoff - roughness) * 10 + 1).clamp(0, 1) * (roughness_cutoff < 1) + (roughness_cutoff >= 1)
    total, shares, known, rated, way, ends = (torch.zeros_like(depth) for _ in range(6))
    for i in range(samples):
        taken = (surface.hit & (i < rays)).to(depth)
        lobe = LOBES[method](surface, _points(depth, index, i, samples, method, seed), taken)
        reflected, flies = throughput(lobe), (lobe.weight > 0).to(depth)
        marching = lobe.direction * (flies * trust > 0)
        hits = march_rays(hierarchy, surface.points, marching, camera, steps=steps, distance=far)
        hits = attach_hits(hits, depth, flat, surface.points, marching, camera)
        confidence = flies * trust * hits.hit * hits.agreement * _border_fade(hits.px, camera)
        world = camera.rotate_to_world(lobe.direction)
        sky = flies * ~hits.blocked * _sky_share(world, hits, hit, visibility, bent_normal)
        incoming = _incoming(light, environment, hits, confidence, world, sky)
        incoming = incoming * _firefly_factor(incoming, light, hit, roughness, hits.blocked)
        if reuse:
            incoming, reflected = reuse_neighbors(surface, lobe, _ends(surface, lobe, hits), incoming, reuse)
        total = total + (f0 * reflected[:, 0:1] + reflected[:, 1:2]) * incoming
        shares, known, rated = shares + reflected[:, 2:], known + confidence, rated + flies
        way, ends = way + hits.distance * (ended := hits.hit | hits.blocked), ends + ended
    distances = torch.where(ends > 0, way / ends.clamp_min(1), torch.where(hit, camera.far, 0.0).to(depth))
    return total / shares.clamp_min(1e-6), known / rated.clamp_min(1), distances


LOBES = {"ggx": ggx_ray, "cone": cone_ray}


def _points(depth: Tensor, index: int, i: int, samples: int, method: Method, seed: int) -> Tensor:
    """``(1, 2, H, W)`` sample points: a low-discrepancy sequence over samples and frames, shifted by blue noise."""
    noise = blue_noise(*depth.shape[-2:], dims=2, seed=seed, device=depth.device).to(depth)
    place = index * samples + i + 1  # each dimension advances by its own step: one step for both would trace a diagonal
    pair = (place / PLASTIC % 1.0, place / PLASTIC**2 % 1.0)
    if method == "cone":
        pair = ((i / samples + place / PLASTIC) % 1.0, (radical_inverse(2, i) + index / PLASTIC**2) % 1.0)
    return ((noise + noise.new_tensor(pair)[:, None, None]) % 1.0)[None]


def _border_fade(px: Tensor, camera: Camera) -> Tensor:
    """1 inside the picture, falling to 0 at its border."""
    x, y, width = px[:, 0:1], px[:, 1:2], max(BORDER * camera.height, 1.0)
    to_edge = torch.minimum(torch.minimum(x, camera.width - x), torch.minimum(y, camera.height - y))
    return (to_edge / width).clamp(0.0, 1.0)


def _sky_share(world: Tensor, hits: Hits, hit: Tensor, visibility: Tensor | None, bent: Tensor | None) -> Tensor:
    """Visibility of the sky to a ray without a hit.

    The ray takes the visibility of the surface it was last in front of, or 1 if that was the sky itself: its end is as
    open as that surface, whatever surrounds its origin. Only a ray that leaves the picture over nothing more open than
    its origin, or is hidden from its beginning, tells no more than the origin does. Then the open part of the origin's
    hemisphere is taken for a cone around the bent normal: cosine-weighted visibility v leaves open a half angle whose
    sine is sqrt(v) (Jimenez et al. 2016, section 5).
    """
    if visibility is None:
        return torch.ones_like(hits.distance)
    share = visibility
    if bent is not None:
        edge = (1 - visibility).clamp(1e-30, 1.0).sqrt()  # not of 0, where its slope is infinite
        soft = (0.3 * visibility.clamp(1e-30, 1.0).sqrt()).clamp_min(1e-3)
        ramp = ((dot(bent, world) - edge) / soft + 1).clamp(0.0, 1.0)
        share = ramp * ramp * (3 - 2 * ramp) * (visibility * 20).clamp(0.0, 1.0)
    last = gather(torch.where(hit, visibility, 1.0), hits.px[:, 0].floor(), hits.px[:, 1].floor())
    went = ((hits.px - pixel_centers(hits.distance)).abs() > 0.5).any(1, keepdim=True)
    return torch.where(hits.spent & went | (last > visibility), last, share)


def _incoming(
    light: Tensor, environment: Tensor | None, hits: Hits, confidence: Tensor, world: Tensor, sky: Tensor
) -> Tensor:
    """Radiance of each ray: light from the screen as far as it is trusted, else the environment."""
    visible = sample(light, hits.px)
    guessed = torch.where(hits.blocked, HIDDEN_SHARE * visible, 0.0)
    if environment is not None:
        guessed = guessed + sky * lookup_environment(environment, world)
    return guessed + (visible - guessed) * confidence


def _firefly_factor(incoming: Tensor, light: Tensor, hit: Tensor, roughness: Tensor, guessed: Tensor) -> Tensor:
    """At most 1: limits guesses and samples of rough surfaces to a multiple of the frame's mean; mirrors keep all."""
    mean = (luminance(light) * hit).sum((1, 2, 3), keepdim=True) / hit.sum((1, 2, 3), keepdim=True).clamp_min(1)
    limit = mean * torch.where(guessed, GUESSED, FIREFLY / roughness.clamp_min(1e-3))
    return (limit / luminance(incoming).clamp_min(1e-9)).clamp_max(1.0)


def _ends(surface: Surface, lobe: Lobe, hits: Hits) -> Tensor:
    """Where rays ended: points and 1, or directions and 0."""
    found = (hits.hit | hits.blocked).to(hits.distance)
    reach = torch.where(found > 0, hits.distance, 1.0)
    return torch.cat([lobe.direction * reach + surface.points * found, found], dim=1)


class SSR(Pass):
    """See `ssr`; the light that surfaces send is `outgoing_light`."""

    reads = frozenset({"depth", "hit", "normal", "roughness", "radiance"})
    optional = frozenset(
        {"albedo", "metallic", "normal_geo", "thickness", "ambient", "environment"}
        | {"ao", "sky_visibility", "bent_normal", "gi"}
    )
    writes = frozenset({"reflection", "reflection_confidence", "reflection_distance"})

    def __init__(
        self,
        *,
        samples: int = 4,
        steps: int = 64,
        distance: float | None = None,
        assumed_thickness: float = THICKNESS,
        roughness_cutoff: float = 1.0,
        reuse: int = 0,
        method: Method = "ggx",
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.samples = samples
        self.steps = steps
        self.distance = distance
        self.assumed_thickness = assumed_thickness
        self.roughness_cutoff = roughness_cutoff
        self.reuse = reuse
        self.method: Method = method
        self.seed = seed

    def forward(self, frame: Frame) -> Frame:
        g, tunables = frame.gbuffer, self.tunables()
        assumed = tunables.pop("assumed_thickness")
        visibility = frame.ao if frame.sky_visibility is None else frame.sky_visibility
        known = {"hit": g.hit, "f0": _f0(frame), "normal_geo": g.normal_geo, "environment": frame.environment}
        known |= {"thickness": assumed if g.thickness is None else g.thickness, "index": frame.index}
        known |= {"visibility": visibility, "bent_normal": frame.bent_normal}
        surface = (g.depth, g.normal, g.camera, outgoing_light(frame), frame.read("roughness"))
        reflection, confidence, distance = ssr(*surface, **known, **tunables)
        return frame.replace(reflection=reflection, reflection_confidence=confidence, reflection_distance=distance)


def _f0(frame: Frame) -> Tensor | None:
    g = frame.gbuffer
    return None if g.albedo is None or g.metallic is None else specular_f0(g.albedo, g.metallic)
