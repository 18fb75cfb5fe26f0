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
from tracer.paths.interaction_kernel import WHITE, intersect
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
from tracer.scene.scene import MASK_SECONDARY
from tracer.traversal.rays import FARTHEST


@scalar
def send_to_lights(waiting, tables, at, u, i, first, even, mirrors, through, place, out):
    """Direct light from the sun and from one lamp, times ``through``, comes to a place of
    `tracer.paths.waiting_kernel.arrive`; see `tracer.paths.interaction.direct`. ``mirrors``: whether the surface shows
    a specular reflection of the sun, and of lamps."""
    if shines(tables.lit):
        direction, value = _unblocked_sun(tables, at, u, i, first, even, mirrors[0])
        if max(value) > 0:
            send(waiting, tables, at.point, direction, FARTHEST, times(through, value), place, out)
    if len(tables.lit.lamps):
        direction, distance, value, _ = unblocked_lamp(tables, at, u, i, first + 2, even, mirrors[1])
        if max(value) > 0:
            send(waiting, tables, at.point, direction, distance, times(through, value), place, out)


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
def gather(waiting, tables, at, u, i, first, bounces, through, place, out):
    """See `tracer.paths.diffuse.gathered`; the light, times ``through``, comes to a place, see `send_to_lights`."""
    for bounce in range(bounces):
        through = times(through, diffuse_of(at))
        send_to_lights(waiting, tables, at, u, i, first, WHITE, (False, False), through, place, out)
        direction = cosine_direction(at.normal, u[first + DIMS, i], u[first + DIMS + 1, i])
        if bounce == bounces - 1:
            send_to_sky(waiting, tables, at.point, direction, through, place, out)
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
def _go_on(tables, at, direction, number):
    mask = MASK_SECONDARY
    return intersect(tables, at.point, direction, number, at.inside, mask, 0.0, FARTHEST, MOST_PASS, FINE, False)


@scalar
def arriving(tables, isect, direction, sight, numbers, bounces, next_event, sees_lights, counts):
    """See `tracer.paths.radiance.arriving`.

    Args:
        sight: camera and picture, and 1 where the first surface is on screen, else 0.
        numbers: in [0, 1), the column of this path, and the first row that it takes.
        sees_lights: whether no shadow ray has sampled the sun already, and lamps.
        counts: what waits; the place of `tracer.paths.waiting_kernel.arrive` where light counts, on-screen light in its
            second rows too; and the sums.
    """
    (camera, picture, known), (u, i, first), (sees_sun, sees_lamps) = sight, numbers, sees_lights
    waiting, place, out = counts
    lit, through, density = tables.lit, WHITE, 0.0
    sharp = lit.sky[DISC, 0]
    for bounce in range(bounces + 2):
        through = times(through, isect.weight)
        if isect.t == np.inf:
            share = 1.0
            if density > 0 and len(lit.sky_upto):
                share = density / (density + sky_density(lit, direction))
            light = sun(lit, direction) if sees_sun and shines(lit) else NOTHING
            arrive(out, _where(place, known), times(through, along(light, sky(lit, direction), share)))
            return
        at = isect.surface
        if bounce and known > 0:
            point, normal = back_project(camera, at.point, at.normal, at.instance)
            known = 1.0 if sees(camera, picture, point, normal) else 0.0
        here = _where(place, known)
        if sees_lamps:
            arrive(out, here, times(through, at.emission))
        if bounce > bounces:
            return
        sharp_sun, sharp_lamp = at.roughness * at.roughness < sharp, at.roughness < LAMP_ROUGHNESS
        if next_event:
            even, mirrors = diffuse_share(at), (not sharp_sun, not sharp_lamp)
            send_to_lights(waiting, tables, at, u, i, first, even, mirrors, through, here, out)
            if len(lit.sky_upto):
                _sample_sky(waiting, tables, at, u[first + DIMS + 5, i], u[first + DIMS + 6, i], through, here, out)
        direction, factor, density = scattered(at, u[first + DIMS, i], u[first + DIMS + 1, i], u[first + DIMS + 2, i])
        sees_sun = (density == 0 and sharp_sun) or not next_event
        sees_lamps = (density == 0 and sharp_lamp) or not next_event
        density = density if next_event else 0.0
        through = times(through, factor)
        most = max(through)
        chance = min(max(most, SURVIVAL), 1.0) if bounce else 1.0
        if not (most > 0 and u[first + DIMS + 3, i] < chance):
            return
        through = scaled(through, 1 / chance)
        isect = _go_on(tables, at, direction, u[first + DIMS + 4, i])
        first += MORE


@scalar
def _where(place, known):
    """A place, without its second rows where a path is not on screen."""
    return place[0], place[1], place[2] if known > 0 else -1


@scalar
def _sample_sky(waiting, tables, at, a, b, through, place, out):
    """Diffuse reflection of the sky, by one shadow ray."""
    diffuse = diffuse_share(at)
    direction, density = sky_sample(tables.lit, a, b)
    even = max(dot(at.normal, direction), 0.0) / math.pi
    if even > 0 and max(diffuse) > 0:
        share = even / (density + (1 - specular_chance(at)) * even)
        send_to_sky(waiting, tables, at.point, direction, times(through, scaled(diffuse, share)), place, out)


@scalar
def arriving_at_once(paths, tables, isect, direction, sight, i, first, bounces, sees_lights):
    """The light of `arriving`, by rays that do not wait."""
    found, counts = paths.found, (None, (i, 0, -1), paths.found)
    found[0, i], found[1, i], found[2, i] = NOTHING
    arriving(tables, isect, direction, sight, (paths.u, i, first), bounces, True, sees_lights, counts)
    return found[0, i], found[1, i], found[2, i]


@scalar
def remembered(paths, tables, cache, isect, direction, sight, i, first, bounces, sees_lights, follows):
    """See `tracer.paths.memory.remembered`; the light, and whether there is a sample, where, facing where, of what."""
    (keys, values), u, found = cache, paths.u, paths.found
    at = isect.surface
    if isect.t == np.inf:
        light = sun(tables.lit, direction) if sees_lights[0] and shines(tables.lit) else NOTHING
        return times(isect.weight, added(light, sky(tables.lit, direction))), False, NOTHING, NOTHING, NOTHING
    sharp_sun, sharp_lamp = at.roughness * at.roughness < tables.lit.sky[DISC, 0], at.roughness < LAMP_ROUGHNESS
    even = diffuse_share(at)
    found[0, i], found[1, i], found[2, i] = at.emission if sees_lights[1] else NOTHING
    mirrors = not sharp_sun, not sharp_lamp
    send_to_lights(None, tables, at, u, i, first, even, mirrors, WHITE, (i, 0, -1), found)
    light = (found[0, i], found[1, i], found[2, i])
    cached, known = look_up(keys, values, at.point, at.normal)
    known = known and not follows
    if known:
        light = added(light, times(even, cached))
    direction, factor, density = scattered(at, u[first + DIMS, i], u[first + DIMS + 1, i], u[first + DIMS + 2, i])
    diffuse, sent = density > 0, NOTHING
    if max(factor) > 0 and not (known and diffuse):
        onward = _go_on(tables, at, direction, u[first + DIMS + 4, i])
        sees = sharp_sun and not diffuse, sharp_lamp and not diffuse
        sent = arriving_at_once(paths, tables, onward, direction, sight, i, first + MORE, bounces - 1, sees)
        light = added(light, times(factor, sent))
    sampled = diffuse and not known and max(factor) > 0
    return times(isect.weight, light), sampled, at.point, at.normal, sent
