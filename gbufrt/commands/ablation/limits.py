"""The score of perfect rays that read the picture where they end: the limit of what on-screen data holds.

The rays are the tracer's, so none misses a surface or finds a false one. The remaining error is that of the picture,
which holds each surface's light at one point a pixel.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from gbufrt.commands.ablation.place import Place
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer

TINY = 1e-6  # weight of pixels below which nothing was read
GI_RAYS = 32  # a pixel, in two halves
MIRROR_RAYS = 16

Reads = Callable[[Tensor, Tensor], Tensor]
"""Maps points and normals ``(N, 3)``, world space, to the light ``(N, C)`` that the picture shows there; 0 where it
shows none."""


def exact_gi(place: Place, frame: Frame) -> tuple[Tensor, Tensor]:
    """``gi`` ``(1, 3, H, W)`` from on-screen surfaces, in two independent halves."""
    from post.shading.sent_light import sent_light
    from tracer.paths.interaction import intersect
    from tracer.paths.receivers import receivers_of
    from tracer.sampling.scatter import cosine_direction

    g, poses = frame.gbuffer, place.scene.poses([place.time])
    at = receivers_of(place.scene, g, poses)[0]
    reads = _reader(g, sent_light(frame, thickness=g.thickness), at.picture.sees)

    def half(seed: int) -> Tensor:
        u, light = _numbers(GI_RAYS // 2, 3, len(at.pixels), seed), torch.zeros_like(at.vertices.points)
        for numbers in u:
            directions = cosine_direction(at.vertices.normals, numbers[:2])
            isect = intersect(
                place.scene, at.vertices.points, directions, numbers[2], poses=poses[0], inside=at.vertices.inside
            )
            light[isect.rows] += isect.weight[isect.rows] * reads(isect.surface.points, isect.surface.normals)
        return _picture(at.vertices.diffuse * light / len(u), at.pixels, g.camera.size)

    return half(1), half(2)


def exact_reflections(place: Place, *frames: Frame) -> list[tuple[Tensor, Tensor]]:
    """``reflection`` ``(1, 3, H, W)`` of on-screen surfaces, in two independent halves, for each way to light a frame.

    All have one G-buffer, and are read by the same rays.
    """
    from post.shading.sent_light import outgoing_light
    from tracer.paths.interaction import intersect
    from tracer.paths.receivers import receivers_of
    from tracer.sampling.scatter import fresnel, sample_specular

    poses = place.scene.poses([place.time])
    at, lights = receivers_of(place.scene, frames[0].gbuffer, poses)[0], [outgoing_light(frame) for frame in frames]
    reads, start = _reader(frames[0].gbuffer, torch.cat(lights, dim=1), at.picture.sees), at.vertices

    def half(seed: int) -> Tensor:
        u = _numbers(MIRROR_RAYS // 2, 3, len(at.pixels), seed)
        light = start.points.new_zeros(len(start.points), 3 * len(frames))
        for numbers in u:
            directions, weight, cosine = sample_specular(start.normals, start.toward, start.alpha, numbers[:2])
            isect = intersect(place.scene, start.points, directions, numbers[2], poses=poses[0], inside=start.inside)
            factor = fresnel(start.f0, cosine) * weight[:, None] * isect.weight
            found = reads(isect.surface.points, isect.surface.normals)
            light[isect.rows] += factor[isect.rows].repeat(1, len(frames)) * found
        return _picture(light / len(u), at.pixels, frames[0].gbuffer.camera.size)

    return list(zip(half(1).split(3, dim=1), half(2).split(3, dim=1), strict=True))


def _reader(g: GBuffer, light: Tensor, sees: Callable[[Tensor, Tensor], Tensor]) -> Reads:
    """Reads between pixels, using only those that show the surface that was hit."""
    from tracer.paths.on_screen import SLACK

    camera, (height, width) = g.camera, g.camera.size
    onscreen = torch.cat([light, torch.where(g.hit, g.depth, torch.inf)], dim=1)[0].flatten(1)

    def reads(points: Tensor, normals: Tensor) -> Tensor:
        view = camera.to_view(points.T[None])
        at, z = camera.project(view, jittered=True)[0] - 0.5, view[0, 2]
        first, slack = at.floor(), SLACK / camera.pixels_per_unit(z[None])[0]
        total, weight = points.new_zeros(light.shape[1], len(points)), torch.full_like(z, TINY)
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            x, y = first[0] + dx, first[1] + dy
            pixel = y.long().clamp(0, height - 1) * width + x.long().clamp(0, width - 1)
            *color, depth = onscreen[:, pixel]
            near = (1 - (at[0] - x).abs()) * (1 - (at[1] - y).abs()) * ((depth - z).abs() < slack)
            total, weight = total + near * torch.stack(color), weight + near
        return (total / weight).T * sees(points, normals)[:, None]

    return reads


def _numbers(rays: int, dims: int, count: int, seed: int) -> Tensor:
    """``(rays, dims, count)`` in [0, 1)."""
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(rays, dims, count, generator=generator)


def _picture(values: Tensor, pixels: Tensor, size: tuple[int, int]) -> Tensor:
    flat = values.new_zeros(size[0] * size[1], values.shape[1])
    flat[pixels] = values
    return flat.T.reshape(1, -1, *size)
