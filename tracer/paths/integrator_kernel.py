"""The compiled form of `tracer.paths.integrators`: what a batch of paths from some surfaces of a picture finds.

Each adds to its rows of ``out`` what ``each`` paths from every surface between ``begin`` and ``end`` find.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from gbufrt.specular import LAMP_ROUGHNESS
from tracer.lights.lamp_kernel import lamp_sample
from tracer.lights.lit import DISC, FACING, NOTHING
from tracer.lights.samples import DIMS
from tracer.lights.sky_kernel import shines, sky, sun_sample
from tracer.paths.batch_kernel import DX, DY, DZ, NX, NY, NZ, even_directions, hit_of, put_ray, trace
from tracer.paths.interaction import FINE
from tracer.paths.interaction_kernel import OPACITY, WHITE, go_through, place_at, reached, surface_of, transmit
from tracer.paths.on_screen_kernel import sees
from tracer.paths.path_kernel import arriving_at_once, gather, remembered, send_to_lights, unblocked_lamp
from tracer.paths.radiance import MORE
from tracer.paths.surfaces.response_kernel import diffuse_of, f0_of
from tracer.paths.waiting_kernel import arrive, finish, send
from tracer.sampling.scatter_kernel import along, dot, fresnel, sample_specular, scaled, times
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW
from tracer.traversal.kernel import triple
from tracer.traversal.rays import FARTHEST

COLUMNS = 9  # of what `lobes` finds without a cache


@inlined
def _add(out, row, i, value):
    """Add a triple to three rows."""
    out[row, i] += value[0]
    out[row + 1, i] += value[1]
    out[row + 2, i] += value[2]


@scalar
def _trace_even(paths, tables, surfaces, begin, end, each, radius):
    """Send the first rays of diffuse paths."""
    j = 0
    for i in range(begin, end):
        x, y, z = triple(surfaces, i, 3)
        for _ in range(each):
            paths.rows[NX + j], paths.rows[NY + j], paths.rows[NZ + j] = x, y, z
            j += 1
    even_directions(paths, j)
    j = 0
    for i in range(begin, end):
        point = triple(surfaces, i, 0)
        for _ in range(each):
            put_ray(paths, j, point, (paths.rows[DX + j], paths.rows[DY + j], paths.rows[DZ + j]), radius)
            j += 1
    trace(paths, j, tables.transforms, tables.grids)


@scalar
def _occludes(tables, camera, picture, origin, direction, u, hit, radius):
    """Whether what a ray hits first occludes, and whether that is on screen."""
    if tables.materials[hit[2], OPACITY] < 1:  # where the ray begins counts for the weight alone, which is not wanted
        hit = go_through(tables, hit, origin, direction, u, False, MASK_SECONDARY, 0.0, radius, 1.0)[0]
        if hit[0] == np.inf:
            return False, False
    point, normal, _, _ = place_at(tables, origin, direction, hit, FINE)
    return True, sees(camera, picture, point, normal)


@scalar
def occlusion(paths, tables, camera, picture, surfaces, begin, end, each, radius, out):
    """``ao``, ``bent_normal``, ``ao_onscreen``."""
    _trace_even(paths, tables, surfaces, begin, end, each, radius)
    j = 0
    for i in range(begin, end):
        origin = triple(surfaces, i, 0)
        for _ in range(each):
            direction, closed, shown = triple(paths.directions, j, 0), False, False
            if paths.ids[j, 1] >= 0:
                hit, u = hit_of(paths, j), paths.u[2, j]
                closed, shown = _occludes(tables, camera, picture, origin, direction, u, hit, radius)
            if not closed:
                out[0, i] += 1
                _add(out, 1, i, direction)
            if not shown:
                out[4, i] += 1
            j += 1


@scalar
def indirect(paths, tables, camera, picture, surfaces, begin, end, each, bounces, out):
    """``gi``, ``gi_onscreen``, ``sky``, ``sky_visibility``."""
    _trace_even(paths, tables, surfaces, begin, end, each, np.inf)
    for j in range((end - begin) * each):
        i = begin + j // each
        at, direction, u = surface_of(surfaces, i), triple(paths.directions, j, 0), paths.u
        isect = reached(tables, hit_of(paths, j), at, direction, u[2, j])
        weight = times(diffuse_of(at), isect.weight)
        if isect.t == np.inf:
            _add(out, 6, i, times(weight, sky(tables.lit, direction)))
            out[9, i] += (isect.weight[0] + isect.weight[1] + isect.weight[2]) / 3
        else:
            shown = sees(camera, picture, isect.surface.point, isect.surface.normal)
            gather(paths.waiting, tables, isect.surface, u, j, 3, bounces, weight, (i, 0, 3 if shown else -1), out)
    finish(paths.waiting, tables, out)


@scalar
def lit(paths, tables, camera, picture, surfaces, begin, end, each, setting, out):
    """``direct``; and ``shadow`` of the sun, and of a lamp."""
    u = paths.u
    for j in range((end - begin) * each):
        i = begin + j // each
        at = surface_of(surfaces, i)
        diffuse = diffuse_of(at)
        if shines(tables.lit):
            direction, energy = sun_sample(tables.lit, u[0, j], u[1, j])
            light, share = _arriving(tables, at, direction, FARTHEST, energy)
            _add(out, 0, i, times(diffuse, light))
            out[3, i] += share
        if len(tables.lit.lamps):
            numbers = (u[2, j], u[3, j], u[4, j], u[5, j])
            direction, distance, energy, _ = lamp_sample(tables.lit, at.point, at.normal, *numbers)
            light, share = _arriving(tables, at, direction, distance, energy)
            _add(out, 0, i, times(diffuse, light))
            out[4, i] += share


@scalar
def _arriving(tables, at, direction, distance, energy):
    """Light that a surface of albedo 1 sends on, and the share of it that is not in shadow."""
    whole = scaled(energy, max(dot(at.normal, direction), 0.0) / math.pi)
    if not max(whole) > 0:
        return NOTHING, 0.0
    light = times(whole, transmit(tables, at.point, direction, distance, MASK_SHADOW))
    return light, (light[0] + light[1] + light[2]) / (whole[0] + whole[1] + whole[2])


@scalar
def reflected(paths, tables, camera, picture, surfaces, begin, end, each, sharp, out):
    """``reflection``, ``reflection_onscreen``; and ``onscreen``, ``distance``, ``flies``, ``ends``."""
    u, count = paths.u, (end - begin) * each
    for j in range(count):
        at = surface_of(surfaces, begin + j // each)
        direction, weight, cosine = sample_specular(at.normal, at.toward, at.roughness * at.roughness, u[0, j], u[1, j])
        put_ray(paths, j, at.point, direction, np.inf if weight > 0 else -1.0)  # none into the surface itself
        paths.weights[j, 0], paths.weights[j, 1] = weight, cosine
    trace(paths, count, tables.transforms, tables.grids)
    for j in range(count):
        i = begin + j // each
        at, direction = surface_of(surfaces, i), triple(paths.directions, j, 0)
        weight, cosine, rough = paths.weights[j, 0], paths.weights[j, 1], at.roughness >= sharp
        if rough and len(tables.lit.lamps):
            way, distance, value, lamp = unblocked_lamp(tables, at, u, j, 5, NOTHING, True)
            if max(value) > 0:
                facing = triple(tables.lit.lamps, lamp, FACING)
                shown = sees(camera, picture, along(at.point, way, distance), facing)
                send(paths.waiting, tables, at.point, way, distance, value, (i, 0, 3 if shown else -1), out)
        if not weight > 0:
            continue
        isect = reached(tables, hit_of(paths, j), at, direction, u[2, j])
        factor = times(scaled(fresnel(f0_of(at), cosine), weight), isect.weight)
        out[8, i] += 1
        if isect.t == np.inf:
            _add(out, 0, i, times(factor, sky(tables.lit, direction)))
            continue
        shown = sees(camera, picture, isect.surface.point, isect.surface.normal)
        place = i, 0, 3 if shown else -1
        gather(paths.waiting, tables, isect.surface, u, j, 3 + DIMS, 1, factor, place, out)
        if not rough:
            arrive(out, place, times(factor, isect.surface.emission))
        out[6, i] += shown
        out[7, i] += isect.t
        out[9, i] += 1
    finish(paths.waiting, tables, out)


@scalar
def lobes(paths, tables, camera, picture, surfaces, begin, end, each, setting, out):
    """``indirect``, ``specular``; and ``distance``, ``flies``, ``ends`` of the specular ray.

    Where ``out`` has room for it, also a sample for a cache: where, facing where, its radiance, and 1 if there is one.
    """
    bounces, keys, values, follows = setting
    count, rest, cache = (end - begin) * each, bounces - 1, (keys, values)
    first, remembers, sight = 3 + MORE * bounces, len(out) > COLUMNS, (camera, picture, 0.0)
    for lobe in range(2):  # one body for both: a GPU's compiler copies paths to wherever they are called
        if lobe == 0:
            _trace_even(paths, tables, surfaces, begin, end, each, np.inf)
        else:
            _trace_specular(paths, tables, surfaces, begin, end, each, first, out)
        passes, onward = (2, 3) if lobe == 0 else (first + 2, first + 3 + DIMS)  # numbers of the path
        for j in range(count):
            i = begin + j // each
            at, direction, weight = surface_of(surfaces, i), triple(paths.directions, j, 0), paths.weights[j, 0]
            sees = False, False
            factor = scaled(WHITE, (1 - at.metallic) * at.opacity)
            if lobe == 1:
                if not weight > 0:
                    continue
                sees = _sharp(tables, at)
                factor = scaled(fresnel(f0_of(at), paths.weights[j, 1]), weight)
            isect = reached(tables, hit_of(paths, j), at, direction, paths.u[passes, j])
            if remembers:
                light, sample, point, normal, sent = remembered(
                    paths, tables, cache, isect, direction, sight, j, onward, rest, sees, follows[i]
                )
                if sample and lobe == 0:
                    _add(out, COLUMNS, i, point)
                    _add(out, COLUMNS + 3, i, normal)
                    _add(out, COLUMNS + 6, i, sent)
                    out[COLUMNS + 9, i] += 1
            else:
                light = arriving_at_once(paths, tables, isect, direction, sight, j, onward, rest, sees)
            _add(out, 3 * lobe, i, times(factor, light))
            if lobe == 1:
                out[7, i] += 1
                if isect.t < np.inf:
                    out[6, i] += isect.t
                    out[8, i] += 1
    finish(paths.waiting, tables, out)


@scalar
def _trace_specular(paths, tables, surfaces, begin, end, each, first, out):
    """Send the first rays of specular paths, whose numbers begin with the ``first``, and those to lights."""
    u, count = paths.u, (end - begin) * each
    for j in range(count):
        i = begin + j // each
        at = surface_of(surfaces, i)
        sharp_sun, sharp_lamp = _sharp(tables, at)
        mirrors, place = (not sharp_sun, not sharp_lamp), (i, 3, -1)
        send_to_lights(paths.waiting, tables, at, u, j, first + 3, NOTHING, mirrors, WHITE, place, out)
        alpha, a, b = at.roughness * at.roughness, u[first, j], u[first + 1, j]
        direction, weight, cosine = sample_specular(at.normal, at.toward, alpha, a, b)
        put_ray(paths, j, at.point, direction, np.inf if weight > 0 else -1.0)  # none into the surface itself
        paths.weights[j, 0], paths.weights[j, 1] = weight, cosine
    trace(paths, count, tables.transforms, tables.grids)


@scalar
def _sharp(tables, at):
    """Whether a reflected ray itself finds the sun, and lamps: shadow rays do where the surface is rougher."""
    return at.roughness * at.roughness < tables.lit.sky[DISC, 0], at.roughness < LAMP_ROUGHNESS
