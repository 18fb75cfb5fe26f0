"""Run the row bodies of `post.filters.kernel` over pictures on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver
from post.filters.constants import B3, HIT
from post.filters.fxaa_kernel import edge_row, luma_row, smooth_row
from post.filters.kernel import (
    add_moments,
    add_spread,
    add_values,
    bilateral_weights,
    edge_of,
    edge_weights,
    falloff_row,
    finish_moments,
    finish_row,
    hit_span,
    noise_row,
    surface_row,
    tap_at,
    wavelet_steps,
    wavelet_weights,
)


@driver
def surface_rows(guide, plane, depth, normal, hit, roughness, lens, pose, parallel, threads):
    batch, height, _ = depth.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            channels = depth[b], normal[b], hit[b], roughness[b]
            surface_row(guide[b], plane[b], *channels, lens[b], pose[b], parallel, y)


@driver
def moments_rows(out, light, guide, plane, radius, perspective, depth_sensitivity, normal_power, threads):
    batch, height, width = light.shape
    for thread in prange(threads):
        weights, sums = np.empty(width, np.float32), np.empty((3, width), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            edge = edge_of(guide[b], perspective, depth_sensitivity, normal_power)
            first, end = hit_span(guide[b, HIT], y)
            sums[:] = 0
            for dy in range(-radius, radius + 1):
                for dx in range(-radius, radius + 1):
                    tap = tap_at(y, first, end, dx, dy, (height, width))
                    used = weights[: tap.end - tap.first]
                    edge_weights(used, guide[b], plane[b], y, tap, edge)
                    add_moments(sums[0], sums[1], sums[2], used, light[b], y, tap)
            finish_moments(out[b], sums[0], sums[1], sums[2], light[b], y)


@driver
def wavelet_rows(out, values, guide, plane, reach, step, perspective, phi_color, phi_depth, phi_normal, threads):
    batch, planes, height, width = values.shape
    channels = planes - 1
    for thread in prange(threads):
        weights, noise, column = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
        sums = np.empty((planes + 1, width), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            edge = edge_of(guide[b], perspective, phi_depth, phi_normal)
            first, end = hit_span(guide[b, HIT], y)
            noise_row(noise, column, values[b, channels], y)
            wavelet_steps(noise, noise, values[b, channels - 1], y, phi_color)
            sums[:] = 0
            for j in range(-2, 3):
                for i in range(-2, 3):
                    tap = tap_at(y, first, end, i * step, j * step, (height, width))
                    used, share = weights[: tap.end - tap.first], np.float32(B3[i + 2] * B3[j + 2])
                    if i == 0 and j == 0:
                        used[:] = share
                    else:
                        wavelet_weights(used, guide[b], plane[b], values[b], noise, reach[b], y, tap, share, edge)
                    add_values(sums, used, values[b], tap, channels)
                    add_spread(sums[planes], used, values[b, channels], tap)
            for c in range(channels):
                finish_row(out[b, c], sums[c], sums[channels], values[b, c], guide[b, HIT], y)
            sums[channels] *= sums[channels]
            finish_row(out[b, channels], sums[planes], sums[channels], values[b, channels], guide[b, HIT], y)


@driver
def bilateral_rows(
    out, values, guide, plane, width, tolerance, radius, perspective, depth_sensitivity, normal_power, threads
):
    batch, planes, height, size = values.shape
    channels = planes - 1
    for thread in prange(threads):
        weights, falloff = np.empty(size, np.float32), np.empty(size, np.float32)
        sums = np.empty((planes, size), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            edge = edge_of(guide[b], perspective, depth_sensitivity, normal_power)
            first, end = hit_span(guide[b, HIT], y)
            sums[:] = 0
            for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                tap = tap_at(y, first, end, dx, dy, (height, size))
                used, share = weights[: tap.end - tap.first], sums[0, tap.first : tap.end]
                edge_weights(used, guide[b], plane[b], y, tap, edge)
                for i in range(used.shape[0]):
                    share[i] += used[i]
            falloff_row(falloff, sums[0], width[b], y)
            sums[0] = 0
            for dy in range(-radius, radius + 1):
                for dx in range(-radius, radius + 1):
                    tap = tap_at(y, first, end, dx, dy, (height, size))
                    used = weights[: tap.end - tap.first]
                    bilateral_weights(used, guide[b], plane[b], values[b], tolerance[b], falloff, y, tap, edge)
                    add_values(sums, used, values[b], tap, channels)
            for c in range(channels):
                finish_row(out[b, c], sums[c], sums[channels], values[b, c], guide[b, HIT], y)


@driver
def stairs_rows(out, luma, image, subpixel, edge_threshold, dark_threshold, threads):
    batch, _, height, width = image.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            luma_row(luma[row // height], image[row // height], row % height)
    for thread in prange(threads):
        is_edge = np.empty(width, np.bool_)
        limits = np.float32(edge_threshold), np.float32(dark_threshold)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            edge_row(is_edge, luma[b], y, *limits)
            smooth_row(out[b], is_edge, image[b], luma[b], y, np.float32(subpixel))
