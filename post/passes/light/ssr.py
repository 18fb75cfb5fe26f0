"""Stochastic screen-space reflections with roughness, Fresnel and a confidence."""

from __future__ import annotations

import math
from functools import partial
from types import MappingProxyType

import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pass
from gbufrt.compute.resident import number, resident_on
from gbufrt.demands.pictures import check_pictures
from gbufrt.mending import finite, held
from gbufrt.noise.noise import PLASTIC, blue_noise, radical_inverse
from gbufrt.numeric import check_between, check_counts
from gbufrt.specular import DIELECTRIC_F0
from post.march.rays import depth_hierarchy
from post.mirrors.shown import without_shown
from post.passes.light.fresh import by_history
from post.shading.fireflies import without_lone_fireflies
from post.shading.ggx import specular_f0
from post.shading.incoming import Picture
from post.shading.op import reflect
from post.shading.reference import Method
from post.shading.sent_light import outgoing_light
from post.shading.surroundings import look_around
from post.sweep.chords import known_thickness, thickness_from_depth


def ssr(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    light: Tensor,
    roughness: Tensor,
    *,
    hit: Tensor | None = None,
    f0: Tensor | None = None,
    metallic: Tensor | None = None,
    normal_geo: Tensor | None = None,
    thickness: Tensor | float | None = None,
    environment: Tensor | None = None,
    visibility: Tensor | None = None,
    bent_normal: Tensor | None = None,
    index: int | Tensor = 0,
    samples: int = 4,
    steps: int = 64,
    distance: float | None = None,
    bounces: int = 2,
    roughness_cutoff: float = 1.0,
    reuse: int = 0,
    method: Method = "ggx",
    surroundings: bool = True,
    seed: int = 0,
) -> tuple[Tensor, Tensor, Tensor]:
    """Specular reflections, from on-screen hits where there are any, else from the environment.

    A ray that hits a visible surface brings ``light``. A ray that hits nothing brings the environment times a sky
    visibility: that of the surface it was last in front of, or that of the cone around ``bent_normal`` that
    ``visibility`` leaves open. So windows reflect the sky, and interiors do not fill with it. The rest of what it
    brings, and the environment where there is none, is guessed from what the picture shows in other directions: see
    `post.shading.surroundings.look_around`. A ray that ends at geometry hidden from the camera brings the light of the
    surface that goes on there, or some of that next to a side, at confidence 0. A ray that hits a metal goes on as from
    a smooth mirror, and after its last bounce brings what lies beyond the picture. Lone bright pixels of narrow lobes
    are limited: see `post.shading.fireflies.without_lone_fireflies`.

    Differentiable in all tensors but ``thickness``: rays turn with ``normal`` and ``roughness``, and what they hit
    moves with ``depth`` and ``normal`` of both ends. Which pixel a ray hits, and whether it hits, is held fixed.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit.
        camera: of the picture.
        light: ``(B, 3, H, W)`` linear radiance that each pixel's surface sends, see `outgoing_light`, and that of the
            sky where there is no surface.
        roughness: ``(B, 1, H, W)`` perceptual, in [0, 1].
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        f0: ``(B, 3, H, W)`` reflectance at normal incidence; 0.04 where absent.
        metallic: ``(B, 1, H, W)`` in [0, 1]: which surfaces mirror what rays that hit them bring; none where absent.
        normal_geo: ``(B, 3, H, W)`` geometric normal, world space, where it differs.
        thickness: ``(B, 1, H, W)`` of solids along the view ray, world units; or one assumed for everything;
            by default estimated, see `post.thickness_from_depth`.
        environment: ``(B, 3, h, w)`` lat-long sky; where absent that of the picture, or black without surroundings.
        visibility: ``(B, 1, H, W)`` cosine-weighted visibility of the sky, 1 open.
        bent_normal: ``(B, 3, H, W)`` mean open direction, world space, unit.
        index: frame number, for the noise.
        samples: rays a pixel; one for a mirror, fewer where lobes are broad or reflect little, see `rays_of`.
        steps: pixels a ray may be compared with, see `march_rays`.
        distance: how far rays go, world units; None for the camera's far.
        bounces: how often a ray is marched, again from each metal that it hits; 1 to take metals as other surfaces.
        roughness_cutoff: above it rays fade to the environment and surroundings alone, over the next 0.1.
        reuse: how many neighbours' rays a pixel reuses, 0 to 8.
        method: ``"ggx"`` samples visible microfacets; ``"cone"`` a cone of roughness x 45 degrees.
        surroundings: whether to guess what lies beyond the picture; if not, nothing but the environment does.
        seed: another seed, another noise.

    Returns:
        ``reflection`` ``(B, 3, H, W)`` linear radiance, Fresnel included; ``confidence`` ``(B, 1, H, W)`` share of it
        found on screen; and ``distance`` ``(B, 1, H, W)`` mean distance to what was hit, ``far`` where only sky was.

    Raises:
        TypeError: what must be a tensor or a number is none.
        ValueError: unknown method, samples or bounces below 1, reuse outside 0 to 8, a negative thickness, or a picture
            of another size.

    Source: Stachowiak 2015; Heitz 2018; ME1 Path Tracing technical overview for ``cone``.
    """
    if method not in ("ggx", "cone"):
        raise ValueError(f'method must be "ggx" or "cone", got {method!r}')
    check_counts(samples=samples, reuse=reuse, bounces=bounces, index=index, seed=seed)
    if samples < 1 or not 0 <= reuse <= 8:
        raise ValueError(f"samples must be at least 1 and reuse 0 to 8, got samples={samples}, reuse={reuse}")
    check_between(0, math.inf, roughness_cutoff=roughness_cutoff)
    if bounces < 1:
        raise ValueError(f"bounces must be at least 1, got {bounces}")
    given = {"depth": depth, "normal": normal, "light": light, "roughness": roughness, "hit": hit, "f0": f0}
    given |= {"metallic": metallic, "normal_geo": normal_geo, "environment": environment, "visibility": visibility}
    check_pictures(camera, **given, bent_normal=bent_normal, thickness=thickness)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    depth, hit, normal = held(depth, hit, normal, camera.far)
    light, environment = finite(light), None if environment is None else finite(environment)
    f0 = torch.full_like(light, DIELECTRIC_F0) if f0 is None else f0
    far = camera.far if distance is None else distance
    flat, solid = normal if normal_geo is None else normal_geo, thickness
    solid = thickness_from_depth(depth.detach(), normal.detach(), camera, hit=hit) if solid is None else solid
    hierarchy = depth_hierarchy(depth, flat, camera, hit=hit, thickness=solid)
    around, above = look_around(light, hit, camera, depth) if surroundings else (None, None)
    sky = (above if environment is None else environment, visibility, bent_normal)
    mirrors = metallic if bounces > 1 else None
    picture = Picture(depth, hit, normal, normal_geo, roughness, f0, light, *sky, mirrors, around)
    noise = blue_noise(*camera.size, dims=2, seed=seed, device=depth.device).to(depth)
    shifts = _shifts(index, samples, method, noise)
    options = {"bounces": bounces, "steps": steps, "distance": far, "roughness_cutoff": roughness_cutoff}
    found = reflect(picture, hierarchy, camera, noise, shifts, reuse=reuse, method=method, **options)
    del given, picture, hierarchy, noise, light, solid, around, above, sky  # half of what is in memory here at once
    reflection = without_lone_fireflies(found[:, :3], roughness)
    return reflection, found[:, 3:4].clone(), found[:, 4:].clone()  # views that are kept would keep the rest


def _shifts(index: int | Tensor, samples: int, method: Method, noise: Tensor) -> Tensor:
    """``(samples, samples, 2)`` by how much each ray shifts the noise, of a pixel that takes 1, 2, ... rays.

    However many they are, they follow a low-discrepancy sequence over rays and frames that leaves nothing out.
    """
    each = torch.arange(samples, dtype=torch.float64, device=noise.device)
    now, count = number(index, each), each[:, None] + 1
    place = now * count + each + 1
    turns = place / PLASTIC, place / PLASTIC**2  # a step each: one step for both would trace a diagonal
    if method == "cone":
        apart = resident_on(noise.device, tuple(radical_inverse(2, i) for i in range(samples)), torch.float64)
        turns = each / count + place / PLASTIC, (apart + now / PLASTIC**2).expand_as(place)
    return (torch.stack(turns, dim=-1) % 1.0).to(noise.dtype)


class SSR(Pass):
    """See `ssr`; the light that surfaces send is `outgoing_light`.

    Frames with one before them send half as many rays, as their histories average them with others. Where the frame's
    light shows sky and lamps in mirrors already (``emitters_mirrored``), smooth metals that show them reflect
    nothing else but what is found on screen.

    Args:
        assumed_thickness: of solids along the view ray, world units, where the frame has no ``thickness``; by default
            estimated, see `post.thickness_from_depth`.
        samples: see `ssr`, as the rest; those of a frame with none before it.
    """

    reads = frozenset({"depth", "hit", "normal", "roughness", "radiance"})
    optional = frozenset(
        {"albedo", "metallic", "normal_geo", "thickness", "object_id", "ambient", "environment"}
        | {"ao", "sky_visibility", "bent_normal", "gi"}
    )
    writes = frozenset({"reflection", "reflection_confidence", "reflection_distance"})
    lacks = MappingProxyType(
        {
            "environment": "mirrors guess the sky from what the picture shows of it",
            "metallic": "metals mirror as little as plastic",
        }
    )

    def __init__(
        self,
        *,
        samples: int = 4,
        steps: int = 64,
        distance: float | None = None,
        assumed_thickness: float | None = None,
        roughness_cutoff: float = 1.0,
        reuse: int = 0,
        method: Method = "ggx",
        bounces: int = 2,
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
        self.bounces = bounces
        self.seed = seed

    def forward(self, frame: Frame) -> Frame:
        g, tunables = frame.gbuffer, self.tunables()
        assumed, roughness = tunables.pop("assumed_thickness"), frame.read("roughness")
        visibility = frame.ao if frame.sky_visibility is None else frame.sky_visibility
        known = {"hit": g.hit, "f0": _f0(frame), "normal_geo": g.normal_geo, "environment": frame.environment}
        known |= {"thickness": known_thickness(g, assumed_thickness=assumed), "index": frame.index}
        known |= {"visibility": visibility, "bent_normal": frame.bent_normal, "metallic": g.metallic}
        samples, light = tunables.pop("samples"), outgoing_light(frame)
        given = partial(ssr, g.depth, g.normal, g.camera, light, roughness, **known, **tunables)
        found = by_history(frame, lambda count: given(samples=count), first=samples, later=-(-samples // 2))
        reflection, confidence, distance = found
        reflection = without_shown(reflection, confidence, frame)
        return frame.replace(reflection=reflection, reflection_confidence=confidence, reflection_distance=distance)


def _f0(frame: Frame) -> Tensor | None:
    g = frame.gbuffer
    return None if g.albedo is None or g.metallic is None else specular_f0(g.albedo, g.metallic)
