"""The compiled paths over many rays at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numba import prange
from torch import Tensor

from gbufrt.kernel import array, checksum, driver, threads
from tracer import (
    grids,
    lamp_table,
    light_kernel,
    light_paths,
    light_samples,
    lighting,
    meet_kernel,
    path_kernel,
    paths,
    scatter_kernel,
    scene,
    shadows,
    sky,
    spherical_rectangle,
    texture,
    walk_kernel,
)
from tracer.light_samples import Lights
from tracer.path_tables import arrays_of
from tracer.paths import FINE, MOST_PASS, Met, Vertices
from tracer.scene import MASK_PRIMARY, Scene
from tracer.walk_kernel import triple

ROWS = 64  # rays handed out at a time
COLUMNS = {
    "points": 3,
    "normals": 3,
    "toward": 3,
    "albedo": 3,
    "roughness": 1,
    "metallic": 1,
    "opacity": 1,
    "emission": 3,
    "inside": 1,
}
"""Of `Vertices`, side by side."""
WIDTH = sum(COLUMNS.values())


def _compiled(sources: int) -> tuple[Any, ...]:
    """The drivers, compiled anew when ``sources`` change; see `gbufrt.kernel`."""

    @driver
    def meet_all(arrays, rays, u, inside, mask, most, spreads, lanes, ends, surfaces):
        origins, directions, spans = rays
        for lane in prange(lanes):
            tables = meet_kernel.assembled(arrays)
            for begin in range(lane * ROWS, len(origins), lanes * ROWS):
                for i in range(begin, min(begin + ROWS, len(origins))):
                    origin, direction = triple(origins, i, 0), triple(directions, i, 0)
                    t0, t1, detail = triple(spans, i, 0)
                    met = meet_kernel.meet(
                        tables, origin, direction, u[i], inside[i], mask, t0, t1, most, detail, spreads
                    )
                    ends[i, 0] = met.t
                    ends[i, 1], ends[i, 2], ends[i, 3] = met.weight
                    at, row = met.surface, surfaces[i]
                    row[0], row[1], row[2] = at.point
                    row[3], row[4], row[5] = at.normal
                    row[6], row[7], row[8] = at.toward
                    row[9], row[10], row[11] = at.albedo
                    row[12], row[13], row[14] = at.roughness, at.metallic, at.opacity
                    row[15], row[16], row[17] = at.emission
                    row[18] = 1.0 if at.inside else 0.0
        return sources

    @driver
    def gathered_all(arrays, surfaces, u, bounces, lanes, light):
        for lane in prange(lanes):
            tables = meet_kernel.assembled(arrays)
            for begin in range(lane * ROWS, len(surfaces), lanes * ROWS):
                for i in range(begin, min(begin + ROWS, len(surfaces))):
                    at = meet_kernel.surface_of(surfaces, i)
                    light[i, 0], light[i, 1], light[i, 2] = path_kernel.gathered(tables, at, u, i, 0, bounces)
        return sources

    @driver
    def lamps_all(arrays, surfaces, u, lanes, light, places, facing):
        for lane in prange(lanes):
            tables = meet_kernel.assembled(arrays)
            for begin in range(lane * ROWS, len(surfaces), lanes * ROWS):
                for i in range(begin, min(begin + ROWS, len(surfaces))):
                    found, place, normal = path_kernel.mirrored_lamp(tables, meet_kernel.surface_of(surfaces, i), u, i)
                    light[i, 0], light[i, 1], light[i, 2] = found
                    places[i, 0], places[i, 1], places[i, 2] = place
                    facing[i, 0], facing[i, 1], facing[i, 2] = normal
        return sources

    @driver
    def radiance_all(arrays, rays, u, mask, spreads, bounces, next_event, lanes, light):
        origins, directions, spans = rays
        for lane in prange(lanes):
            tables = meet_kernel.assembled(arrays)
            for begin in range(lane * ROWS, len(origins), lanes * ROWS):
                for i in range(begin, min(begin + ROWS, len(origins))):
                    origin, direction = triple(origins, i, 0), triple(directions, i, 0)
                    t0, t1, detail = triple(spans, i, 0)
                    met = meet_kernel.meet(
                        tables, origin, direction, u[0, i], False, mask, t0, t1, MOST_PASS, detail, spreads
                    )
                    found = path_kernel.radiance(tables, met, direction, u, i, 1, bounces, next_event)
                    light[i, 0], light[i, 1], light[i, 2] = found
        return sources

    return meet_all, gathered_all, lamps_all, radiance_all


SOURCES = (walk_kernel, scatter_kernel, light_kernel, meet_kernel, path_kernel)
NUMBERS = (
    grids,
    lamp_table,
    light_paths,
    light_samples,
    lighting,
    paths,
    scene,
    shadows,
    sky,
    spherical_rectangle,
    texture,
)
"""Modules whose constants are compiled in."""
meet_all, gathered_all, lamps_all, radiance_all = _compiled(checksum(*SOURCES, *NUMBERS))


def meet(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    poses: Tensor,
    inside: Tensor | None,
    mask: int,
    t_max: Tensor | float,
    most: float,
) -> Met:
    """See `tracer.paths.meet`."""
    ends, surfaces = torch.empty(len(origins), 4), torch.empty(len(origins), WIDTH)
    inside = torch.zeros(len(origins), dtype=torch.bool) if inside is None else inside
    rays = _rays(origins, directions, 0.0, t_max, FINE)
    arrays, lanes = arrays_of(scene, poses), threads()
    meet_all(arrays, rays, array(u), array(inside), mask, most, False, lanes, array(ends), array(surfaces))
    hit = ends[:, 0].isfinite()
    rows = hit.nonzero()[:, 0]
    return Met(hit=hit, weight=ends[:, 1:], distance=ends[:, 0], rows=rows, surface=_unpacked(surfaces[rows]))


def gathered(scene: Scene, lights: Lights, start: Vertices, u: Tensor, bounces: int, poses: Tensor) -> Tensor:
    """See `tracer.light_paths.gathered`."""
    light = torch.empty(len(start), 3)
    gathered_all(arrays_of(scene, poses, lights), array(_packed(start)), array(u), bounces, threads(), array(light))
    return light


def mirrored_lamps(
    scene: Scene, lights: Lights, at: Vertices, u: Tensor, poses: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """See `tracer.light_paths.mirrored_lamps`."""
    found = torch.empty(len(at), 3), torch.empty(len(at), 3), torch.empty(len(at), 3)
    surfaces = array(_packed(at))
    lamps_all(arrays_of(scene, poses, lights), surfaces, array(u), threads(), *(array(f) for f in found))
    return found


def radiance(
    scene: Scene,
    lights: Lights,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    bounces: int,
    poses: Tensor,
    t_min: Tensor | float,
    t_max: Tensor | float,
    detail: Tensor | float,
    spreads: bool,
    next_event: bool,
) -> Tensor:
    """See `tracer.light_paths.radiance`."""
    light = torch.empty(len(origins), 3)
    rays = _rays(origins, directions, t_min, t_max, detail)
    radiance_all(
        arrays_of(scene, poses, lights),
        rays,
        array(u),
        MASK_PRIMARY,
        spreads,
        bounces,
        next_event,
        threads(),
        array(light),
    )
    return light


def _packed(vertices: Vertices) -> Tensor:
    """``(N, WIDTH)`` float32."""
    return torch.cat([getattr(vertices, name).reshape(-1, width).float() for name, width in COLUMNS.items()], dim=1)


def _unpacked(rows: Tensor) -> Vertices:
    """The opposite of `_packed`."""
    parts = dict(zip(COLUMNS, rows.split(list(COLUMNS.values()), dim=1), strict=True))
    flat = {name: part if COLUMNS[name] > 1 else part[:, 0] for name, part in parts.items()}
    return Vertices(**flat | {"inside": flat["inside"] > 0})


def _rays(
    origins: Tensor, directions: Tensor, t_min: Tensor | float, t_max: Tensor | float, detail: Tensor | float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Origins, directions, and where they begin, end, and their detail, ``(N, 3)`` each."""
    columns = [torch.as_tensor(x, dtype=torch.float32).expand(len(origins)) for x in (t_min, t_max, detail)]
    return array(origins.float()), array(directions.float()), array(torch.stack(columns, dim=1))
