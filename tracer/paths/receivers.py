"""Surfaces of a G-buffer as the starts of paths, and means over the paths from each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt import GBuffer
from tracer.direct.lighting import batched, lifted
from tracer.lights.samples import Lights
from tracer.paths.interaction import Vertices
from tracer.paths.on_screen import Picture
from tracer.sampling.progressive import WIDE, Estimate, Progress, Truth, Values, converge
from tracer.sampling.sequence import Sequence
from tracer.scene.scene import MASK_SECONDARY, Scene
from tracer.traversal.rays import transmission

NEAR = 1e-4  # world units to look ahead for the material that a surface lies in


@dataclass(frozen=True, eq=False, kw_only=True)
class Receivers:
    """What one picture of a batch shows.

    Args:
        pixels: ``(M,)`` numbers of those that show a surface.
        vertices: the M surfaces.
        picture: what the camera shows.
        poses: ``(I, 4, 4)`` of the instances.
        lights: that shine on them.
    """

    pixels: Tensor
    vertices: Vertices
    picture: Picture
    poses: Tensor
    lights: Lights


Integrand = Callable[[Receivers, Vertices, Tensor], Values]
"""Takes a picture, N of its surfaces and numbers ``(D, K * N)`` in [0, 1). Returns what K paths from each of
them found, ``(K * N, C)`` each: the first path of every surface, then the second of every surface, and so on."""


def receivers_of(scene: Scene, gbuffer: GBuffer, poses: Tensor | None) -> list[Receivers]:
    """All pictures of a batch.

    Raises:
        ValueError: the poses do not fit, or there is no albedo.
    """
    if gbuffer.albedo is None:
        raise ValueError("gbuffer must have albedo to be lit; it has " + ", ".join(gbuffer.present))
    poses = batched(poses, gbuffer.batch, len(scene.instances))
    camera = gbuffer.camera
    points, toward = lifted(gbuffer), camera.rotate_to_world(camera.to_eye(gbuffer.points_view()))
    one, none = torch.ones_like(gbuffer.depth), torch.zeros_like(gbuffer.depth)
    planes = {
        "points": points,
        "normals": gbuffer.normal,
        "outward": gbuffer.normal if gbuffer.normal_geo is None else gbuffer.normal_geo,
        "toward": toward,
        "albedo": gbuffer.albedo,
        "emission": torch.zeros_like(gbuffer.albedo) if gbuffer.emission is None else gbuffer.emission,
        "roughness": one if gbuffer.roughness is None else gbuffer.roughness,
        "metallic": none if gbuffer.metallic is None else gbuffer.metallic,
        "opacity": one if gbuffer.opacity is None else gbuffer.opacity,
        "instances": none if gbuffer.object_id is None else gbuffer.object_id,
    }
    found = []
    for b in range(gbuffer.batch):
        pixels = gbuffer.hit[b].flatten().nonzero()[:, 0]
        rows = {name: plane[b].flatten(1)[:, pixels].T.contiguous().float() for name, plane in planes.items()}
        for name in ("roughness", "metallic", "opacity", "instances"):
            rows[name] = rows[name][:, 0]
        rows["instances"] = rows["instances"].int()
        inside = _inside(scene, rows["points"], rows.pop("outward"), poses[b])
        found.append(
            Receivers(
                pixels=pixels,
                vertices=Vertices(inside=inside, **rows),
                picture=Picture.of(gbuffer, b),
                poses=poses[b],
                lights=Lights.of(scene, poses[b]),
            )
        )
    return found


def _inside(scene: Scene, points: Tensor, normals: Tensor, poses: Tensor) -> Tensor:
    """``(N,)`` bool: which points lie within a transmissive material: it dims a short ray along the normal."""
    if not bool((scene.materials.opacity[1:] < 1).any()):
        return torch.zeros_like(points[:, 0], dtype=torch.bool)
    passed = transmission(scene, points, normals, poses=poses, mask=MASK_SECONDARY, t_max=NEAR)
    return (passed.amin(dim=1) < 1) & (passed.amax(dim=1) > 0)


def at_each_pixel(
    gbuffer: GBuffer,
    receivers: list[Receivers],
    integrand: Integrand,
    *,
    dims: int,
    samples: int,
    noise: float,
    seed: int,
    progress: Progress | None,
) -> Truth:
    """Means of what paths from every pixel's surface find; 0 where there is no surface. See `converge`."""
    size = gbuffer.camera.size
    if samples < 1:
        raise ValueError(f"samples must be at least 1, got {samples}")
    sequence = Sequence.of(samples, dims, size, seed=seed, device=gbuffer.camera.device)
    pixels = max(len(r.pixels) for r in receivers)
    return converge(
        _estimate(receivers, integrand, sequence, size),
        samples=samples,
        noise=noise,
        pixels=pixels,
        wanted=gbuffer.hit,
        progress=progress,
    )


def _estimate(receivers: list[Receivers], integrand: Integrand, sequence: Sequence, size: tuple[int, int]) -> Estimate:
    def estimate(numbers: range) -> Values:
        pictures = [sums_of(at, integrand, sequence, numbers, size) for at in receivers]
        return {name: torch.stack([p[name] for p in pictures]) for name in pictures[0]}

    return estimate


def sums_of(at: Receivers, integrand: Integrand, sequence: Sequence, numbers: range, size: tuple[int, int]) -> Values:
    """``(C, H, W)`` sums over samples, for one picture."""
    count = len(numbers)
    sums: Values = {}
    step = max(1, WIDE // count)
    for begin in range(0, max(1, len(at.pixels)), step):
        part = slice(begin, begin + step)
        pixels = at.pixels[part]
        found = integrand(at, at.vertices[part], sequence.draw(numbers, pixels))
        for name, value in found.items():
            if name not in sums:
                sums[name] = value.new_zeros(size[0] * size[1], value.shape[1])
            sums[name][pixels] = value.view(count, len(pixels), value.shape[1]).sum(dim=0)
    return {name: value.T.reshape(-1, *size) for name, value in sums.items()}
