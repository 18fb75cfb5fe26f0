"""Run the row bodies of `post.filters.kernel` over pictures on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver
from post.filters.around_kernel import alike_row, least_row, pooled_row
from post.filters.constants import COARSE_POWER, HIT
from post.filters.denoise_kernel import (
    add_moments,
    bilateral_limits,
    bilateral_weights,
    center_row,
    finish_moments,
    finish_row,
    limits_row,
    noise_row,
    spline_shares,
    wavelet_limits,
    wavelet_weights,
)
from post.filters.fxaa_kernel import edge_row, luma_row, smooth_row
from post.filters.kernel import edge_of, hit_run, surface_row, unit_row
from post.filters.weight_kernel import (
    GROUP,
    PARTS,
    add_spread,
    add_values,
    edge_with,
    near_row,
    part_of,
    surface_weights,
)


@driver
def surface_rows(guide, plane, depth, normal, hit, roughness, lens, pose, parallel, threads):
    batch, height, width = depth.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            channels = depth[b], normal[b], hit[b], roughness[b]
            surface_row(guide[b], plane[b], *channels, lens[b], pose[b], parallel, y, 0, width)


@driver
def unit_rows(out, vector, fallback, threads):
    batch, _, height, width = vector.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            unit_row(out[b], vector[b], fallback[b], y, 0, width)


@driver
def moments_rows(out, light, guide, plane, radius, perspective, depth_sensitivity, squares, threads):
    batch, height, width = light.shape
    side = 2 * radius + 1
    for thread in prange(threads):
        weights, near = np.empty((GROUP, width), np.float32), np.empty((3, width), np.float32)
        sums = np.empty((3, width), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            edge = edge_with(guide[b], perspective, squares, COARSE_POWER)
            near_row(near, plane[b], y, 0, width, depth_sensitivity)
            run = hit_run(guide[b, HIT], y, 0)
            sums[:] = 0
            while run[1] > run[0]:
                for dy in range(-radius, radius + 1):
                    for i in range(0, side, GROUP):
                        for part in range(PARTS):
                            taps = part_of(part, y, run, (i - radius, dy), 1, min(side - i, GROUP), (height, width))
                            if taps.end == taps.first:
                                continue
                            surface_weights(weights, guide[b], near, y, taps, edge)
                            add_moments(sums, weights, light[b], y, taps)
                run = hit_run(guide[b, HIT], y, run[1])
            finish_moments(out[b], sums[0], sums[1], sums[2], light[b], y)


@driver
def wavelet_rows(
    out, values, guide, plane, reach, step, perspective, phi_color, phi_depth, phi_normal, squares, threads
):
    batch, planes, height, width = values.shape
    channels = planes - 1
    for thread in prange(threads):
        weights, near = np.empty((GROUP, width), np.float32), np.empty((3, width), np.float32)
        limits = np.empty((3, width), np.float32)
        sums = np.empty((planes + 1, width), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            light, variance = values[b, channels - 1], values[b, channels]
            edge = edge_with(guide[b], perspective, squares, phi_normal)
            near_row(near, plane[b], y, 0, width, phi_depth)
            run = hit_run(guide[b, HIT], y, 0)
            noise_row(limits[0], limits[1], variance, y)
            wavelet_limits(limits, light, reach[b], y, phi_color)
            sums[:] = 0
            while run[1] > run[0]:
                center_row(sums, values[b], y, run)
                for j in range(-2, 3):
                    for i in (-2, 1):
                        count, place = 3 if i < 0 and j != 0 else 2, (i * step, j * step)
                        shares = spline_shares(i, j)
                        for part in range(PARTS):
                            taps = part_of(part, y, run, place, step, count, (height, width))
                            if taps.end == taps.first:
                                continue
                            given = guide[b], near, light, limits[0], limits[1]
                            wavelet_weights(weights, *given, y, taps, shares, edge)
                            add_values(sums, weights, values[b], taps, channels)
                            add_spread(sums[planes], weights, variance, taps)
                run = hit_run(guide[b, HIT], y, run[1])
            for c in range(channels):
                finish_row(out[b, c], sums[c], sums[channels], values[b, c], guide[b, HIT], y)
            sums[channels] *= sums[channels]
            finish_row(out[b, channels], sums[planes], sums[channels], variance, guide[b, HIT], y)


@driver
def limits_rows(width, tolerance, light, variance, sigma, sensitivity, phi_color, threads):
    batch, height, size = light.shape
    for thread in prange(threads):
        column = np.empty(size, np.float32)
        limits = np.float32(sigma), np.float32(sensitivity), np.float32(phi_color)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            limits_row(width[b], tolerance[b], column, light[b], variance[b], y, *limits)


@driver
def bilateral_rows(
    out, values, guide, plane, width, tolerance, radius, perspective, depth_sensitivity, normal_power, squares, threads
):
    batch, planes, height, size = values.shape
    channels, side = planes - 1, 2 * radius + 1
    for thread in prange(threads):
        weights, near = np.empty((GROUP, size), np.float32), np.empty((3, size), np.float32)
        limits = np.empty((2, size), np.float32)
        sums = np.empty((planes, size), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            edge = edge_with(guide[b], perspective, squares, normal_power)
            near_row(near, plane[b], y, 0, size, depth_sensitivity)
            sums[0] = 0
            run = hit_run(guide[b, HIT], y, 0)
            while run[1] > run[0]:
                for place in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                    for part in range(PARTS):
                        taps = part_of(part, y, run, place, 1, 1, (height, size))
                        if taps.end == taps.first:
                            continue
                        surface_weights(weights, guide[b], near, y, taps, edge)
                        add_values(sums, weights, values[b], taps, 0)
                run = hit_run(guide[b, HIT], y, run[1])
            bilateral_limits(limits, sums[0], width[b], tolerance[b], y)
            sums[:] = 0
            run = hit_run(guide[b, HIT], y, 0)
            while run[1] > run[0]:
                for dy in range(-radius, radius + 1):
                    for i in range(0, side, GROUP):
                        for part in range(PARTS):
                            taps = part_of(part, y, run, (i - radius, dy), 1, min(side - i, GROUP), (height, size))
                            if taps.end == taps.first:
                                continue
                            light = values[b, channels]
                            bilateral_weights(weights, guide[b], near, light, limits[0], limits[1], y, taps, edge)
                            add_values(sums, weights, values[b], taps, channels)
                run = hit_run(guide[b, HIT], y, run[1])
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


@driver
def pooled_rows(out, value, mask, radius, threads):
    batch, _, height, width = value.shape
    for thread in prange(threads):
        scratch = np.empty((4, width + 2 * radius), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            pooled_row(out[b], scratch, value[b], mask[b], radius, y)


@driver
def least_rows(out, value, radius, threads):
    batch, height, width = value.shape
    for thread in prange(threads):
        scratch = np.empty(width + 2 * radius, np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            least_row(out[b], scratch, value[b], radius, y)


@driver
def alike_rows(same, guide, plane, perspective, threads):
    batch, _, height, width = same.shape
    for thread in prange(threads):
        weights = np.empty(width, np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            edge = edge_of(guide[b], perspective, 1.0, COARSE_POWER)
            alike_row(same[b], weights, guide[b], plane[b], edge, y)
