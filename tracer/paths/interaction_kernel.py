"""The compiled form of `tracer.paths.interaction`: one ray at a time, and the tables of its scene."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbufrt.compute.kernel import scalar
from tracer.direct.lighting import LIFT, LIFT_RELATIVE
from tracer.lights.kernel import NOTHING, Lit
from tracer.lights.shadows import SHORT
from tracer.paths.interaction import LAYERS, MAX_RUN
from tracer.sampling.scatter_kernel import (
    along,
    dot,
    enters_smooth,
    scaled,
    times,
)
from tracer.texture import OCTAVES
from tracer.traversal.kernel import nearest, run_length, transmitted, triple
from tracer.traversal.rays import FARTHEST

ALBEDO, ROUGHNESS, METALLIC, OPACITY, EMISSION, VARIATION, TINT = 0, 3, 4, 5, 6, 9, 10
"""Columns of `Tables.materials`."""
WHITE = (1.0, 1.0, 1.0)
OUTSIDE = (-1, 0, (0, 0, 0))


class Tables(NamedTuple):
    """A scene at one time, flat.

    Args:
        transforms: ``(I + 1, 4, 4)`` float64, see `tracer.traversal.op`.
        grids: see `tracer.scene.grids.Grids.tensors`.
        materials: ``(M, 13)`` float32.
        scales: ``(I + 1,)`` float64, world units a voxel.
        lit: sun, sky and lamps.
    """

    transforms: np.ndarray
    grids: tuple[np.ndarray, ...]
    materials: np.ndarray
    scales: np.ndarray
    lit: Lit


class Surface(NamedTuple):
    """A place on a surface; see `tracer.paths.interaction.Vertices`."""

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
    transforms, bricks, index, entries, media, materials, scales = arrays[:7]
    picture, sky, lamps, upto, slots, counts, cells, sky_upto, sky_density = arrays[7:]
    lit = Lit(picture, sky, lamps, upto, slots, counts, cells, sky_upto, sky_density)
    return Tables(transforms, (bricks, index, entries, media), materials, scales, lit)


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
def _normal(tables, hit):
    """Normal of the surface that was hit, facing where the ray came from."""
    row, face = tables.transforms[hit[1], hit[3] // 2], hit[3]
    size = math.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2])
    return scaled((row[0], row[1], row[2]), (1 if face % 2 else -1) / size)


@scalar
def intersect(tables, origin, direction, u, inside, mask, t_begin, t_end, most, detail, spreads):
    """See `tracer.paths.interaction`."""
    t_end = min(t_end, FARTHEST)
    hit = nearest(tables.transforms, tables.grids, origin, direction, t_begin, t_end, OUTSIDE, mask)
    weight = WHITE
    if inside and hit[1] >= 0 and not hit[4]:
        weight = transmit(tables, origin, direction, max(hit[0] - SHORT, 0.0), mask)
    for _ in range(LAYERS):
        t, entry, material, _, back, voxel, _ = hit
        if entry < 0 or tables.materials[material, OPACITY] >= 1:
            break
        run = _run(tables, origin, direction, hit)
        passed, enters_here = _passing(tables, material, run), enters_smooth(-dot(_normal(tables, hit), direction))
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
    return Interaction(hit[0], weight, _surface(tables, origin, direction, hit, inside, detail, spreads))


@scalar
def _surface(tables, origin, direction, hit, inside, detail, spreads):
    t, entry, material, face, _, voxel, place = hit
    if entry < 0:
        return Surface(origin, NOTHING, NOTHING, NOTHING, 0.0, 0.0, 0.0, NOTHING, False, 0)
    normal = _normal(tables, hit)
    if spreads:
        detail = detail / max(t, 1e-9)
    facing = math.sqrt(max(abs(dot(normal, direction)), 1e-3))
    strays = _variation(voxel, place, face, entry, detail * tables.scales[entry] * facing)
    tone = 1 + tables.materials[material, VARIATION] * strays
    albedo = scaled(triple(tables.materials, material, ALBEDO), tone)
    return Surface(
        along(along(origin, direction, t), along(normal, direction, -1.0), LIFT + LIFT_RELATIVE * t),
        normal,
        scaled(direction, -1.0),
        (min(max(albedo[0], 0.0), 1.0), min(max(albedo[1], 0.0), 1.0), min(max(albedo[2], 0.0), 1.0)),
        np.float64(tables.materials[material, ROUGHNESS]),
        np.float64(tables.materials[material, METALLIC]),
        np.float64(tables.materials[material, OPACITY]),
        triple(tables.materials, material, EMISSION),
        inside,
        entry,
    )


@scalar
def _variation(voxel, place, face, entry, pixels):
    """See `tracer.texture.variation`."""
    key = voxel[0] * 73856093 + voxel[1] * 19349663 + voxel[2] * 83492791 + (face + 6 * entry) * 2654435761
    key, axis = _mix(key), face // 2
    u = place[0] - voxel[0] if axis != 0 else place[1] - voxel[1]
    v = place[2] - voxel[2] if axis != 2 else place[1] - voxel[1]
    u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
    total = 0.0
    for side, amplitude in OCTAVES:
        onscreen = min(max((pixels / side - 0.75) / 1.25, 0.0), 1.0)
        cell = min(int(u * side), side - 1) * side + min(int(v * side), side - 1)
        number = _mix(key + (cell + 64 * side) * 668265263)
        total += amplitude * onscreen * (number * (2.0 / 0xFFFFFFFF) - 1.0)
    return total


@scalar
def _mix(value):
    value = value & 0xFFFFFFFF
    value = ((value ^ (value >> 16)) * 0x7FEB352D) & 0xFFFFFFFF
    value = ((value ^ (value >> 15)) * 0x846CA68B) & 0xFFFFFFFF
    return value ^ (value >> 16)
