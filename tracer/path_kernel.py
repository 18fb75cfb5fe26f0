"""The compiled form of `tracer.light_paths`: a path at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.kernel import scalar
from tracer.light_kernel import DISC, NOTHING, lamp_sample, shines, sky, sun, sun_sample
from tracer.light_paths import EVEN, LEAST_ALPHA, MORE, RARELY, SHARP_LAMP, SURVIVAL
from tracer.light_samples import DIMS
from tracer.meet_kernel import WHITE, meet, transmit
from tracer.paths import DIELECTRIC_F0, FINE, MOST_PASS
from tracer.scatter_kernel import (
    added,
    along,
    cosine_direction,
    dot,
    fresnel,
    mirrored,
    scaled,
    specular_response,
    times,
)
from tracer.scene import MASK_SECONDARY, MASK_SHADOW
from tracer.traversal import FARTHEST


@scalar
def diffuse_of(at):
    return scaled(at.albedo, (1 - at.metallic) * at.opacity)


@scalar
def f0_of(at):
    some = at.metallic
    return (
        DIELECTRIC_F0 + (at.albedo[0] - DIELECTRIC_F0) * some,
        DIELECTRIC_F0 + (at.albedo[1] - DIELECTRIC_F0) * some,
        DIELECTRIC_F0 + (at.albedo[2] - DIELECTRIC_F0) * some,
    )


@scalar
def _response(at, direction, even, mirrors):
    """Reflectance x cosine: ``even`` the share that is scattered evenly, and the mirrored one if it ``mirrors``."""
    value = scaled(even, max(dot(at.normal, direction), 0.0) / math.pi)
    if not mirrors:
        return value
    alpha = max(at.roughness * at.roughness, LEAST_ALPHA)
    return added(value, specular_response(at.normal, at.toward, alpha, f0_of(at), direction))


@scalar
def _direct(tables, at, u, i, first, even, mirrors_sun, mirrors_lamps):
    """Light straight from the sun and from one lamp; see `tracer.paths.direct`."""
    lit, light = tables.lit, NOTHING
    if shines(lit):
        direction, energy = sun_sample(lit, u[first, i], u[first + 1, i])
        value = times(_response(at, direction, even, mirrors_sun), energy)
        if max(value) > 0:
            light = times(value, transmit(tables, at.point, direction, FARTHEST, MASK_SHADOW))
    if len(lit.lamps):
        light = added(light, from_lamp(tables, at, u, i, first + 2, even, mirrors_lamps)[0])
    return light


@scalar
def from_lamp(tables, at, u, i, first, even, mirrors):
    """Light from one lamp, the place where it comes from, and the lamp's number (-1 for none)."""
    numbers = (u[first, i], u[first + 1, i], u[first + 2, i], u[first + 3, i])
    direction, distance, energy, lamp = lamp_sample(tables.lit, at.point, at.normal, *numbers)
    place = along(at.point, direction, distance)
    if lamp >= 0 and max(energy) > 0:
        value = times(_response(at, direction, even, mirrors), energy)
        if max(value) > 0:
            return times(value, transmit(tables, at.point, direction, distance, MASK_SHADOW)), place, lamp
    return NOTHING, place, lamp


@scalar
def gathered(tables, at, u, i, first, bounces):
    """See `tracer.light_paths.gathered`."""
    total, through = NOTHING, WHITE
    for bounce in range(bounces):
        through = times(through, diffuse_of(at))
        total = added(total, times(through, _direct(tables, at, u, i, first, WHITE, False, False)))
        direction = cosine_direction(at.normal, u[first + DIMS, i], u[first + DIMS + 1, i])
        if bounce == bounces - 1:
            passed = transmit(tables, at.point, direction, FARTHEST, MASK_SECONDARY)
            if max(passed) > 0:
                total = added(total, times(times(through, passed), sky(tables.lit, direction)))
            break
        number = u[first + DIMS + 2, i]
        met = _go_on(tables, at, direction, number)
        through = times(through, met.weight)
        if met.t == np.inf:
            total = added(total, times(through, sky(tables.lit, direction)))
            break
        at = met.surface
        first += EVEN
    return total


@scalar
def _go_on(tables, at, direction, number):
    mask = MASK_SECONDARY
    return meet(tables, at.point, direction, number, at.inside, mask, 0.0, FARTHEST, MOST_PASS, FINE, False)


@scalar
def radiance(tables, met, direction, u, i, first, bounces, next_event):
    """See `tracer.light_paths.radiance`."""
    lit = tables.lit
    total, through, sees_sun, sees_lamps = NOTHING, WHITE, True, True
    sharp = lit.sky[DISC, 0]
    for bounce in range(bounces + 2):
        through = times(through, met.weight)
        if met.t == np.inf:
            light = sky(lit, direction)
            if sees_sun and shines(lit):
                light = added(light, sun(lit, direction))
            return added(total, times(through, light))
        at = met.surface
        if sees_lamps:
            total = added(total, times(through, at.emission))
        if bounce > bounces:
            break
        sharp_sun, sharp_lamp = at.roughness * at.roughness < sharp, at.roughness < SHARP_LAMP
        if next_event:
            light = _direct(tables, at, u, i, first, diffuse_of(at), not sharp_sun, not sharp_lamp)
            total = added(total, times(through, light))
        direction, factor, mirrors = _scattered(at, u[first + DIMS, i], u[first + DIMS + 1, i], u[first + DIMS + 2, i])
        sees_sun = (mirrors and sharp_sun) or not next_event
        sees_lamps = (mirrors and sharp_lamp) or not next_event
        through = times(through, factor)
        most = max(through)
        chance = min(max(most, SURVIVAL), 1.0) if bounce else 1.0
        if not (most > 0 and u[first + DIMS + 3, i] < chance):
            break
        through = scaled(through, 1 / chance)
        met = _go_on(tables, at, direction, u[first + DIMS + 4, i])
        first += MORE
    return total


@scalar
def _scattered(at, a, b, c):
    """Where a path goes on, the factor on the light from there, and whether that was mirrored."""
    diffuse, f0 = diffuse_of(at), f0_of(at)
    even = (diffuse[0] + diffuse[1] + diffuse[2]) / 3
    bright = fresnel(f0, dot(at.normal, at.toward))
    some = (bright[0] + bright[1] + bright[2]) / 3
    chance = min(max(some / max(some + even, 1e-9), RARELY), 1 - RARELY) if even > 0 else 1.0
    if a >= chance:
        return cosine_direction(at.normal, b, c), scaled(diffuse, 1 / max(1 - chance, 1e-9)), False
    direction, weight, cosine = mirrored(at.normal, at.toward, at.roughness * at.roughness, b, c)
    return direction, scaled(fresnel(f0, cosine), weight / chance), True
