"""Surfaces of a G-buffer as the starts of paths, and means over the paths from each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.resident import places, waits
from gbufrt.numeric import check_counts
from tracer.direct.lighting import batched, ray_origins
from tracer.lights.samples import Lights
from tracer.paths.on_screen import Picture
from tracer.paths.surfaces.vertices import Vertices
from tracer.sampling.progressive import WIDE, Progress, Truth, Values, converge
from tracer.sampling.sequence import Sequence
from tracer.scene.checks import check_shown
from tracer.scene.scene import MASK_SECONDARY, Scene
from tracer.traversal.rays import transmission

NEAR = 1e-4  # world units to look ahead for the material that a surface lies in


@dataclass(frozen=True, eq=False, kw_only=True)
class Receivers:
    """What one picture of a batch shows.

    Args:
        pixels: ``(M,)`` numbers of those that show a surface; where the host would wait for their number, those of all
            else come after them.
        shows: ``(M,)`` bool, whether they show a surface; None where all of them do.
        places: ``(6, M)``, the points and normals of the M surfaces, see `Vertices`.
        surfaces: makes all else that is known of the surfaces.
        picture: what the camera shows.
        poses: ``(I, 4, 4)`` of the instances.
        lights: that shine on them.
    """

    pixels: Tensor
    shows: Tensor | None = None
    places: Tensor
    surfaces: Callable[[], Vertices]
    picture: Picture
    poses: Tensor
    lights: Lights

    @cached_property
    def vertices(self) -> Vertices:
        """The M surfaces."""
        return self.surfaces()

    def found(self, rows: Tensor) -> Tensor:
        """Sums ``(C, M)`` over paths, 0 where there is no surface."""
        return rows if self.shows is None else torch.where(self.shows, rows, 0.0)


Integrand = Callable[[Vertices, Tensor], Values]
"""Takes N surfaces and numbers ``(D, K * N)`` in [0, 1). Returns what K paths from each of them found, ``(K * N, C)``
each: the first path of every surface, then the second of every surface, and so on."""
Sums = Callable[[Receivers, Sequence], Values]
"""Takes a picture, and points for paths from each of its M surfaces. Returns sums of what these found, ``(C, M)``."""


def receivers_of(scene: Scene, gbuffer: GBuffer, poses: Tensor | None, lights: Lights | None = None) -> list[Receivers]:
    """All pictures of a batch. Where they have the same ``lights``, these may be given, which take a while to make.

    Raises:
        ValueError: the poses do not fit, or there is no albedo.
    """
    check_shown(scene, gbuffer)
    if gbuffer.albedo is None:
        raise ValueError("gbuffer must have albedo to be lit; it has " + ", ".join(gbuffer.present))
    poses = batched(poses, gbuffer.batch, len(scene.instances))
    points, found = ray_origins(scene, gbuffer), []
    for b in range(gbuffer.batch):
        hit = gbuffer.hit[b].flatten()
        (pixels,) = places(hit)
        shows = hit[pixels] if waits(hit) else None
        at = torch.cat([points[b].flatten(1)[:, pixels], gbuffer.normal[b].flatten(1)[:, pixels]]).float()
        found.append(
            Receivers(
                pixels=pixels,
                shows=shows,
                places=at,
                surfaces=partial(_surfaces, scene, gbuffer, b, pixels, at, poses[b]),
                picture=Picture.of(gbuffer, b),
                poses=poses[b],
                lights=Lights.of(scene, poses[b]) if lights is None else lights,
            )
        )
    return found


def _surfaces(scene: Scene, gbuffer: GBuffer, b: int, pixels: Tensor, at: Tensor, poses: Tensor) -> Vertices:
    """Of picture ``b``, the surfaces at ``at`` ``(6, M)``."""
    camera = gbuffer.camera
    one, none = torch.ones_like(gbuffer.depth), torch.zeros_like(gbuffer.depth)
    planes = {
        "outward": gbuffer.normal if gbuffer.normal_geo is None else gbuffer.normal_geo,
        "toward": camera.rotate_to_world(camera.to_eye(gbuffer.points_view())),
        "albedo": gbuffer.albedo,
        "emission": torch.zeros_like(gbuffer.normal) if gbuffer.emission is None else gbuffer.emission,
        "roughness": one if gbuffer.roughness is None else gbuffer.roughness,
        "metallic": none if gbuffer.metallic is None else gbuffer.metallic,
        "opacity": one if gbuffer.opacity is None else gbuffer.opacity,
        "instances": none if gbuffer.object_id is None else gbuffer.object_id,
    }
    rows = {name: plane[b].flatten(1)[:, pixels].T.contiguous().float() for name, plane in planes.items()}
    for name in ("roughness", "metallic", "opacity", "instances"):
        rows[name] = rows[name][:, 0]
    rows["instances"] = rows["instances"].int()
    rows["points"], rows["normals"] = (part.T.contiguous() for part in at.split(3))
    return Vertices(inside=_inside(scene, rows["points"], rows.pop("outward"), poses), **rows)


def _inside(scene: Scene, points: Tensor, normals: Tensor, poses: Tensor) -> Tensor:
    """``(N,)`` bool: which points lie within a transmissive material: it dims a short ray along the normal."""
    if not scene.materials.transmissive:
        return torch.zeros_like(points[:, 0], dtype=torch.bool)
    passed = transmission(scene, points, normals, poses=poses, mask=MASK_SECONDARY, t_max=NEAR)
    return (passed.amin(dim=1) < 1) & (passed.amax(dim=1) > 0)


def at_each_pixel(
    gbuffer: GBuffer,
    receivers: list[Receivers],
    sums: Sums,
    *,
    dims: int,
    samples: int,
    noise: float,
    seed: int,
    progress: Progress | None,
) -> Truth:
    """Means of what paths from every pixel's surface find; 0 where there is no surface. See `converge`."""
    size = gbuffer.camera.size
    check_counts(samples=samples)
    if samples < 1:
        raise ValueError(f"samples must be at least 1, got {samples}")
    sequence = Sequence.of(samples, dims, size, seed=seed, device=gbuffer.camera.device)

    def estimate(numbers: range) -> Values:
        some = sequence.part(numbers)
        pictures = [sums(at, some) for at in receivers]
        return {name: torch.cat([p[name] for p in pictures], dim=1) for name in pictures[0]}

    pixels = sum(len(at.pixels) for at in receivers)
    found = converge(estimate, samples=samples, noise=noise, pixels=pixels, progress=progress)
    values, error = (
        {name: placed(rows, receivers, size) for name, rows in parts.items()} for parts in (found.values, found.error)
    )
    return Truth(values=values, error=error, samples=found.samples)


def placed(rows: Tensor, receivers: list[Receivers], size: tuple[int, int]) -> Tensor:
    """``(B, C, H, W)`` with the rows ``(C, M)`` of all pictures at their pixels, and 0 elsewhere."""
    pictures = rows.new_zeros(len(receivers), len(rows), size[0] * size[1])
    for picture, at, own in zip(
        pictures, receivers, rows.split([len(at.pixels) for at in receivers], dim=1), strict=True
    ):
        picture[:, at.pixels] = own
    return pictures.view(len(receivers), -1, *size)


def summed(integrand: Integrand, at: Receivers, start: Vertices, sequence: Sequence) -> Values:
    """See `Sums`: with what one path finds as its definition."""
    count, sums = len(sequence.points), list[Values]()
    step = max(1, WIDE // count)
    for begin in range(0, max(1, len(at.pixels)), step):
        part = slice(begin, begin + step)
        found = integrand(start[part], sequence.draw(at.pixels[part]))
        sums.append({name: x.view(count, -1, x.shape[1]).sum(dim=0).T for name, x in found.items()})
    return {name: at.found(torch.cat([part[name] for part in sums], dim=1)) for name in sums[0]}
