"""What a reflected ray brings: the picture's light where it ended, or the sky, as scalar bodies.

Names and steps are those of the torch reference in `post.shading.incoming`, which is the definition.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.approximations import HALF_TURN, atan2
from gbufrt.compute.kernel import inlined, scalar
from post.march.constants import BLOCKED, SPENT
from post.shading import constants
from post.shading.lobe_kernel import dot, scaled

ZERO, HALF, ONE, TWO, THREE = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2), np.float32(3)
HIDDEN_SHARE, CONTINUED_SHARE = np.float32(constants.HIDDEN_SHARE), np.float32(constants.CONTINUED_SHARE)
ROW_SLOPE = np.float32(constants.ROW_SLOPE)
OPEN, SOFTEST, SOFTNESS = np.float32(constants.OPEN), np.float32(1e-3), np.float32(0.3)
CLOSED, POLE = np.float32(20), np.float32(1e-12)


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
def read(picture, x, y):
    """The colour at a place in a picture; beyond its border, the border's."""
    last_x, last_y = picture.shape[1] - 1, picture.shape[0] - 1
    x, y = min(max(x - HALF, ZERO), np.float32(last_x)), min(max(y - HALF, ZERO), np.float32(last_y))
    ix, iy = np.int64(x), np.int64(y)
    upper, lower, right = picture[iy], picture[min(iy + 1, last_y)], min(ix + 1, last_x)
    return _mixed(upper[ix], upper[right], lower[ix], lower[right], x - np.float32(ix), y - np.float32(iy))


@inlined
def _place(direction):
    """Where a world-space direction lies in a lat-long picture, as shares of its width and height."""
    across = math.sqrt(max(direction[0] * direction[0] + direction[2] * direction[2], POLE))
    azimuth = atan2(direction[0], -direction[2]) if across * across > POLE else ZERO
    return azimuth / (TWO * HALF_TURN) + HALF, atan2(across, direction[1]) / HALF_TURN


@inlined
def _corners(picture, place):
    """The four pixels of a lat-long picture next to a place, and how far it lies between them."""
    height, width = picture.shape[0], picture.shape[1]
    x, y = place[0] * np.float32(width) - HALF, place[1] * np.float32(height) - HALF
    y = min(max(y, ZERO), np.float32(height - 1))
    column, iy = math.floor(x), np.int64(y)
    ix = (np.int64(column) + width) % width
    upper, lower, right = picture[iy], picture[min(iy + 1, height - 1)], (ix + 1) % width
    return upper[ix], upper[right], lower[ix], lower[right], x - np.float32(column), y - np.float32(iy)


@inlined
def _off_horizon(world):
    """See `post.shading.incoming.off_horizon`."""
    least = ROW_SLOPE * math.sqrt(max(world[0] * world[0] + world[2] * world[2], POLE))
    return world[0], max(world[1], least) if world[1] > ZERO else min(world[1], -least), world[2]


@scalar
def beyond(sky, around, world, share, over_sky):
    """What a ray meets that leaves the picture: a share of the sky, see `gbufrt.environment`, the rest surfaces."""
    a, b, c, d, fx, fy = _corners(around, _place(_off_horizon(world)))
    surface = _mixed(a, b, c, d, fx, fy)
    if not over_sky:
        left, right = a[3] + (c[3] - a[3]) * fy, b[3] + (d[3] - b[3]) * fy
        share *= left + (right - left) * fx
    a, b, c, d, fx, fy = _corners(sky, _place(world))
    above = _mixed(a, b, c, d, fx, fy)
    return (
        surface[0] + (above[0] - surface[0]) * share,
        surface[1] + (above[1] - surface[1]) * share,
        surface[2] + (above[2] - surface[2]) * share,
    )


@inlined
def open_share(open_here, bent, world):
    """The share of sky that the origin's own openness leaves to a ray."""
    edge = math.sqrt(max(ONE - open_here / OPEN, ZERO))
    soft = max(SOFTNESS * math.sqrt(max(open_here, ZERO)), SOFTEST)
    ramp = min(max((dot(bent, world) - edge) / soft + ONE, ZERO), ONE)
    return ramp * ramp * (THREE - TWO * ramp) * min(max(open_here * CLOSED, ZERO), ONE)


@scalar
def _sky_share(lit, end, x, y, bent, has_bent, world):
    """The visibility of the sky to a ray that ended so; ``lit`` holds that of each pixel as a fourth colour."""
    row, column = min(max(np.int64(end.y), 0), lit.shape[0] - 1), min(max(np.int64(end.x), 0), lit.shape[1] - 1)
    last, here = lit[row, column, 3], lit[y, x, 3]
    if last > here or (end.status == SPENT and not (row == y and column == x)):
        return last
    return open_share(here, bent, world) if has_bent else here


@scalar
def border_fade(lit, end, border):
    """1 inside the picture, falling to 0 at its border."""
    height, width = np.float32(lit.shape[0]), np.float32(lit.shape[1])
    return min(max(min(min(end.x, width - end.x), min(end.y, height - end.y)) / border, ZERO), ONE)


@inlined
def hidden_share(end):
    """See `post.shading.incoming.hidden_share`."""
    return HIDDEN_SHARE if end.agreement > ZERO else CONTINUED_SHARE


@scalar
def incoming(lit, hit, sky, around, end, confidence, x, y, bent, has_bent, world, away):
    """The radiance that a ray brings: light from the screen as far as it is trusted, else what lies beyond."""
    if end.status == BLOCKED:
        return scaled(read(lit, end.x, end.y), hidden_share(end))
    guess = ZERO, ZERO, ZERO
    if confidence < ONE:
        row, column = min(max(np.int64(end.y), 0), lit.shape[0] - 1), min(max(np.int64(end.x), 0), lit.shape[1] - 1)
        share = _sky_share(lit, end, x, y, bent, has_bent, world)
        guess = beyond(sky, around, world, share, away and not hit[row, column])
    if confidence <= ZERO:
        return guess
    found = read(lit, end.x, end.y)
    return (
        guess[0] + (found[0] - guess[0]) * confidence,
        guess[1] + (found[1] - guess[1]) * confidence,
        guess[2] + (found[2] - guess[2]) * confidence,
    )
