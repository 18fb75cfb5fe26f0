"""The compiled form of reflections: a pixel with all its rays as a scalar body.

Names and steps are those of the torch reference in `post.shading.reference`, which is the definition.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.each import pixel_of
from gbufrt.compute.kernel import inlined, scalar
from gbufrt.luminance import REC709
from gbufrt.specular import MIRROR_ROUGHNESS
from post.march.constants import BLOCKED, HIT, LEFT
from post.march.kernel import Ending, off_edge, trace
from post.shading import constants
from post.shading.incoming_kernel import beyond, border_fade, hidden_share, incoming, open_share
from post.shading.lobe_kernel import dot, grazing, mirror, reflected, scaled, unit

ZERO, HALF, ONE, TWO, STEEP = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2), np.float32(10)
SMOOTH, SMOOTHEST, DARK = np.float32(MIRROR_ROUGHNESS), np.float32(1e-3), np.float32(1e-9)
FIREFLY, GUESSED = np.float32(constants.FIREFLY), np.float32(constants.GUESSED)
RED, GREEN, BLUE = (np.float32(share) for share in REC709)
GLOSSY, NEXT = np.float32(constants.GLOSSY), np.float32(constants.NEXT)
FULL_SHARE, FILTERED = np.float32(constants.FULL_SHARE), np.float32(constants.FILTERED)


@inlined
def _turned(rotation, a):
    """A view-space vector in world space."""
    return dot(rotation[0], a), dot(rotation[1], a), dot(rotation[2], a)


@inlined
def _turned_back(rotation, a):
    """A world-space vector in view space."""
    return (
        rotation[0, 0] * a[0] + rotation[1, 0] * a[1] + rotation[2, 0] * a[2],
        rotation[0, 1] * a[0] + rotation[1, 1] * a[1] + rotation[2, 1] * a[2],
        rotation[0, 2] * a[0] + rotation[1, 2] * a[1] + rotation[2, 2] * a[2],
    )


@inlined
def _vector(planes, b, y, x):
    return planes[b, 0, y, x], planes[b, 1, y, x], planes[b, 2, y, x]


@inlined
def _firefly_factor(sent, limit, rough, blocked):
    """At most 1: limits guesses and samples of rough surfaces to a multiple of the frame's mean; mirrors keep all."""
    luminance = sent[0] * RED + sent[1] * GREEN + sent[2] * BLUE
    limit *= GUESSED if blocked else FIREFLY / max(rough, SMOOTHEST)
    return min(limit / max(luminance, DARK), ONE)


@inlined
def _rays(f0, cosine, rough, samples):
    """How many rays a pixel takes; see `post.shading.lobes.rays_of`."""
    if rough < SMOOTH:
        return 1
    highest = max(f0[0], max(f0[1], f0[2]))
    share = highest + (max(ONE - rough, highest) - highest) * grazing(min(max(cosine, ZERO), ONE))
    part = min(share / FULL_SHARE, ONE) * (ONE if rough < FILTERED else HALF)
    return max(np.int64(np.ceil(np.float32(samples) * part)), 1)


@inlined
def _point(z, optics, orthographic, x, y):
    """The view-space point of a pixel."""
    across = (np.float32(x) + HALF - optics[2]) / optics[0]
    along = (np.float32(y) + HALF - optics[3]) / optics[1]
    return (across, along, z) if orthographic else (across * z, along * z, z)


@inlined
def _carried(carried, f0, cosine, share):
    """What is left of light that a surface mirrors once more."""
    edge = share * grazing(min(cosine, ONE))
    fades = share - edge
    return (
        carried[0] * (f0[0] * fades + edge),
        carried[1] * (f0[1] * fades + edge),
        carried[2] * (f0[2] * fades + edge),
    )


@inlined
def _more(light, carried, sent):
    """Light, and what is left of more that was sent."""
    return light[0] + carried[0] * sent[0], light[1] + carried[1] * sent[1], light[2] + carried[2] * sent[2]


@scalar
def reflect(
    i, out, planes, pyramid, table, lens, near, orthographic, rotation, hit, depth, normal, geometric, roughness, f0,
    metallic, lit, sky, around, bent, limit, noise, shifts, bounces, steps, distance, far, cutoff, border,
):  # fmt: skip
    """See `post.shading.op.reflect_cpu`: one pixel, written to its place in ``out``."""
    near, distance, far = np.float32(near), np.float32(distance), np.float32(far)
    cutoff, border = np.float32(cutoff), np.float32(border)
    height, width = depth.shape[2:]
    b, y, x = pixel_of(i, height, width)
    if not hit[b, 0, y, x]:
        for c in range(5):
            out[b, c, y, x] = ZERO
        return
    rough, z, optics, turn = roughness[b, 0, y, x], depth[b, 0, y, x], lens[b], rotation[b]
    point = _point(z, optics, orthographic, x, y)
    facing = _turned_back(turn, _vector(normal, b, y, x))
    at = mirror(point, facing, orthographic, rough * rough)
    above = _turned_back(turn, _vector(geometric, b, y, x)) if geometric.shape[0] else at.normal
    has_bent = bent.shape[0] > 0
    trust = min(max((cutoff - rough) * STEEP + ONE, ZERO), ONE) if cutoff < ONE else ONE
    f0_here = _vector(f0, b, y, x)
    rays = _rays(f0_here, at.eye[2], rough, shifts.shape[0])
    red, green, blue, known, rated, travelled, ends = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
    for s in range(rays):
        u, v = noise[0, y, x] + shifts[rays - 1, s, 0], noise[1, y, x] + shifts[rays - 1, s, 1]
        ray = reflected(at, above, u - np.floor(u), v - np.floor(v))
        if not ray.weight > ZERO:
            continue
        light, carried, start, way, row, column = (ZERO, ZERO, ZERO), (ONE, ONE, ONE), point, ray.direction, y, x
        first, sure = Ending(ZERO, ZERO, ZERO, ZERO, LEFT), ZERO
        for bounce in range(bounces + 1):
            here = Ending(np.float32(column) + HALF, np.float32(row) + HALF, ZERO, ZERO, LEFT)
            end = here
            if bounce < bounces and trust > ZERO:
                end = trace(planes[b], pyramid[b], table, optics, start, way, near, orthographic, distance, steps)
                if end.status == BLOCKED:
                    begins = max(abs(end.x - here.x), abs(end.y - here.y)) < NEXT
                    end = here if begins else off_edge(planes[b], optics, orthographic, end, here.x, here.y)
            confidence = trust * end.agreement * border_fade(lit[b], end, border) if end.status == HIT else ZERO
            world, toward = _turned(turn, way), _vector(bent, b, row, column) if has_bent else facing
            open_sky, near_by = sky[b if sky.shape[0] > 1 else 0], around[b if around.shape[0] > 1 else 0]
            away = way[2] > ZERO
            sent = incoming(
                lit[b], hit[b, 0], open_sky, near_by, end, confidence, column, row, toward, has_bent, world, away
            )
            light = _more(light, carried, sent)
            if bounce == 0:
                first, sure = end, confidence
            likely = hidden_share(end) if end.status == BLOCKED else confidence
            if metallic.shape[0] == 0 or not likely > ZERO:
                break
            row, column = min(max(np.int64(end.y), 0), height - 1), min(max(np.int64(end.x), 0), width - 1)
            other, metal = _turned_back(turn, _vector(normal, b, row, column)), metallic[b, 0, row, column]
            cosine, gloss = -dot(way, other), ONE - roughness[b, 0, row, column] / GLOSSY
            carried = _carried(carried, _vector(f0, b, row, column), abs(cosine), likely)
            if cosine > ZERO:
                lift = TWO * cosine
                way = unit((way[0] + lift * other[0], way[1] + lift * other[1], way[2] + lift * other[2]))
            else:
                way = other
            if gloss > ZERO and metal < ONE:
                world, toward = _turned(turn, way), _vector(bent, b, row, column) if has_bent else other
                open_here = lit[b, row, column, 3]
                part = open_share(open_here, toward, world) if has_bent else open_here
                sent = beyond(open_sky, near_by, world, part, False)
                light = _more(light, carried, scaled(sent, gloss * (ONE - metal)))
            if not metal > ZERO:
                break
            carried = scaled(carried, metal)
            start = _point(depth[b, 0, row, column], optics, orthographic, column, row)
        light = scaled(light, ray.weight * _firefly_factor(light, limit[b], rough, first.status == BLOCKED))
        edge = grazing(ray.cosine)
        red += (f0_here[0] * (ONE - edge) + edge) * light[0]
        green += (f0_here[1] * (ONE - edge) + edge) * light[1]
        blue += (f0_here[2] * (ONE - edge) + edge) * light[2]
        known, rated = known + sure, rated + ONE
        if first.status == HIT or first.status == BLOCKED:
            travelled, ends = travelled + first.distance, ends + ONE
    share = ONE / np.float32(rays)
    out[b, 0, y, x], out[b, 1, y, x], out[b, 2, y, x] = red * share, green * share, blue * share
    out[b, 3, y, x] = known / max(rated, ONE)
    out[b, 4, y, x] = travelled / ends if ends > ZERO else far
