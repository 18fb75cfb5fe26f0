"""Reflections as a torch operator: a kernel on the CPU, the torch reference elsewhere and for gradients."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.compute.resident import resident
from post.march.rays import Hierarchy, check_reach, lens_of
from post.shading.fireflies import mean_light
from post.shading.incoming import Picture, border_width
from post.shading.reference import Method, reflect_reference

OPEN = (0.0, 0.0, 0.0, 1.0)  # nothing but the sky lies around


@operator("gbufrt::reflect")
def reflect_cpu(
    planes: Tensor,
    pyramid: Tensor,
    table: Tensor,
    lens: Tensor,
    near: float,
    orthographic: bool,
    rotation: Tensor,
    hit: Tensor,
    depth: Tensor,
    normal: Tensor,
    normal_geo: Tensor,
    roughness: Tensor,
    f0: Tensor,
    metallic: Tensor,
    lit: Tensor,
    sky: Tensor,
    around: Tensor,
    bent_normal: Tensor,
    limit: Tensor,
    noise: Tensor,
    shifts: Tensor,
    bounces: int,
    steps: int,
    distance: float,
    far: float,
    roughness_cutoff: float,
    border: float,
) -> Tensor:
    """``(B, 5, H, W)`` float32: the reflection, its confidence, the distance; see `reflect`.

    Args:
        planes: ``(B, H, W, 4)``, of a `Hierarchy`.
        pyramid: ``(B, N, 2)``, of it too.
        table: ``(levels + 1, 2)`` int64, of it too.
        lens: ``(B, 4)``: focal lengths and principal point in pixels, see `lens_of`.
        near: nearest depth of the camera, world units.
        orthographic: whether its rays are parallel.
        rotation: ``(B, 3, 3)`` from view space to world space.
        hit: ``(B, 1, H, W)`` bool: where there is a surface.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit.
        normal_geo: ``(B, 3, H, W)`` that of the geometry; batch 0 where it is ``normal``.
        roughness: ``(B, 1, H, W)`` perceptual.
        f0: ``(B, 3, H, W)`` reflectance at normal incidence.
        metallic: ``(B, 1, H, W)`` which surfaces rays go on from; batch 0 where they end at the first.
        lit: ``(B, H, W, 4)``: the light that pixels send, and the visibility of the sky there.
        sky: ``(B, h, w, 3)`` or ``(1, h, w, 3)`` linear radiance, lat-long.
        around: ``(B, h, w, 4)`` or ``(1, h, w, 4)``, lat-long: what lies beyond the picture, see `Picture`.
        bent_normal: ``(B, 3, H, W)`` mean open direction, world space; batch 0 where there is none.
        limit: ``(B,)`` luminance that limits fireflies, see `post.shading.fireflies.mean_light`.
        noise: ``(2, H, W)`` in [0, 1): of a pixel's first direction.
        shifts: ``(samples, samples, 2)`` by which each ray shifts the noise, of a pixel that takes 1, 2, ... rays.
        bounces: most times that a ray is marched.
        steps: pixels that a ray may be compared with.
        distance: how far a ray goes, world units.
        far: distance of what hits nothing, world units.
        roughness_cutoff: perceptual roughness above which rays are trusted less.
        border: pixels from the picture's border over which hits fade.
    """
    from post.shading.drivers import reflect_each

    batch, _, height, width = depth.shape
    out = depth.new_empty(batch, 5, height, width)
    view = (planes, pyramid, table, lens, near, orthographic, rotation)
    channels = (hit, depth, normal, normal_geo, roughness, f0, metallic, lit, sky, around, bent_normal, limit)
    rays = (noise, shifts, bounces, steps, distance, far, roughness_cutoff, border)
    reflect_each(batch * height * width, out, *view, *channels, *rays)
    return out


@reflect_cpu.register_fake
def _(planes, pyramid, table, lens, near, orthographic, rotation, hit, depth, *rest):
    return depth.new_empty(depth.shape[0], 5, *depth.shape[2:])


def reflect(
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
    compiled: bool | None = None,
) -> Tensor:
    """Follow each pixel's rays, and average what they bring.

    Args:
        picture: what reflects and what is reflected.
        hierarchy: of its depth.
        camera: of the picture.
        noise: ``(2, H, W)`` in [0, 1).
        shifts: ``(samples, samples, 2)`` of the noise, for each ray of a pixel that takes 1, 2, ... rays.
        steps: see `post.ssr`, as the rest.
        distance: how far rays go, world units.
        bounces: see `post.ssr`.
        roughness_cutoff: see `post.ssr`.
        reuse: see `post.ssr`; neighbours' rays are reused by the reference alone.
        method: see `post.ssr`; the kernel knows GGX alone.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 5, H, W)``: reflection, its confidence, and the distance to what is reflected.

    Raises:
        ValueError: steps or distance is not positive, or a kernel is requested where there is none.
    """
    check_reach(steps, distance)
    options = {"steps": steps, "distance": distance, "bounces": bounces, "roughness_cutoff": roughness_cutoff}
    if compiled and (reuse or method != "ggx"):
        raise ValueError(f"compiled must be None or False for reuse={reuse}, method={method!r}: there is no kernel")
    plain = not reuse and method == "ggx"
    form = form_of(
        *picture, hierarchy.planes, noise, roughness_cutoff, compiled=compiled if plain else False, cuda=True
    )
    if form is Form.REFERENCE:
        return reflect_reference(picture, hierarchy, camera, noise, shifts, reuse=reuse, method=method, **options)
    depth, visibility, environment, around = picture.depth, picture.visibility, picture.environment, picture.around
    light = _full(picture.light, 3, depth)
    known = torch.ones_like(depth) if visibility is None else torch.where(picture.hit, visibility, 1.0)
    none = depth.new_empty(0, 3, *camera.size)
    bent_normal = None if visibility is None else picture.bent_normal
    return reflect_cpu(
        *hierarchy,
        lens_of(camera).float(),
        float(camera.near),
        camera.orthographic,
        camera.world_from_view[:, :3, :3].to(depth).contiguous(),
        _full(picture.hit, 1, depth),
        depth,
        _full(picture.normal, 3, depth),
        none if picture.normal_geo is None else _full(picture.normal_geo, 3, depth),
        _full(picture.roughness, 1, depth),
        _full(picture.f0, 3, depth),
        none[:, :1] if picture.metallic is None else _full(picture.metallic, 1, depth),
        torch.cat([light, known], dim=1).movedim(1, -1),
        depth.new_zeros(1, 1, 1, 3) if environment is None else environment.movedim(1, -1),
        depth.new_zeros(1, 1, 1, 4) + resident(OPEN, depth) if around is None else around.movedim(1, -1),
        none if bent_normal is None else _full(bent_normal, 3, depth),
        mean_light(light, picture.hit, picture.f0, environment, picture.visibility).flatten(),
        noise,
        shifts,
        int(bounces),
        int(steps),
        float(distance),
        float(camera.far),
        float(roughness_cutoff),
        border_width(camera),
    )


def _full(channel: Tensor, channels: int, depth: Tensor) -> Tensor:
    """A channel at the size of the picture, which the kernel reads without asking."""
    return channel.expand(depth.shape[0], channels, *depth.shape[2:])
