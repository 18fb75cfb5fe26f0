"""The compiled form of `tracer.paths.interaction`: one ray at a time, and the tables of its scene."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.direct.lighting import LIFT, LIFT_RELATIVE
from tracer.lights.lit import NOTHING, Lit
from tracer.lights.shadows import SHORT
from tracer.paths.interaction import FINE, LAYERS, MAX_RUN, MOST_PASS
from tracer.paths.surfaces.texture_kernel import SIDE, size, texel, turned, variation
from tracer.sampling.scatter_kernel import along, dot, enters_smooth, scaled, times
from tracer.scene.scene import MASK_SECONDARY
from tracer.scene.textures import COLOR, GLOW, METAL, ROUGH
from tracer.traversal.kernel import nearest, run_length, transmitted, triple
from tracer.traversal.rays import FARTHEST

OPACITY, TINT, VARIATION = 0, 1, 4
"""Columns of `Tables.materials`."""
WHITE = (1.0, 1.0, 1.0)
OUTSIDE = (-1, 0, (0, 0, 0))


class Tables(NamedTuple):
    """A scene at one time, flat.

    Args:
        transforms: ``(I + 1, 4, 4)`` float64, see `tracer.traversal.op`.
        grids: see `tracer.scene.grids.Grids.tensors`.
        materials: ``(M, 17)`` float32: opacity, tint, variation; and of each face's texture the first row in
            ``texels`` and the side, 0 for none.
        texels: ``(M + T, 10)`` float32: of each material, then those of `tracer.scene.textures.Textures`.
        lit: sun, sky and lamps.
    """

    transforms: np.ndarray
    grids: tuple[np.ndarray, ...]
    materials: np.ndarray
    texels: np.ndarray
    lit: Lit


class Surface(NamedTuple):
    """A place on a surface; see `tracer.paths.surfaces.vertices.Vertices`."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    toward: tuple[float, float, float]
    albedo: tuple[float, float, float]
    roughness: float
    metallic: float
    opacity: float
    emission: tuple[float, float, float]
    inside: bool
    instance: int


class Interaction(NamedTuple):
    """See `tracer.paths.interaction.Interaction`. ``t`` is inf for the sky; the surface then has no meaning."""

    t: float
    weight: tuple[float, float, float]
    surface: Surface


@scalar
def assembled(arrays):
    """`Tables` from their flat arrays: numba passes no nested tuples to its threads."""
    transforms, bricks, index, entries, media, materials, texels = arrays[:7]
    picture, sky, lamps, upto, slots, counts, cells, sky_upto, sky_density = arrays[7:]
    lit = Lit(picture, sky, lamps, upto, slots, counts, cells, sky_upto, sky_density)
    return Tables(transforms, (bricks, index, entries, media), materials, texels, lit)


@scalar
def surface_of(rows, i):
    """One row of what `tracer.paths.tables.surfaces_of` packs."""
    return Surface(
        triple(rows, i, 0),
        triple(rows, i, 3),
        triple(rows, i, 6),
        triple(rows, i, 9),
        np.float64(rows[i, 12]),
        np.float64(rows[i, 13]),
        np.float64(rows[i, 14]),
        triple(rows, i, 15),
        rows[i, 18] > 0,
        int(rows[i, 19]),
    )


@scalar
def transmit(tables, origin, direction, t_end, mask):
    return transmitted(tables.transforms, tables.grids, origin, direction, 0.0, min(t_end, FARTHEST), mask)


@scalar
def _passing(tables, material, run):
    """The light that comes through a run of a material."""
    row, run = tables.materials[material], max(run, 0.0)
    rest = 1.0 - row[OPACITY]
    return rest * row[TINT] ** run, rest * row[TINT + 1] ** run, rest * row[TINT + 2] ** run


@scalar
def _run(tables, origin, direction, hit):
    t, entry, material, _, back, voxel, _ = hit
    if back:
        return t
    ends = t + MAX_RUN
    return run_length(tables.transforms, tables.grids, origin, direction, t, ends, entry, material, voxel)[1]


@scalar
def normal_of(tables, hit):
    """Normal of the surface that was hit, facing where the ray came from."""
    row, face = tables.transforms[hit[1], hit[3] // 2], hit[3]
    return scaled((row[0], row[1], row[2]), (1 if face % 2 else -1) / size(row))


@scalar
def intersect(tables, origin, direction, u, inside, mask, t_begin, t_end, most, detail, spreads):
    """See `tracer.paths.interaction`."""
    t_end = min(t_end, FARTHEST)
    hit = nearest(tables.transforms, tables.grids, origin, direction, t_begin, t_end, OUTSIDE, mask)
    hit, weight, inside = go_through(tables, hit, origin, direction, u, inside, mask, t_begin, t_end, most)
    return Interaction(hit[0], weight, surface_at(tables, origin, direction, hit, inside, detail, spreads))


@scalar
def reached(tables, hit, at, direction, u):
    """`intersect` for a secondary ray whose first hit is known."""
    origin = at.point
    hit, weight, inside = go_through(
        tables, hit, origin, direction, u, at.inside, MASK_SECONDARY, 0.0, np.inf, MOST_PASS
    )
    return Interaction(hit[0], weight, surface_at(tables, origin, direction, hit, inside, FINE, False))


@scalar
def go_through(tables, hit, origin, direction, u, inside, mask, t_begin, t_end, most):
    """Go on through transmissive surfaces from the first that a ray hits; the last hit, the weight, and whether that
    lies within a transmissive material.
    """
    weight = WHITE
    if inside and hit[1] >= 0 and not hit[4]:
        weight = transmit(tables, origin, direction, max(hit[0] - SHORT, 0.0), mask)
    for _ in range(LAYERS):
        t, entry, material, _, back, voxel, _ = hit
        if entry < 0 or tables.materials[material, OPACITY] >= 1:
            break
        run = _run(tables, origin, direction, hit)
        passed, enters_here = _passing(tables, material, run), enters_smooth(-dot(normal_of(tables, hit), direction))
        share = min(enters_here * (passed[0] + passed[1] + passed[2]) / 3, most)
        if u >= share:
            weight = scaled(weight, 1 / (1 - share))
            break
        u /= share
        left = (entry, material, voxel)
        hit = nearest(tables.transforms, tables.grids, origin, direction, max(t_begin, t), t_end, left, mask)
        run = run if back else min(run, hit[0] - t)
        weight = scaled(times(weight, _passing(tables, material, run)), enters_here / share)
        inside = not back and run >= hit[0] - t - SHORT
    return hit, weight, inside


@inlined
def place_at(tables, origin, direction, hit, detail):
    """Where a ray hits: point and normal, see `tracer.paths.surfaces.vertices.Vertices`; the row of ``texels`` that
    shows there, that of the material unless its face has a texture; and the pixels that a voxel spans.
    """
    t, entry, material, face, _, _, _ = hit
    flat, scale, row = normal_of(tables, hit), 1 / size(tables.transforms[entry, face // 2]), material
    pixels, normal = detail * math.sqrt(max(abs(dot(flat, direction)), 1e-3)), flat
    if tables.materials[material, SIDE + face] > 0:
        row = texel(tables.materials, hit, scale, pixels)
        normal = turned(tables.transforms[entry], face, flat, direction, tables.texels[row])
    lift = LIFT + LIFT_RELATIVE * t
    return along(along(origin, direction, t), along(flat, direction, -1.0), lift), normal, row, pixels * scale


@scalar
def surface_at(tables, origin, direction, hit, inside, detail, spreads):
    """See `tracer.paths.interaction.intersect`."""
    t, entry, material, face, _, voxel, place = hit
    if entry < 0:
        return Surface(origin, NOTHING, NOTHING, NOTHING, 0.0, 0.0, 0.0, NOTHING, False, 0)
    if spreads:
        detail = detail / max(t, 1e-9)
    point, normal, row, pixels = place_at(tables, origin, direction, hit, detail)
    tone = 1.0
    if not tables.materials[material, SIDE + face] > 0:
        tone += tables.materials[material, VARIATION] * variation(voxel, place, face, entry, pixels)
    albedo = scaled(triple(tables.texels, row, COLOR), tone)
    return Surface(
        point,
        normal,
        scaled(direction, -1.0),
        (min(max(albedo[0], 0.0), 1.0), min(max(albedo[1], 0.0), 1.0), min(max(albedo[2], 0.0), 1.0)),
        np.float64(tables.texels[row, ROUGH]),
        np.float64(tables.texels[row, METAL]),
        np.float64(tables.materials[material, OPACITY]),
        triple(tables.texels, row, GLOW),
        inside,
        entry,
    )
