"""The compiled form of `tracer.paths.radiance` and `tracer.paths.diffuse`: one path at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.specular import DIELECTRIC_F0, LAMP_ROUGHNESS
from tracer.cache.kernel import look_up
from tracer.lights.lamp_kernel import lamp_sample
from tracer.lights.lit import DISC, NOTHING
from tracer.lights.samples import DIMS
from tracer.lights.sky_kernel import shines, sky, sky_density, sky_sample, sun, sun_sample
from tracer.paths.diffuse import EVEN
from tracer.paths.interaction import FINE, MOST_PASS
from tracer.paths.interaction_kernel import WHITE, intersect, transmit
from tracer.paths.on_screen_kernel import back_project, sees
from tracer.paths.radiance import MORE, SURVIVAL
from tracer.paths.surfaces.response import LEAST_ALPHA, RARELY
from tracer.sampling.scatter_kernel import (
    added,
    along,
    cosine_direction,
    directional_albedo,
    dot,
    fresnel,
    sample_specular,
    scaled,
    specular_response,
    times,
)
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW
from tracer.traversal.rays import FARTHEST


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
    """Reflectance x cosine: diffuse with albedo ``even``, and specular if it ``mirrors``."""
    value = scaled(even, max(dot(at.normal, direction), 0.0) / math.pi)
    if not mirrors:
        return value
    alpha = max(at.roughness * at.roughness, LEAST_ALPHA)
    return added(value, specular_response(at.normal, at.toward, alpha, f0_of(at), direction))


@scalar
def direct(tables, at, u, i, first, even, mirrors_sun, mirrors_lamps):
    """Direct light from the sun and from one lamp; see `tracer.paths.interaction.direct`."""
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
    """See `tracer.paths.diffuse.gathered`."""
    total, through = NOTHING, WHITE
    for bounce in range(bounces):
        through = times(through, diffuse_of(at))
        total = added(total, times(through, direct(tables, at, u, i, first, WHITE, False, False)))
        direction = cosine_direction(at.normal, u[first + DIMS, i], u[first + DIMS + 1, i])
        if bounce == bounces - 1:
            passed = transmit(tables, at.point, direction, FARTHEST, MASK_SECONDARY)
            if max(passed) > 0:
                total = added(total, times(times(through, passed), sky(tables.lit, direction)))
            break
        number = u[first + DIMS + 2, i]
        isect = _go_on(tables, at, direction, number)
        through = times(through, isect.weight)
        if isect.t == np.inf:
            total = added(total, times(through, sky(tables.lit, direction)))
            break
        at = isect.surface
        first += EVEN
    return total


@scalar
def _go_on(tables, at, direction, number):
    mask = MASK_SECONDARY
    return intersect(tables, at.point, direction, number, at.inside, mask, 0.0, FARTHEST, MOST_PASS, FINE, False)


@scalar
def arriving(tables, camera, picture, isect, known, direction, u, i, first, bounces, next_event, sees_sun, sees_lamps):
    """See `tracer.paths.radiance.arriving`; ``known`` is 1 where the first surface is on screen, else 0."""
    lit = tables.lit
    total, onscreen, through, density = NOTHING, NOTHING, WHITE, 0.0
    sharp = lit.sky[DISC, 0]
    for bounce in range(bounces + 2):
        through = times(through, isect.weight)
        if isect.t == np.inf:
            share = 1.0
            if density > 0 and len(lit.sky_upto):
                share = density / (density + sky_density(lit, direction))
            light = scaled(sky(lit, direction), share)
            if sees_sun and shines(lit):
                light = added(light, sun(lit, direction))
            light = times(through, light)
            return added(total, light), along(onscreen, light, known)
        at = isect.surface
        if bounce and known > 0:
            point, normal = back_project(camera, at.point, at.normal, at.instance)
            known = 1.0 if sees(camera, picture, point, normal) else 0.0
        light = at.emission if sees_lamps else NOTHING
        sharp_sun, sharp_lamp = at.roughness * at.roughness < sharp, at.roughness < LAMP_ROUGHNESS
        if next_event and bounce <= bounces:
            light = added(light, direct(tables, at, u, i, first, _diffuse_share(at), not sharp_sun, not sharp_lamp))
            if len(lit.sky_upto):
                light = added(light, _from_sky(tables, at, u[first + DIMS + 5, i], u[first + DIMS + 6, i]))
        light = times(through, light)
        total, onscreen = added(total, light), along(onscreen, light, known)
        if bounce > bounces:
            break
        direction, factor, density = _scattered(at, u[first + DIMS, i], u[first + DIMS + 1, i], u[first + DIMS + 2, i])
        sees_sun = (density == 0 and sharp_sun) or not next_event
        sees_lamps = (density == 0 and sharp_lamp) or not next_event
        density = density if next_event else 0.0
        through = times(through, factor)
        most = max(through)
        chance = min(max(most, SURVIVAL), 1.0) if bounce else 1.0
        if not (most > 0 and u[first + DIMS + 3, i] < chance):
            break
        through = scaled(through, 1 / chance)
        isect = _go_on(tables, at, direction, u[first + DIMS + 4, i])
        first += MORE
    return total, onscreen


@scalar
def _diffuse_share(at):
    """Diffuse reflectance toward the eye."""
    return scaled(diffuse_of(at), 1 - directional_albedo(dot(at.normal, at.toward), at.roughness))


@scalar
def _from_sky(tables, at, a, b):
    """Diffuse reflection of the sky, by one shadow ray."""
    diffuse = _diffuse_share(at)
    direction, density = sky_sample(tables.lit, a, b)
    even = max(dot(at.normal, direction), 0.0) / math.pi
    if not (even > 0 and max(diffuse) > 0):
        return NOTHING
    passed = transmit(tables, at.point, direction, FARTHEST, MASK_SECONDARY)
    if not max(passed) > 0:
        return NOTHING
    share = even / (density + (1 - _mirrors(at)) * even)
    return times(scaled(diffuse, share), times(passed, sky(tables.lit, direction)))


@scalar
def _mirrors(at):
    """Probability that a bounce is specular rather than diffuse."""
    diffuse = _diffuse_share(at)
    even = (diffuse[0] + diffuse[1] + diffuse[2]) / 3
    bright = fresnel(f0_of(at), dot(at.normal, at.toward))
    some = (bright[0] + bright[1] + bright[2]) / 3
    return min(max(some / max(some + even, 1e-9), RARELY), 1 - RARELY) if even > 0 else 1.0


@scalar
def _scattered(at, a, b, c):
    """A path's next direction, the factor on the light from there, and its density, 0 if the bounce is specular."""
    chance = _mirrors(at)
    if a >= chance:
        direction = cosine_direction(at.normal, b, c)
        density = (1 - chance) * max(dot(at.normal, direction), 0.0) / math.pi
        return direction, scaled(_diffuse_share(at), 1 / max(1 - chance, 1e-9)), max(density, 1e-12)
    direction, weight, cosine = sample_specular(at.normal, at.toward, at.roughness * at.roughness, b, c)
    return direction, scaled(fresnel(f0_of(at), cosine), weight / chance), 0.0


@scalar
def remembered(tables, cache, camera, picture, isect, direction, u, i, first, bounces, sees_sun, sees_lamps, follows):
    """See `tracer.paths.cached.remembered`; the light, and whether there is a sample, where, facing where, of what."""
    keys, values = cache
    at = isect.surface
    if isect.t == np.inf:
        light, _ = arriving(
            tables, camera, picture, isect, 0.0, direction, u, i, first, bounces, True, sees_sun, sees_lamps
        )
        return light, False, NOTHING, NOTHING, NOTHING
    sharp_sun, sharp_lamp = at.roughness * at.roughness < tables.lit.sky[DISC, 0], at.roughness < LAMP_ROUGHNESS
    even = _diffuse_share(at)
    light = added(
        at.emission if sees_lamps else NOTHING,
        direct(tables, at, u, i, first, even, not sharp_sun, not sharp_lamp),
    )
    cached, known = look_up(keys, values, at.point, at.normal)
    known = known and not follows
    if known:
        light = added(light, times(even, cached))
    direction, factor, density = _scattered(at, u[first + DIMS, i], u[first + DIMS + 1, i], u[first + DIMS + 2, i])
    diffuse, sent = density > 0, NOTHING
    if max(factor) > 0 and not (known and diffuse):
        onward = _go_on(tables, at, direction, u[first + DIMS + 4, i])
        sees_sun, sees_lamps = sharp_sun and not diffuse, sharp_lamp and not diffuse
        sent, _ = arriving(
            tables, camera, picture, onward, 0.0, direction, u, i, first + MORE, bounces - 1, True, sees_sun, sees_lamps
        )
        light = added(light, times(factor, sent))
    sampled = diffuse and not known and max(factor) > 0
    return times(isect.weight, light), sampled, at.point, at.normal, sent
