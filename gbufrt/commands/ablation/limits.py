"""What perfect rays would score that read the picture where they end: the limit of what a screen holds.

The rays are the tracer's, so that nothing is missed and nothing made up. What error they leave is that of the light
which the picture knows of each surface, at one point a pixel.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from gbufrt.commands.ablation.place import Place
from gbufrt.frame import Frame
from gbufrt.sampling import sample

GI_RAYS = 32  # a pixel, in two halves
MIRROR_RAYS = 16

Reads = Callable[[Tensor, Tensor], Tensor]
"""Points and normals ``(N, 3)``, world space, to the light ``(N, 3)`` that the picture shows there, 0 where it shows
none."""


def exact_gi(place: Place, frame: Frame) -> tuple[Tensor, Tensor]:
    """``gi`` ``(1, 3, H, W)`` of what is on screen in two independent halves."""
    from post.sent_light import sent_light
    from tracer.paths import meet
    from tracer.receivers import receivers_of
    from tracer.scatter import cosine_direction

    g, poses = frame.gbuffer, place.scene.poses([place.time])
    at = receivers_of(place.scene, g, poses)[0]
    reads = _reader(frame, sent_light(frame, thickness=g.thickness), at.picture.sees)

    def half(seed: int) -> Tensor:
        u, light = _numbers(GI_RAYS // 2, 3, len(at.pixels), seed), torch.zeros_like(at.vertices.points)
        for numbers in u:
            directions = cosine_direction(at.vertices.normals, numbers[:2])
            met = meet(
                place.scene, at.vertices.points, directions, numbers[2], poses=poses[0], inside=at.vertices.inside
            )
            light[met.rows] += met.weight[met.rows] * reads(met.surface.points, met.surface.normals)
        return _picture(at.vertices.diffuse * light / len(u), at.pixels, g.camera.size)

    return half(1), half(2)


def exact_reflection(place: Place, frame: Frame) -> Tensor:
    """``reflection`` ``(1, 3, H, W)`` of what is on screen."""
    from post.ssr import outgoing_light
    from tracer.paths import meet
    from tracer.receivers import receivers_of
    from tracer.scatter import fresnel, mirrored

    poses = place.scene.poses([place.time])
    at = receivers_of(place.scene, frame.gbuffer, poses)[0]
    reads, start = _reader(frame, outgoing_light(frame), at.picture.sees), at.vertices
    light = torch.zeros_like(start.points)
    for numbers in _numbers(MIRROR_RAYS, 3, len(at.pixels), 1):
        directions, weight, cosine = mirrored(start.normals, start.toward, start.alpha, numbers[:2])
        met = meet(place.scene, start.points, directions, numbers[2], poses=poses[0], inside=start.inside)
        factor = fresnel(start.f0, cosine) * weight[:, None] * met.weight
        light[met.rows] += factor[met.rows] * reads(met.surface.points, met.surface.normals)
    return _picture(light / MIRROR_RAYS, at.pixels, frame.gbuffer.camera.size)


def _reader(frame: Frame, light: Tensor, sees: Callable[[Tensor, Tensor], Tensor]) -> Reads:
    camera = frame.gbuffer.camera

    def reads(points: Tensor, normals: Tensor) -> Tensor:
        px = camera.project(camera.to_view(points.T[None]), jittered=True)
        return sample(light, px[:, :, None])[0, :, 0].T * sees(points, normals)[:, None]

    return reads


def _numbers(rays: int, dims: int, count: int, seed: int) -> Tensor:
    """``(rays, dims, count)`` in [0, 1)."""
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(rays, dims, count, generator=generator)


def _picture(values: Tensor, pixels: Tensor, size: tuple[int, int]) -> Tensor:
    flat = values.new_zeros(size[0] * size[1], 3)
    flat[pixels] = values
    return flat.T.reshape(1, 3, *size)
