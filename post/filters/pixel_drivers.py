"""One pixel of each filter of `post.filters.drivers`, for a GPU: it weighs its taps one by one, by the same weights."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import inlined, scalar
from post.filters.around_kernel import kindred_pixel
from post.filters.bilateral_kernel import bilateral_own, bilateral_unlike, deviation_of, limits_of
from post.filters.constants import B3, COARSE_POWER, DEPTH, HIT, MOST_PLANES, NX, NY, NZ, ROUGHNESS
from post.filters.denoise_kernel import moments_of, wavelet_own, wavelet_unlike
from post.filters.fxaa_kernel import edge_row, luma_of, smooth
from post.filters.kernel import Guide, surface_row, unit_row
from post.filters.weight_kernel import (
    LEAST,
    ONE,
    ZERO,
    edge_with,
    gloss_between,
    near_of_plane,
    power_between,
    weight_between,
)

cuda: Any = numba.cuda
MIDDLE, BESIDE, LAST = np.float32(B3[2]), np.float32(B3[1]), np.float32(B3[0])
FOUR = ((-1, 0), (1, 0), (0, -1), (0, 1))  # pixels beside one


@scalar
def surface_pixel(i, guide, plane, depth, normal, hit, roughness, lens, pose, parallel):
    b, y, x = pixel_of(i, depth.shape[1], depth.shape[2])
    channels = depth[b], normal[b], hit[b], roughness[b]
    surface_row(guide[b], plane[b], *channels, lens[b], pose[b], parallel, y, x, x + 1)


@scalar
def unit_pixel(i, out, vector, fallback):
    b, y, x = pixel_of(i, out.shape[2], out.shape[3])
    unit_row(out[b], vector[b], fallback[b], y, x, x + 1)


@inlined
def _guide_of(guide, y, x):
    """One pixel of the guide; see `weight_kernel.guide_at`."""
    rough = ROUGHNESS if guide.shape[0] > ROUGHNESS else HIT
    return Guide(
        guide[DEPTH, y, x], guide[NX, y, x], guide[NY, y, x], guide[NZ, y, x], guide[HIT, y, x], guide[rough, y, x]
    )


@inlined
def _near_of(plane, y, x, depth_sensitivity):
    planes = plane[0, y, x], plane[1, y, x], plane[2, y, x], plane[3, y, x]
    return near_of_plane(*planes, np.float32(depth_sensitivity))


@inlined
def _within(y, x, size):
    return 0 <= y < size[0] and 0 <= x < size[1]


@inlined
def _weight(here, near, there, dx, dy, edge, unlike):
    """The edge weight of a tap with all of its factors."""
    weight = weight_between(here, near, there, np.float32(dx), np.float32(dy), edge, unlike)
    if edge.rest != ZERO:
        weight *= power_between(here, there, edge)
    if edge.roughness != ZERO:
        weight *= gloss_between(here, there, edge)
    return weight


@inlined
def _deviation(variance, y, x, size):
    """One pixel of `denoise_kernel.noise_row`: its separable blur at once, over the pixels that are there."""
    total, shares = ZERO, ZERO
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            if _within(y + dy, x + dx, size):
                share = np.float32((2 - abs(dx)) * (2 - abs(dy)))
                total += share * variance[np.uint64(y + dy), np.uint64(x + dx)]
                shares += share
    return deviation_of(total / shares)


@inlined
def _spline(i):
    """The B-spline's share of a tap; to look it up would take a branch for each."""
    return MIDDLE if i == 0 else (BESIDE if abs(i) == 1 else LAST)


@scalar
def moments_pixel(i, out, light, guide, plane, radius, perspective, depth_sensitivity, squares):
    b, y, x = pixel_of(i, light.shape[1], light.shape[2])
    edge, size, seen = edge_with(guide[b], perspective, squares, COARSE_POWER), light.shape[1:], guide[b]
    here, near, own = _guide_of(seen, y, x), _near_of(plane[b], y, x, depth_sensitivity), light[b, y, x]
    total, mean, square = ZERO, ZERO, ZERO
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            if _within(y + dy, x + dx, size):
                row, column = np.uint64(y + dy), np.uint64(x + dx)  # never below zero: nothing to wrap
                weight = _weight(here, near, _guide_of(seen, row, column), dx, dy, edge, ZERO)
                away = light[b, row, column] - own
                total += weight
                mean += weight * away
                square += weight * away * away
    out[b, 0, y, x], out[b, 1, y, x] = moments_of(total, mean, square, own)


@scalar
def wavelet_pixel(
    i, out, values, guide, plane, reach, step, perspective, phi_color, phi_depth, phi_normal, squares, planes
):  # fmt: skip
    """One pixel; ``planes`` is as long as the signal and its luminance have channels, so that their sums stay in
    registers."""
    b, y, x = pixel_of(i, values.shape[2], values.shape[3])
    size, seen, channels = values.shape[2:], guide[b], len(planes)
    if guide[b, HIT, y, x] == ZERO:
        for c in range(channels + 1):
            out[b, c, y, x] = values[b, c, y, x]
        return
    edge, light, variance = edge_with(seen, perspective, squares, phi_normal), values[b, channels - 1], values[b, -1]
    here, near, noise = _guide_of(seen, y, x), _near_of(plane[b], y, x, phi_depth), _deviation(variance, y, x, size)
    own = wavelet_own(light[y, x], noise, reach[b, min(y, reach.shape[1] - 1), x], np.float32(phi_color))
    sums, share = cuda.local.array(MOST_PLANES, np.float32), MIDDLE * MIDDLE
    for c in range(channels):
        sums[c] = share * values[b, c, y, x]
    total, spread = share, share * share * variance[y, x]
    for j in range(-2, 3):
        for i in range(-2, 3):
            dx, dy = i * step, j * step
            if (i != 0 or j != 0) and _within(y + dy, x + dx, size):
                row, column, away = np.uint64(y + dy), np.uint64(x + dx), (np.float32(dx), np.float32(dy))
                unlike = wavelet_unlike(own, light[row, column], *away)
                weight = _weight(here, near, _guide_of(seen, row, column), dx, dy, edge, unlike)
                weight *= _spline(j) * _spline(i)
                for c in range(channels):
                    sums[c] += weight * values[b, c, row, column]
                total += weight
                spread += weight * weight * variance[row, column]
    norm = ONE / max(total, LEAST)
    for c in range(channels):
        out[b, c, y, x] = sums[c] * norm
    out[b, channels, y, x] = spread / max(total * total, LEAST)


@scalar
def limits_pixel(i, width, tolerance, light, variance, sigma, sensitivity, phi_color):
    b, y, x = pixel_of(i, light.shape[1], light.shape[2])
    given = light[b, y, x], variance[b, y, x], _deviation(variance[b], y, x, light.shape[1:])
    limits = np.float32(sigma), np.float32(sensitivity), np.float32(phi_color)
    width[b, y, x], tolerance[b, y, x] = limits_of(*given, *limits)


@scalar
def bilateral_pixel(
    i, out, values, guide, plane, width, tolerance, radius, perspective, depth_sensitivity, normal_power, squares,
    planes,
):  # fmt: skip
    """One pixel; ``planes`` is as long as the signal has channels, see `wavelet_pixel`."""
    b, y, x = pixel_of(i, values.shape[2], values.shape[3])
    channels, size, seen, light = len(planes), values.shape[2:], guide[b], values[b, -1]
    if guide[b, HIT, y, x] == ZERO:
        for c in range(channels):
            out[b, c, y, x] = values[b, c, y, x]
        return
    edge = edge_with(seen, perspective, squares, normal_power)
    here, near, beside = _guide_of(seen, y, x), _near_of(plane[b], y, x, depth_sensitivity), ZERO
    for dx, dy in FOUR:
        if _within(y + dy, x + dx, size):
            beside += _weight(here, near, _guide_of(seen, np.uint64(y + dy), np.uint64(x + dx)), dx, dy, edge, ZERO)
    own = bilateral_own(light[y, x], beside, width[b, y, x], tolerance[b, y, x])
    sums, total = cuda.local.array(MOST_PLANES, np.float32), ZERO
    for c in range(channels):
        sums[c] = ZERO
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            if _within(y + dy, x + dx, size):
                row, column = np.uint64(y + dy), np.uint64(x + dx)
                unlike = bilateral_unlike(own, light[row, column], np.float32(dx), np.float32(dy))
                weight = _weight(here, near, _guide_of(seen, row, column), dx, dy, edge, unlike)
                for c in range(channels):
                    sums[c] += weight * values[b, c, row, column]
                total += weight
    norm = ONE / max(total, LEAST)
    for c in range(channels):
        out[b, c, y, x] = sums[c] * norm


@scalar
def luma_pixel(i, luma, image):
    """As `fxaa_kernel.luma_row`: one pixel of the padded rows."""
    b, y, x = pixel_of(i, luma.shape[1], luma.shape[2])
    column = min(max(x - 1, 0), image.shape[3] - 1)
    luma[b, y, x] = luma_of(image[b, 0, y, column], image[b, 1, y, column], image[b, 2, y, column])


@scalar
def stairs_pixel(i, out, luma, image, subpixel, edge_threshold, dark_threshold):
    b, y, x = pixel_of(i, image.shape[2], image.shape[3])
    is_edge = cuda.local.array(1, np.bool_)
    edge_row(is_edge, luma[b, :, x : x + 3], y, np.float32(edge_threshold), np.float32(dark_threshold))
    if is_edge[0]:
        smooth(out[b], image[b], luma[b], y, x, np.float32(subpixel))
    else:
        for c in range(image.shape[1]):
            out[b, c, y, x] = image[b, c, y, x]


luma_each, stairs_each = Each(luma_pixel), Each(stairs_pixel)
surface_each, moments_each, wavelet_each = Each(surface_pixel), Each(moments_pixel), Each(wavelet_pixel)
limits_each, bilateral_each = Each(limits_pixel), Each(bilateral_pixel)
unit_each, kindred_each = Each(unit_pixel), Each(kindred_pixel)
