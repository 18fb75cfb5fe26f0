"""The compiled form of `tracer.paths.radiance` and `tracer.paths.diffuse`: one path at a time."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from gbufrt.specular import LAMP_ROUGHNESS
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
from tracer.paths.surfaces.response_kernel import diffuse_of, diffuse_share, response, scattered, specular_chance
from tracer.paths.waiting_kernel import arrive, send, send_to_sky
from tracer.sampling.scatter_kernel import (
    added,
    along,
    cosine_direction,
    dot,
    scaled,
    times,
)
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW
from tracer.traversal.rays import FARTHEST


@scalar
def direct(tables, at, u, i, first, even, mirrors_sun, mirrors_lamps):
    """Direct light from the sun and from one lamp; see `tracer.paths.interaction.direct`."""
    lit, light = tables.lit, NOTHING
    if shines(lit):
        direction, value = _unblocked_sun(tables, at, u, i, first, even, mirrors_sun)
        if max(value) > 0:
            light = times(value, transmit(tables, at.point, direction, FARTHEST, MASK_SHADOW))
    if len(lit.lamps):
        direction, distance, value, _ = unblocked_lamp(tables, at, u, i, first + 2, even, mirrors_lamps)
        if max(value) > 0:
            light = added(light, times(value, transmit(tables, at.point, direction, distance, MASK_SHADOW)))
    return light


@scalar
def _unblocked_sun(tables, at, u, i, first, even, mirrors):
    """The direction to a sample of the sun, and the light from there if nothing blocks it."""
    direction, energy = sun_sample(tables.lit, u[first, i], u[first + 1, i])
    return direction, times(response(at, direction, even, mirrors), energy)


@scalar
def unblocked_lamp(tables, at, u, i, first, even, mirrors):
    """The direction to a sample of one lamp, how far away it is, the light from there if nothing blocks it, and the
    lamp's number."""
    numbers = (u[first, i], u[first + 1, i], u[first + 2, i], u[first + 3, i])
    direction, distance, energy, lamp = lamp_sample(tables.lit, at.point, at.normal, *numbers)
    if lamp < 0 or not max(energy) > 0:
        return direction, distance, NOTHING, lamp
    return direction, distance, times(response(at, direction, even, mirrors), energy), lamp


@scalar
def gather(paths, tables, at, i, first, bounces, through, place, out):
    """See `tracer.paths.diffuse.gathered`; the light, times ``through``, comes to a place of
    `tracer.paths.waiting_kernel.arrive`."""
    u = paths.u
    for bounce in range(bounces):
        through = times(through, diffuse_of(at))
        _send_to_lights(paths, tables, at, i, first, through, place, out)
        direction = cosine_direction(at.normal, u[first + DIMS, i], u[first + DIMS + 1, i])
        if bounce == bounces - 1:
            send_to_sky(paths, tables, at.point, direction, through, place, out)
            break
        number = u[first + DIMS + 2, i]
        isect = _go_on(tables, at, direction, number)
        through = times(through, isect.weight)
        if isect.t == np.inf:
            arrive(out, place, times(through, sky(tables.lit, direction)))
            break
        at = isect.surface
        first += EVEN


@scalar
def _send_to_lights(paths, tables, at, i, first, through, place, out):
    """As `direct` for a diffuse surface."""
    if shines(tables.lit):
        direction, value = _unblocked_sun(tables, at, paths.u, i, first, through, False)
        if max(value) > 0:
            send(paths, tables, at.point, direction, FARTHEST, value, place, out)
    if len(tables.lit.lamps):
        direction, distance, value, _ = unblocked_lamp(tables, at, paths.u, i, first + 2, through, False)
        if max(value) > 0:
            send(paths, tables, at.point, direction, distance, value, place, out)


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
            light = added(light, direct(tables, at, u, i, first, diffuse_share(at), not sharp_sun, not sharp_lamp))
            if len(lit.sky_upto):
                light = added(light, _from_sky(tables, at, u[first + DIMS + 5, i], u[first + DIMS + 6, i]))
        light = times(through, light)
        total, onscreen = added(total, light), along(onscreen, light, known)
        if bounce > bounces:
            break
        direction, factor, density = scattered(at, u[first + DIMS, i], u[first + DIMS + 1, i], u[first + DIMS + 2, i])
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
def _from_sky(tables, at, a, b):
    """Diffuse reflection of the sky, by one shadow ray."""
    diffuse = diffuse_share(at)
    direction, density = sky_sample(tables.lit, a, b)
    even = max(dot(at.normal, direction), 0.0) / math.pi
    if not (even > 0 and max(diffuse) > 0):
        return NOTHING
    passed = transmit(tables, at.point, direction, FARTHEST, MASK_SECONDARY)
    if not max(passed) > 0:
        return NOTHING
    share = even / (density + (1 - specular_chance(at)) * even)
    return times(scaled(diffuse, share), times(passed, sky(tables.lit, direction)))


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
    even = diffuse_share(at)
    light = added(
        at.emission if sees_lamps else NOTHING,
        direct(tables, at, u, i, first, even, not sharp_sun, not sharp_lamp),
    )
    cached, known = look_up(keys, values, at.point, at.normal)
    known = known and not follows
    if known:
        light = added(light, times(even, cached))
    direction, factor, density = scattered(at, u[first + DIMS, i], u[first + DIMS + 1, i], u[first + DIMS + 2, i])
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
