"""Steps of many light paths at once: intersections of rays, and direct light from sun and lamps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.specular import DIELECTRIC_F0, schlick
from tracer.direct.lighting import LIFT, LIFT_RELATIVE
from tracer.lights.samples import Lights, LightSample
from tracer.lights.shadows import SHORT
from tracer.paths.surfaces.vertices import Vertices
from tracer.sampling.scatter import dot
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW, Scene
from tracer.texture import look
from tracer.traversal.hits import Hits
from tracer.traversal.rays import run_lengths, trace, transmission

LAYERS = 16  # transmissive surfaces that a ray goes through at most
MOST_PASS = 0.95  # so that a transmissive surface shows itself to at least one ray in twenty
MAX_RUN = 64.0  # world units of one transmissive material beyond which it dims no further
FINE = 1e9  # pixels a voxel: all detail of the colour


@dataclass(frozen=True, eq=False, kw_only=True)
class Interaction:
    """What N rays hit.

    Args:
        hit: ``(N,)`` bool: a surface, else the sky.
        weight: ``(N, 3)`` factor on the light from there.
        distance: ``(N,)``, inf for the sky.
        rows: ``(M,)`` numbers of the rays that hit.
        surface: the M places that they hit.
    """

    hit: Tensor
    weight: Tensor
    distance: Tensor
    rows: Tensor
    surface: Vertices


def intersect(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    poses: Tensor,
    inside: Tensor | None = None,
    mask: int = MASK_SECONDARY,
    t_min: Tensor | float = 0.0,
    t_max: Tensor | float = torch.inf,
    most: float = MOST_PASS,
    detail: Tensor | float = FINE,
    spreads: bool = False,
) -> Interaction:
    """Trace each ray to the one surface, or the sky, that it shows.

    A ray passes straight through a transmissive surface with the probability that light does, and otherwise shows the
    surface's own share. So a ray stays one ray, and the mean over rays is transmittance x what is behind + what the
    surface sends. Transmitted light excludes what a smooth surface reflects.

    Args:
        scene: what is there.
        origins: ``(N, 3)`` world space.
        directions: ``(N, 3)`` world space, unit length.
        u: ``(N,)`` in [0, 1): whether to pass through.
        poses: ``(I, 4, 4)`` of the instances.
        inside: ``(N,)`` bool: which rays begin within a transmissive material; by default none.
        mask: which instances rays can hit.
        t_min: where rays begin.
        t_max: where rays end; nothing farther is hit.
        most: greatest probability of passing through a surface.
        detail: ``(N,)`` pixels that a world unit spans, for the detail of colours; by default all of it.
        spreads: ``detail`` is that at distance 1 and falls with the distance, rather than the same everywhere.

    Returns:
        See `Interaction`.
    """
    given = {"poses": poses, "mask": mask, "t_max": t_max}
    hits = trace(scene, origins, directions, t_min=t_min, **given)
    weight = torch.ones_like(origins)
    inside = torch.zeros_like(hits.hit) if inside is None else inside.clone()
    begun = (inside & hits.hit & ~hits.back_face).nonzero()[:, 0]
    if len(begun):
        ends = (hits.t[begun] - SHORT).clamp_min(0)
        way = origins[begun], directions[begun]
        weight[begun] = transmission(scene, *way, poses=poses, mask=mask, t_min=0.0, t_max=ends)
    if bool((scene.materials.opacity[1:] < 1).any()):
        _go_through(scene, origins, directions, u.clone(), hits, weight, inside, most, given)
    rows = hits.hit.nonzero()[:, 0]
    pixels = torch.as_tensor(detail, dtype=hits.t.dtype, device=rows.device).expand_as(hits.t)[rows]
    pixels = pixels / hits.t[rows].clamp_min(1e-9) if spreads else pixels
    surface = _vertices(scene, origins[rows], directions[rows], hits.at(rows), inside[rows], pixels, poses)
    return Interaction(hit=hits.hit, weight=weight, distance=hits.t, rows=rows, surface=surface)


def _go_through(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    hits: Hits,
    weight: Tensor,
    inside: Tensor,
    most: float,
    given: dict,
) -> None:
    """Continue rays through transmissive surfaces; ``hits``, ``weight`` and ``inside`` become those of their ends."""
    table = scene.materials
    rows = (hits.hit & (table.opacity[hits.material.long()] < 1)).nonzero()[:, 0]
    for _ in range(LAYERS):
        if not len(rows):
            return
        first, way = hits.at(rows), (origins[rows], directions[rows])
        which, poses = first.material.long(), given["poses"]
        run = run_lengths(scene, *way, first, poses=poses, cap=MAX_RUN)[1]
        run = torch.where(first.back_face, first.t, run)
        enters = 1 - schlick(dot(first.normal, way[1]).abs(), DIELECTRIC_F0)
        share = (enters * table.passing(which, run).mean(dim=1)).clamp_max(most)
        goes = u[rows] < share
        u[rows] = torch.where(goes, u[rows] / share.clamp_min(1e-12), (u[rows] - share) / (1 - share).clamp_min(1e-12))
        weight[rows[~goes]] /= (1 - share[~goes])[:, None]
        rows, first, which, run = rows[goes], first.at(goes), which[goes], run[goes]
        factor = (enters[goes] / share[goes])[:, None]
        ends = given["t_max"] if not isinstance(given["t_max"], Tensor) else given["t_max"][rows]
        behind = trace(
            scene, origins[rows], directions[rows], poses=poses, mask=given["mask"], t_max=ends, beyond=first
        )
        run = torch.where(first.back_face, run, torch.minimum(run, behind.t - first.t))
        weight[rows] *= table.passing(which, run) * factor
        inside[rows] = ~first.back_face & (run >= behind.t - first.t - SHORT)
        hits.put(rows, behind)
        rows = rows[behind.hit & (table.opacity[behind.material.long()] < 1)]


def _vertices(
    scene: Scene, origins: Tensor, directions: Tensor, hits: Hits, inside: Tensor, pixels: Tensor, poses: Tensor
) -> Vertices:
    """Surfaces where rays hit; ``pixels`` ``(N,)`` a world unit spans there."""
    seen = look(scene, hits, directions, pixels, poses=poses)
    lift = (LIFT + LIFT_RELATIVE * hits.t)[:, None]
    return Vertices(
        points=origins + directions * hits.t[:, None] + (hits.normal - directions) * lift,
        normals=seen.normal,
        toward=-directions,
        albedo=seen.albedo,
        roughness=seen.roughness,
        metallic=seen.metallic,
        opacity=scene.materials.opacity[hits.material.long()],
        emission=seen.emission,
        inside=inside,
        instances=hits.instance,
    )


def direct(
    scene: Scene, lights: Lights, at: Vertices, u: Tensor, respond: Callable[[LightSample], Tensor], *, poses: Tensor
) -> list[tuple[LightSample, Tensor]]:
    """Direct light from sun and lamps, by one shadow ray to each kind.

    Args:
        scene: what may occlude.
        lights: of the scene.
        at: N surfaces.
        u: ``(6, N)`` in [0, 1).
        respond: from a sample, the factor ``(N, 3)`` on its radiance: reflectance x cosine.
        poses: ``(I, 4, 4)`` of the instances.

    Returns:
        For each kind, the sample and the radiance ``(N, 3)`` that it adds.
    """
    found = []
    for sample in lights.sample(at.points, at.normals, u):
        value = respond(sample) * sample.energy
        rows = (value.amax(dim=1) > 0).nonzero()[:, 0]
        way = at.points[rows], sample.direction[rows]
        value[rows] *= transmission(scene, *way, poses=poses, mask=MASK_SHADOW, t_max=sample.distance[rows])
        found.append((sample, value))
    return found
