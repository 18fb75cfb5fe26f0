"""One pixel of each filter of `post.filters.drivers`, for a GPU: it weighs its taps one by one, by the same weights."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import scalar
from post.filters.around_kernel import kindred_pixel
from post.filters.constants import B3, COARSE_POWER, HIT, MOST_PLANES
from post.filters.denoise_kernel import (
    Own,
    bilateral_limits,
    bilateral_weight,
    center_row,
    finish_moments,
    finish_row,
    limit_row,
    noise_row,
    wavelet_limits,
    wavelet_weight,
)
from post.filters.fxaa_kernel import edge_row, luma_of, smooth
from post.filters.kernel import guide_row, surface_row, unit_row
from post.filters.weight_kernel import ZERO, Near, Taps, edge_weight, edge_with, near_row, weigh_further

cuda: Any = numba.cuda
SUMS = MOST_PLANES + 1  # and the sum of the weights, or of their squares
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


@scalar
def _near(near, plane, y, x, depth_sensitivity):
    near_row(near, plane, y, x, x + 1, depth_sensitivity)
    return Near(near[0], near[1], near[2])


@scalar
def _around(y, x, dx, dy, size):
    return 0 <= y + dy < size[0] and 0 <= x + dx < size[1]


@scalar
def _further(weights, weight, guide, y, x, dx, dy, edge):
    """A weight with `weight_kernel.weigh_further`."""
    weights[0, 0] = weight
    weigh_further(weights, guide, y, Taps(y + dy, x, x + 1, dx, dy, 1, 1, 0), edge)
    return weights[0, 0]


@scalar
def _surface_weight(weights, guide, here, near, y, x, dx, dy, edge):
    there = guide_row(guide, y + dy, x + dx, x + dx + 1)
    weight = edge_weight(0, here, near, 0, there, np.float32(dx), np.float32(dy), edge, ZERO)
    return _further(weights, weight, guide, y, x, dx, dy, edge)


@scalar
def _add(sums, weight, values, channels, y, x):
    """Add a tap to the sums of `weight_kernel.add_values`."""
    for c in range(channels):
        sums[c, 0] += weight * values[c, y, x]
    sums[channels, 0] += weight


@scalar
def _finish(out, sums, total, before, guide, channels, y, x):
    for c in range(channels):
        known = guide[HIT, :, x : x + 1]
        finish_row(out[c, :, x : x + 1], sums[c], total, before[c, :, x : x + 1], known, y)


@scalar
def moments_pixel(i, out, light, guide, plane, radius, perspective, depth_sensitivity, squares):
    b, y, x = pixel_of(i, light.shape[1], light.shape[2])
    weights, prepared = cuda.local.array((1, 1), np.float32), cuda.local.array((3, 1), np.float32)
    sums = cuda.local.array((3, 1), np.float32)
    edge, near = (
        edge_with(guide[b], perspective, squares, COARSE_POWER),
        _near(prepared, plane[b], y, x, depth_sensitivity),
    )
    here, size = guide_row(guide[b], y, x, x + 1), light.shape[1:]
    sums[:] = 0
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            if _around(y, x, dx, dy, size):
                weight = _surface_weight(weights, guide[b], here, near, y, x, dx, dy, edge)
                away = light[b, y + dy, x + dx] - light[b, y, x]
                sums[0, 0] += weight
                sums[1, 0] += weight * away
                sums[2, 0] += weight * away * away
    finish_moments(out[b, :, :, x : x + 1], sums[0], sums[1], sums[2], light[b, :, x : x + 1], y)


@scalar
def wavelet_pixel(
    i, out, values, guide, plane, reach, step, perspective, phi_color, phi_depth, phi_normal, squares
):  # fmt: skip
    b, y, x = pixel_of(i, values.shape[2], values.shape[3])
    planes, size = values.shape[1], values.shape[2:]
    channels, first = planes - 1, max(x - 1, 0)
    weights, prepared = cuda.local.array((1, 1), np.float32), cuda.local.array((3, 1), np.float32)
    limits, rows = cuda.local.array((2, 1), np.float32), cuda.local.array((2, 3), np.float32)
    sums = cuda.local.array((SUMS, 1), np.float32)[: planes + 1]
    edge, near = edge_with(guide[b], perspective, squares, phi_normal), _near(prepared, plane[b], y, x, phi_depth)
    light, variance, here = values[b, channels - 1], values[b, channels], guide_row(guide[b], y, x, x + 1)
    noise_row(rows[0], rows[1], variance[:, first : x + 2], y)
    limits[0, 0] = rows[0, x - first]
    wavelet_limits(limits, light[:, x : x + 1], reach[b, :, x : x + 1], y, phi_color)
    own = Own(light[y, x : x + 1], limits[0], limits[1])
    center_row(sums, values[b, :, :, x : x + 1], y, (0, 1))
    for j in range(-2, 3):
        for i in range(-2, 3):
            dx, dy = i * step, j * step
            if (i != 0 or j != 0) and _around(y, x, dx, dy, size):
                there, other = guide_row(guide[b], y + dy, x + dx, x + dx + 1), light[y + dy, x + dx : x + dx + 1]
                away = np.float32(dx), np.float32(dy)
                weight = np.float32(B3[j + 2] * B3[i + 2]) * wavelet_weight(
                    0, here, near, own, 0, there, other, *away, edge
                )
                weight = _further(weights, weight, guide[b], y, x, dx, dy, edge)
                _add(sums, weight, values[b], channels, y + dy, x + dx)
                sums[planes, 0] += weight * weight * variance[y + dy, x + dx]
    _finish(out[b], sums, sums[channels], values[b], guide[b], channels, y, x)
    sums[channels, 0] *= sums[channels, 0]
    _finish(out[b, channels:], sums[planes:], sums[channels], values[b, channels:], guide[b], 1, y, x)


@scalar
def limits_pixel(i, width, tolerance, light, variance, sigma, sensitivity, phi_color):
    b, y, x = pixel_of(i, light.shape[1], light.shape[2])
    rows, first = cuda.local.array((2, 3), np.float32), max(x - 1, 0)
    noise_row(rows[0], rows[1], variance[b, :, first : x + 2], y)
    tolerance[b, y, x] = rows[0, x - first]
    limits = np.float32(sigma), np.float32(sensitivity), np.float32(phi_color)
    one = width[b, :, x : x + 1], tolerance[b, :, x : x + 1], light[b, :, x : x + 1], variance[b, :, x : x + 1]
    limit_row(*one, y, *limits)


@scalar
def bilateral_pixel(
    i, out, values, guide, plane, width, tolerance, radius, perspective, depth_sensitivity, normal_power, squares
):  # fmt: skip
    b, y, x = pixel_of(i, values.shape[2], values.shape[3])
    channels, size = values.shape[1] - 1, values.shape[2:]
    weights, prepared = cuda.local.array((1, 1), np.float32), cuda.local.array((3, 1), np.float32)
    limits, sums = cuda.local.array((2, 1), np.float32), cuda.local.array((SUMS, 1), np.float32)
    edge = edge_with(guide[b], perspective, squares, normal_power)
    near, here = _near(prepared, plane[b], y, x, depth_sensitivity), guide_row(guide[b], y, x, x + 1)
    sums[:] = 0
    for dx, dy in FOUR:
        if _around(y, x, dx, dy, size):
            sums[0, 0] += _surface_weight(weights, guide[b], here, near, y, x, dx, dy, edge)
    bilateral_limits(limits, sums[0], width[b, :, x : x + 1], tolerance[b, :, x : x + 1], y)
    sums[0] = 0
    light = values[b, channels]
    own = Own(light[y, x : x + 1], limits[0], limits[1])
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            if _around(y, x, dx, dy, size):
                there, other = guide_row(guide[b], y + dy, x + dx, x + dx + 1), light[y + dy, x + dx : x + dx + 1]
                away = np.float32(dx), np.float32(dy)
                weight = bilateral_weight(0, here, near, own, 0, there, other, *away, edge)
                weight = _further(weights, weight, guide[b], y, x, dx, dy, edge)
                _add(sums, weight, values[b], channels, y + dy, x + dx)
    _finish(out[b], sums, sums[channels], values[b], guide[b], channels, y, x)


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
