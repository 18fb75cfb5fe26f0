"""The compiled form of `tracer.paths.integrators`: one path at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.specular import LAMP_ROUGHNESS
from tracer.lights.kernel import DISC, FACING, NOTHING, lamp_sample, shines, sky, sun_sample
from tracer.lights.samples import DIMS
from tracer.paths.interaction import FINE, MOST_PASS
from tracer.paths.interaction_kernel import WHITE, intersect, transmit
from tracer.paths.on_screen_kernel import sees
from tracer.paths.path_kernel import arriving, diffuse_of, direct, f0_of, from_lamp, gathered
from tracer.paths.radiance import MORE
from tracer.sampling.scatter_kernel import added, cosine_direction, dot, fresnel, sample_specular, scaled, times
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW
from tracer.traversal.kernel import triple
from tracer.traversal.rays import FARTHEST


@scalar
def occlusion(tables, camera, picture, at, u, i, radius):
    """``ao``, ``bent_normal``, ``ao_onscreen``."""
    direction = cosine_direction(at.normal, u[0, i], u[1, i])
    mask = MASK_SECONDARY
    isect = intersect(tables, at.point, direction, u[2, i], at.inside, mask, 0.0, radius, 1.0, FINE, False)
    if isect.t == np.inf:
        return 1.0, direction, 1.0
    return 0.0, NOTHING, 0.0 if sees(camera, picture, isect.surface.point, isect.surface.normal) else 1.0


@scalar
def indirect(tables, camera, picture, at, u, i, bounces):
    """``gi``, ``gi_onscreen``, ``sky``, ``sky_visibility``."""
    direction = cosine_direction(at.normal, u[0, i], u[1, i])
    mask = MASK_SECONDARY
    isect = intersect(tables, at.point, direction, u[2, i], at.inside, mask, 0.0, np.inf, MOST_PASS, FINE, False)
    weight = times(diffuse_of(at), isect.weight)
    if isect.t == np.inf:
        open_ = (isect.weight[0] + isect.weight[1] + isect.weight[2]) / 3
        return NOTHING, NOTHING, times(weight, sky(tables.lit, direction)), open_
    light = times(weight, gathered(tables, isect.surface, u, i, 3, bounces))
    shows = sees(camera, picture, isect.surface.point, isect.surface.normal)
    return light, light if shows else NOTHING, NOTHING, 0.0


@scalar
def lit(tables, at, u, i):
    """``direct``; and ``shadow`` of the sun, and of a lamp."""
    light, by_sun, by_lamp = NOTHING, 0.0, 0.0
    if shines(tables.lit):
        direction, energy = sun_sample(tables.lit, u[0, i], u[1, i])
        light, by_sun = _arriving(tables, at, direction, FARTHEST, energy)
    if len(tables.lit.lamps):
        numbers = (u[2, i], u[3, i], u[4, i], u[5, i])
        direction, distance, energy, _ = lamp_sample(tables.lit, at.point, at.normal, *numbers)
        more, by_lamp = _arriving(tables, at, direction, distance, energy)
        light = added(light, more)
    return times(diffuse_of(at), light), by_sun, by_lamp


@scalar
def _arriving(tables, at, direction, distance, energy):
    """Light that a surface of albedo 1 sends on, and the share of it that is not in shadow."""
    whole = scaled(energy, max(dot(at.normal, direction), 0.0) / math.pi)
    if not max(whole) > 0:
        return NOTHING, 0.0
    light = times(whole, transmit(tables, at.point, direction, distance, MASK_SHADOW))
    return light, (light[0] + light[1] + light[2]) / (whole[0] + whole[1] + whole[2])


@scalar
def reflected(tables, camera, picture, at, u, i, sharp):
    """``reflection``, ``reflection_onscreen``; and ``onscreen``, ``distance``, ``flies``, ``ends``."""
    direction, weight, cosine = sample_specular(at.normal, at.toward, at.roughness * at.roughness, u[0, i], u[1, i])
    rough = at.roughness >= sharp
    light, onscreen = NOTHING, NOTHING
    if rough and len(tables.lit.lamps):
        light, place, lamp = from_lamp(tables, at, u, i, 5, NOTHING, True)
        if max(light) > 0 and sees(camera, picture, place, triple(tables.lit.lamps, lamp, FACING)):
            onscreen = light
    if not weight > 0:
        return light, onscreen, (0.0, 0.0, 0.0, 0.0)
    mask = MASK_SECONDARY
    isect = intersect(tables, at.point, direction, u[2, i], at.inside, mask, 0.0, np.inf, MOST_PASS, FINE, False)
    factor = times(scaled(fresnel(f0_of(at), cosine), weight), isect.weight)
    if isect.t == np.inf:
        return added(light, times(factor, sky(tables.lit, direction))), onscreen, (0.0, 0.0, 1.0, 0.0)
    sent = gathered(tables, isect.surface, u, i, 3 + DIMS, 1)
    if not rough:
        sent = added(sent, isect.surface.emission)
    sent = times(factor, sent)
    shows = sees(camera, picture, isect.surface.point, isect.surface.normal)
    onscreen = added(onscreen, times(sent, WHITE if shows else NOTHING))
    return added(light, sent), onscreen, (1.0 if shows else 0.0, isect.t, 1.0, 1.0)


@scalar
def lobes(tables, camera, picture, at, u, i, bounces):
    """``indirect``, ``specular``; and ``distance``, ``flies``, ``ends`` of the specular ray."""
    direction = cosine_direction(at.normal, u[0, i], u[1, i])
    mask = MASK_SECONDARY
    isect = intersect(tables, at.point, direction, u[2, i], at.inside, mask, 0.0, np.inf, MOST_PASS, FINE, False)
    rest = bounces - 1
    light = arriving(tables, camera, picture, isect, 0.0, direction, u, i, 3, rest, True, False, False)[0]
    even = scaled(light, (1 - at.metallic) * at.opacity)
    first, alpha = 3 + MORE * bounces, at.roughness * at.roughness
    sharp_sun, sharp_lamp = alpha < tables.lit.sky[DISC, 0], at.roughness < LAMP_ROUGHNESS
    light = direct(tables, at, u, i, first + 3, NOTHING, not sharp_sun, not sharp_lamp)
    direction, weight, cosine = sample_specular(at.normal, at.toward, alpha, u[first, i], u[first + 1, i])
    if not weight > 0:
        return even, light, (0.0, 0.0, 0.0)
    number, onward = u[first + 2, i], first + 3 + DIMS
    isect = intersect(tables, at.point, direction, number, at.inside, mask, 0.0, np.inf, MOST_PASS, FINE, False)
    sent = arriving(tables, camera, picture, isect, 0.0, direction, u, i, onward, rest, True, sharp_sun, sharp_lamp)[0]
    light = added(light, times(scaled(fresnel(f0_of(at), cosine), weight), sent))
    if isect.t == np.inf:
        return even, light, (0.0, 1.0, 0.0)
    return even, light, (isect.t, 1.0, 1.0)
