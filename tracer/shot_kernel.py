"""The compiled form of `tracer.shots` and of `tracer.seen`: one path at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.kernel import scalar
from tracer.light_kernel import FACING, NOTHING, sky
from tracer.light_samples import DIMS
from tracer.meet_kernel import WHITE, meet
from tracer.path_kernel import diffuse_of, f0_of, from_lamp, gathered
from tracer.paths import FINE, MOST_PASS
from tracer.scatter_kernel import added, along, cosine_direction, dot, fresnel, mirrored, scaled, times
from tracer.scene import MASK_SECONDARY
from tracer.seen import EDGE_ON, NEIGHBORS, SLACK
from tracer.walk_kernel import triple

VIEW, FOCAL, CENTER, JITTER, POSITION, FORWARD, ORTHOGRAPHIC, SIZE = 0, 12, 14, 16, 18, 21, 24, 25
"""Where in the flat numbers of a camera they begin: view from world, row by row, and so on."""
DEPTH, NORMAL, POINT = 0, 1, 4
"""Columns of a picture."""


@scalar
def _view(camera, point, w):
    x = camera[0] * point[0] + camera[1] * point[1] + camera[2] * point[2] + camera[3] * w
    y = camera[4] * point[0] + camera[5] * point[1] + camera[6] * point[2] + camera[7] * w
    z = camera[8] * point[0] + camera[9] * point[1] + camera[10] * point[2] + camera[11] * w
    return x, y, z


@scalar
def sees(camera, picture, point, normal):
    """See `tracer.seen.Picture.sees`."""
    flat = camera[ORTHOGRAPHIC] > 0
    place = (camera[POSITION], camera[POSITION + 1], camera[POSITION + 2])
    toward = along(point, place, -1.0)
    if flat:
        toward = (camera[FORWARD], camera[FORWARD + 1], camera[FORWARD + 2])
    at = _view(camera, point, 1.0)
    if dot(toward, normal) >= 0 or at[2] <= 0:
        return False
    z = 1.0 if flat else max(at[2], 1e-9)
    x = at[0] / z * camera[FOCAL] + camera[CENTER] - camera[JITTER]
    y = at[1] / z * camera[FOCAL + 1] + camera[CENTER + 1] - camera[JITTER + 1]
    height, width = int(camera[SIZE]), int(camera[SIZE + 1])
    if not (0 <= x < width and 0 <= y < height):
        return False
    slack = SLACK * z / camera[FOCAL + 1]
    for dy, dx in NEIGHBORS:
        row = min(max(int(y) + dy, 0), height - 1) * width + min(max(int(x) + dx, 0), width - 1)
        if abs(picture[row, DEPTH] - at[2]) < slack or _on_plane(picture, row, at, slack, flat):
            return True
    return False


@scalar
def _on_plane(picture, row, at, slack, flat):
    if not math.isfinite(picture[row, DEPTH]):
        return False
    normal = triple(picture, row, NORMAL)
    off = dot(along(at, triple(picture, row, POINT), -1.0), normal)
    lean = abs(normal[2]) if flat else abs(dot(normal, scaled(at, 1 / max(at[2], 1e-9))))
    return lean > EDGE_ON and abs(off) < slack * lean


@scalar
def occlusion(tables, camera, picture, at, u, i, radius):
    """``ao``, ``bent_normal``, ``ao_seen``."""
    direction = cosine_direction(at.normal, u[0, i], u[1, i])
    mask = MASK_SECONDARY
    met = meet(tables, at.point, direction, u[2, i], at.inside, mask, 0.0, radius, 1.0, FINE, False)
    if met.t == np.inf:
        return 1.0, direction, 1.0
    return 0.0, NOTHING, 0.0 if sees(camera, picture, met.surface.point, met.surface.normal) else 1.0


@scalar
def indirect(tables, camera, picture, at, u, i, bounces):
    """``gi``, ``gi_seen``, ``sky``, ``sky_visibility``."""
    direction = cosine_direction(at.normal, u[0, i], u[1, i])
    mask = MASK_SECONDARY
    met = meet(tables, at.point, direction, u[2, i], at.inside, mask, 0.0, np.inf, MOST_PASS, FINE, False)
    weight = times(diffuse_of(at), met.weight)
    if met.t == np.inf:
        open_ = (met.weight[0] + met.weight[1] + met.weight[2]) / 3
        return NOTHING, NOTHING, times(weight, sky(tables.lit, direction)), open_
    light = times(weight, gathered(tables, met.surface, u, i, 3, bounces))
    shows = sees(camera, picture, met.surface.point, met.surface.normal)
    return light, light if shows else NOTHING, NOTHING, 0.0


@scalar
def reflected(tables, camera, picture, at, u, i, sharp):
    """``reflection``, ``reflection_seen``; and ``seen``, ``distance``, ``flies``, ``ends``."""
    direction, weight, cosine = mirrored(at.normal, at.toward, at.roughness * at.roughness, u[0, i], u[1, i])
    rough = at.roughness >= sharp
    light, seen = NOTHING, NOTHING
    if rough and len(tables.lit.lamps):
        light, place, lamp = from_lamp(tables, at, u, i, 5, NOTHING, True)
        if max(light) > 0 and sees(camera, picture, place, triple(tables.lit.lamps, lamp, FACING)):
            seen = light
    if not weight > 0:
        return light, seen, (0.0, 0.0, 0.0, 0.0)
    mask = MASK_SECONDARY
    met = meet(tables, at.point, direction, u[2, i], at.inside, mask, 0.0, np.inf, MOST_PASS, FINE, False)
    factor = times(scaled(fresnel(f0_of(at), cosine), weight), met.weight)
    if met.t == np.inf:
        return added(light, times(factor, sky(tables.lit, direction))), seen, (0.0, 0.0, 1.0, 0.0)
    sent = gathered(tables, met.surface, u, i, 3 + DIMS, 1)
    if not rough:
        sent = added(sent, met.surface.emission)
    sent = times(factor, sent)
    shows = sees(camera, picture, met.surface.point, met.surface.normal)
    seen = added(seen, times(sent, WHITE if shows else NOTHING))
    return added(light, sent), seen, (1.0 if shows else 0.0, met.t, 1.0, 1.0)
