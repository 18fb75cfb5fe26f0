"""What mirrors show, as a G-buffer: the surface that is reflected, where its virtual image lies.

A plane mirror is a window onto the mirrored world. What it shows has a depth, a normal, an albedo and a motion of its
own, and filters and histories treat it as they treat surfaces seen directly.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.compute.resident import waits
from gbufrt.sampling import gather
from gbufrt.specular import VIRTUAL_ROUGHNESS
from post.history.reproject import motion_of
from post.march.rays import Hits, depth_hierarchy, march_rays
from post.mirrors.curvature import curved_motion, normals_before, tightly_curved
from post.shading.ggx import grazing, specular_f0
from post.sweep.chords import known_thickness

SMOOTH = 0.15  # perceptual roughness below which a metal shows an image
METAL = 0.5  # metalness above which the image is all that a surface shows
GRAZING = 1e-3  # least cosine between a mirror's normal and the direction to the eye
STEPS = 128


class Image(NamedTuple):
    """What mirrors show, and what the other pixels show themselves."""

    gbuffer: GBuffer
    """As the one given, with the virtual images of reflected surfaces in the pixels of mirrors: depth, normals, object
    and motion."""
    mask: Tensor
    """``(B, 1, H, W)`` bool: the pixels of mirrors."""
    follows: Tensor
    """``(B, 1, H, W)`` bool: mirrors, and metals that curve tightly. These keep the geometry of their own, because
    edges of so small an image tell a filter of pixels nothing; their motion is that of what they show."""
    albedo: Tensor
    """``(B, 3, H, W)`` in mirrors, Fresnel reflectance times the albedo of what is reflected; of what is not on screen
    that is 1."""
    reflectance: Tensor
    """``(B, 3, H, W)``: Fresnel's, by Schlick."""
    emission: Tensor
    """``(B, 3, H, W)`` in mirrors, linear radiance that what is reflected emits, times the reflectance."""
    facing: Tensor
    """``(B, 3, H, W)`` world space: normals of the surfaces that show an image's motion, zero elsewhere."""


def mirror_image(
    g: GBuffer,
    previous: Camera | None = None,
    polished: Tensor | None = None,
    before: Tensor | None = None,
    tight: Tensor | None = None,
) -> Image | None:
    """Replace smooth metals, and other mirrors, by what they reflect, as far as the picture tells.

    One ray a pixel finds it. Where a ray leaves the picture or goes behind something, the image is taken to lie on a
    plane parallel to the mirror, as deep behind it as the other images of the picture are on average: neighbours are
    then of one surface, so that filters may average them. Curved mirrors are treated as their tangent planes, but for
    the motion of what they show.

    Args:
        g: of the frame.
        previous: camera of the frame before; by default the G-buffer's. Without one, motion stays as it is.
        polished: ``(B, 1, H, W)`` bool: mirrors that are no metals.
        before: ``(B, 3, H, W)`` `Image.facing` of the frame before, to tell which mirrors turned.
        tight: what `tight_metals` finds, where it is known already.

    Returns:
        The image, or None where there is no mirror, as far as the host knows without waiting for a GPU.
    """
    if g.roughness is None or g.metallic is None or g.albedo is None:
        return None
    tight = tight_metals(g) if tight is None else tight
    mask = g.hit & (g.roughness < SMOOTH) & (g.metallic > METAL) & ~tight
    mask = mask if polished is None else mask | polished
    follows = mask | tight
    if not (waits(follows) or bool(follows.any())):
        return None
    camera, points = g.camera, g.points_view()
    eye, facing = camera.to_eye(points), camera.rotate_to_view(g.normal)
    away = _mirrored(-eye, facing)
    found = _first_hits(g, points, torch.where(follows, away, 0.0))
    column, row = (found.px[:, k].floor() for k in (0, 1))
    distance = _image_distances(found, follows, (eye * facing).sum(1, keepdim=True), camera.far)
    virtual = points - eye * distance

    def shown(channel: Tensor) -> Tensor:
        return gather(channel, column, row)

    changed = {"depth": virtual[:, 2:]}
    for name in ("normal", "normal_geo"):
        if (normal := getattr(g, name)) is not None:
            seen = camera.rotate_to_world(_mirrored(camera.rotate_to_view(shown(normal)), facing))
            changed[name] = torch.where(found.hit, seen, g.normal)
    if g.object_id is not None:
        changed["object_id"] = torch.where(found.hit, shown(g.object_id), g.object_id)
    previous = g.previous_camera if previous is None else previous
    if g.motion is not None and previous is not None:
        moved = _moved(g, previous, points)
        own, centers = motion_of(g, previous)[0], camera.pixel_centers(dtype=points.dtype)
        was = camera.to_world(points + away * distance) + torch.where(found.hit, shown(moved), 0.0)
        turned = normals_before(g.normal, before, centers + own)
        was = previous.to_view(_mirrored_at(was, camera.to_world(points) + moved, turned))
        flat = previous.project(was) - centers
        changed["motion"] = curved_motion(flat, own, follows, distance, points, facing, camera)
        if g.motion_z is not None:
            changed["motion_z"] = was[:, 2:] - virtual[:, 2:]
    f0 = specular_f0(g.albedo, g.metallic)
    reflectance = f0 + (1 - f0) * grazing((eye * facing).sum(1, keepdim=True))
    emission = torch.zeros_like(reflectance) if g.emission is None else torch.where(found.hit, shown(g.emission), 0.0)
    masks = {name: follows if name == "motion" else mask for name in changed}
    return Image(
        g.replace(**{name: torch.where(masks[name], new, getattr(g, name)) for name, new in changed.items()}),
        mask,
        follows,
        reflectance * torch.where(found.hit, shown(g.albedo), 1.0),
        reflectance,
        reflectance * emission,
        torch.where(follows, g.normal, 0.0),
    )


def tight_metals(g: GBuffer) -> Tensor:
    """``(B, 1, H, W)`` bool: metals that show an image, sharp or not, and curve tightly; none where it is not told."""
    if g.roughness is None or g.metallic is None:
        return torch.zeros_like(g.hit)
    shiny = g.hit & (g.metallic > METAL) & (g.roughness <= VIRTUAL_ROUGHNESS)
    return tightly_curved(g.normal, shiny)


def _first_hits(g: GBuffer, origins: Tensor, directions: Tensor) -> Hits:
    normal = g.normal if g.normal_geo is None else g.normal_geo
    hierarchy = depth_hierarchy(g.depth, normal, g.camera, hit=g.hit, thickness=known_thickness(g))
    return march_rays(hierarchy, origins, directions, g.camera, steps=STEPS, distance=g.camera.far)


def _image_distances(found: Hits, mask: Tensor, cosine: Tensor, far: float) -> Tensor:
    """``(B, 1, H, W)`` world units along the ray; those of unknown images lead to the mean depth behind the mirrors.

    Rays that end behind something are not taken to be right one by one, but their mean is. In a picture in which none
    of the rays finds anything the depth is ``far``.
    """
    cosine = cosine.clamp_min(GRAZING)
    distance = found.distance.to(cosine)
    known = mask & (found.hit | found.blocked)
    count = known.sum((1, 2, 3), keepdim=True)
    mean = torch.where(known, distance * cosine, 0.0).sum((1, 2, 3), keepdim=True) / count.clamp_min(1)
    return torch.where(found.hit, distance, torch.where(count > 0, mean, far) / cosine)


def _moved(g: GBuffer, previous: Camera, points: Tensor) -> Tensor:
    """``(B, 3, H, W)`` world space: from where each pixel's surface is to where it was; 0 for the sky."""
    motion, motion_z = motion_of(g, previous)
    px = g.camera.pixel_centers(dtype=points.dtype) + motion
    was = previous.to_world(previous.unproject(g.depth + motion_z, px))
    return torch.where(g.hit, was - g.camera.to_world(points), 0.0)


def _mirrored(vectors: Tensor, normal: Tensor) -> Tensor:
    """Directions after reflection by a plane with this normal."""
    return vectors - 2 * (vectors * normal).sum(1, keepdim=True) * normal


def _mirrored_at(points: Tensor, place: Tensor, normal: Tensor) -> Tensor:
    """Points after reflection by the plane through ``place``."""
    return place + _mirrored(points - place, normal)
