"""The compiled form of `tracer.paths.shots`: one path at a time."""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import scalar
from tracer.lights.kernel import FACING, NOTHING, sky
from tracer.lights.samples import DIMS
from tracer.paths.meet import FINE, MOST_PASS
from tracer.paths.meet_kernel import WHITE, meet
from tracer.paths.path_kernel import diffuse_of, f0_of, from_lamp, gathered
from tracer.paths.seen_kernel import sees
from tracer.sampling.scatter_kernel import added, cosine_direction, fresnel, mirrored, scaled, times
from tracer.scene.scene import MASK_SECONDARY
from tracer.traversal.kernel import triple


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
