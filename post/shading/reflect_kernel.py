"""The compiled form of reflections: a pixel with all its rays as a scalar body.

Names and steps are those of the torch reference in `post.shading.reference`, which is the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.approximations import HALF_TURN, atan2
from gbufrt.compute.kernel import inlined, scalar
from gbufrt.luminance import REC709
from gbufrt.specular import MIRROR_ROUGHNESS
from post.march.constants import BLOCKED, HIT, LEFT, SPENT
from post.march.kernel import Ending, trace
from post.shading import constants
from post.shading.lobe_kernel import dot, grazing, mirror, reflected, scaled, unit

ZERO, HALF, ONE, TWO, THREE = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2), np.float32(3)
SMOOTH, SMOOTHEST, DARK = np.float32(MIRROR_ROUGHNESS), np.float32(1e-3), np.float32(1e-9)
FIREFLY, GUESSED = np.float32(constants.FIREFLY), np.float32(constants.GUESSED)
HIDDEN_SHARE, RED, GREEN, BLUE = np.float32(constants.HIDDEN_SHARE), *(np.float32(share) for share in REC709)
STEEP, SOFTEST, SOFTNESS, CLOSED = np.float32(10), np.float32(1e-3), np.float32(0.3), np.float32(20)
POLE = np.float32(1e-12)
FULL_SHARE = np.float32(constants.FULL_SHARE)


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
def _mixed(a, b, c, d, fx, fy):
    """Bilinear interpolation of four pixels' colours; a and b lie side by side, c and d below them."""
    wa, wb, wc, wd = (ONE - fx) * (ONE - fy), fx * (ONE - fy), (ONE - fx) * fy, fx * fy
    return (
        wa * a[0] + wb * b[0] + wc * c[0] + wd * d[0],
        wa * a[1] + wb * b[1] + wc * c[1] + wd * d[1],
        wa * a[2] + wb * b[2] + wc * c[2] + wd * d[2],
    )


@scalar
def _read(picture, x, y):
    """The colour at a place in a picture; beyond its border, the border's."""
    last_x, last_y = picture.shape[1] - 1, picture.shape[0] - 1
    x, y = min(max(x - HALF, ZERO), np.float32(last_x)), min(max(y - HALF, ZERO), np.float32(last_y))
    ix, iy = np.int64(x), np.int64(y)
    upper, lower, right = picture[iy], picture[min(iy + 1, last_y)], min(ix + 1, last_x)
    return _mixed(upper[ix], upper[right], lower[ix], lower[right], x - np.float32(ix), y - np.float32(iy))


@scalar
def _sky(sky, direction):
    """The colour of a lat-long sky in a world-space direction; see `gbufrt.environment.lookup_environment`."""
    height, width = sky.shape[0], sky.shape[1]
    across = math.sqrt(max(direction[0] * direction[0] + direction[2] * direction[2], POLE))
    azimuth = atan2(direction[0], -direction[2]) if across * across > POLE else ZERO
    x = (azimuth / (TWO * HALF_TURN) + HALF) * np.float32(width) - HALF
    y = atan2(across, direction[1]) / HALF_TURN * np.float32(height) - HALF
    y = min(max(y, ZERO), np.float32(height - 1))
    column, iy = math.floor(x), np.int64(y)
    ix = (np.int64(column) + width) % width
    upper, lower, right = sky[iy], sky[min(iy + 1, height - 1)], (ix + 1) % width
    return _mixed(upper[ix], upper[right], lower[ix], lower[right], x - np.float32(column), y - np.float32(iy))


@inlined
def _open_share(open_here, bent, world):
    """The share of sky that the origin's own openness leaves to a ray."""
    edge, soft = math.sqrt(max(ONE - open_here, ZERO)), max(SOFTNESS * math.sqrt(max(open_here, ZERO)), SOFTEST)
    ramp = min(max((dot(bent, world) - edge) / soft + ONE, ZERO), ONE)
    return ramp * ramp * (THREE - TWO * ramp) * min(max(open_here * CLOSED, ZERO), ONE)


@scalar
def _sky_share(lit, end, x, y, bent, has_bent, world):
    """The visibility of the sky to a ray that ended so; ``lit`` holds that of each pixel as a fourth colour."""
    row, column = min(max(np.int64(end.y), 0), lit.shape[0] - 1), min(max(np.int64(end.x), 0), lit.shape[1] - 1)
    last, here = lit[row, column, 3], lit[y, x, 3]
    if last > here or (end.status == SPENT and not (row == y and column == x)):
        return last
    return _open_share(here, bent, world) if has_bent else here


@scalar
def _border_fade(lit, end, border):
    """1 inside the picture, falling to 0 at its border."""
    height, width = np.float32(lit.shape[0]), np.float32(lit.shape[1])
    return min(max(min(min(end.x, width - end.x), min(end.y, height - end.y)) / border, ZERO), ONE)


@scalar
def _incoming(lit, sky, end, confidence, x, y, bent, has_bent, world):
    """The radiance that a ray brings: light from the screen as far as it is trusted, else the sky."""
    if end.status == BLOCKED:
        return scaled(_read(lit, end.x, end.y), HIDDEN_SHARE)
    guess = ZERO, ZERO, ZERO
    if confidence < ONE:
        share = _sky_share(lit, end, x, y, bent, has_bent, world)
        if share > ZERO:
            guess = scaled(_sky(sky, world), share)
    if confidence <= ZERO:
        return guess
    found = _read(lit, end.x, end.y)
    return (
        guess[0] + (found[0] - guess[0]) * confidence,
        guess[1] + (found[1] - guess[1]) * confidence,
        guess[2] + (found[2] - guess[2]) * confidence,
    )


@inlined
def _vector(planes, b, y, x):
    return planes[b, 0, y, x], planes[b, 1, y, x], planes[b, 2, y, x]


@inlined
def _firefly_factor(incoming, limit, rough, blocked):
    """At most 1: limits guesses and samples of rough surfaces to a multiple of the frame's mean; mirrors keep all."""
    luminance = incoming[0] * RED + incoming[1] * GREEN + incoming[2] * BLUE
    limit *= GUESSED if blocked else FIREFLY / max(rough, SMOOTHEST)
    return min(limit / max(luminance, DARK), ONE)


@inlined
def _rays(f0, cosine, rough, samples):
    """How many rays a pixel takes; see `post.shading.lobes.rays_of`."""
    if rough < SMOOTH:
        return 1
    highest = max(f0[0], max(f0[1], f0[2]))
    share = highest + (max(ONE - rough, highest) - highest) * grazing(min(max(cosine, ZERO), ONE))
    return max(np.int64(np.ceil(np.float32(samples) * min(share / FULL_SHARE, ONE))), 1)


@inlined
def _point(z, optics, orthographic, x, y):
    """The view-space point of a pixel."""
    across = (np.float32(x) + HALF - optics[2]) / optics[0]
    along = (np.float32(y) + HALF - optics[3]) / optics[1]
    return (across, along, z) if orthographic else (across * z, along * z, z)


@inlined
def _carried(carried, f0, cosine, share):
    """What is left of light that a metal mirrors once more."""
    edge = share * grazing(min(cosine, ONE))
    fades = share - edge
    return (
        carried[0] * (f0[0] * fades + edge),
        carried[1] * (f0[1] * fades + edge),
        carried[2] * (f0[2] * fades + edge),
    )


@scalar
def reflect(
    i, out, planes, pyramid, table, lens, near, orthographic, rotation, hit, depth, normal, geometric, roughness, f0,
    metallic, lit, sky, bent, limit, noise, shifts, bounces, steps, distance, far, cutoff, border,
):  # fmt: skip
    """See `post.shading.op.reflect_cpu`: one pixel, written to its place in ``out``."""
    near, distance, far = np.float32(near), np.float32(distance), np.float32(far)
    cutoff, border = np.float32(cutoff), np.float32(border)
    height, width = depth.shape[2:]
    b, y, x = i // (height * width), i // width % height, i % width
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
        u, v = noise[0, y, x] + shifts[s, 0], noise[1, y, x] + shifts[s, 1]
        ray = reflected(at, above, u - np.floor(u), v - np.floor(v))
        if not ray.weight > ZERO:
            continue
        light, carried, start, way, row, column = (ZERO, ZERO, ZERO), (ONE, ONE, ONE), point, ray.direction, y, x
        first, sure = Ending(ZERO, ZERO, ZERO, ZERO, LEFT), ZERO
        for bounce in range(bounces + 1):
            end = Ending(np.float32(column) + HALF, np.float32(row) + HALF, ZERO, ZERO, LEFT)
            if bounce < bounces and trust > ZERO:
                end = trace(planes[b], pyramid[b], table, optics, start, way, near, orthographic, distance, steps)
            confidence = trust * end.agreement * _border_fade(lit[b], end, border) if end.status == HIT else ZERO
            world, toward = _turned(turn, way), _vector(bent, b, row, column) if has_bent else facing
            here = sky[b if sky.shape[0] > 1 else 0]
            sent = _incoming(lit[b], here, end, confidence, column, row, toward, has_bent, world)
            light = (
                light[0] + carried[0] * sent[0],
                light[1] + carried[1] * sent[1],
                light[2] + carried[2] * sent[2],
            )
            if bounce == 0:
                first, sure = end, confidence
            likely = HIDDEN_SHARE if end.status == BLOCKED else confidence
            if metallic.shape[0] == 0 or not likely > ZERO:
                break
            row, column = min(max(np.int64(end.y), 0), height - 1), min(max(np.int64(end.x), 0), width - 1)
            other = _turned_back(turn, _vector(normal, b, row, column))
            cosine, share = -dot(way, other), likely * metallic[b, 0, row, column]
            if not share > ZERO:
                break
            faces = cosine > ZERO
            carried = _carried(carried, _vector(f0, b, row, column), cosine if faces else ONE, share)
            lift = TWO * cosine
            turned = unit((way[0] + lift * other[0], way[1] + lift * other[1], way[2] + lift * other[2]))
            way = turned if faces else other
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
