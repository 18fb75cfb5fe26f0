"""Run the row bodies of `post.filters.kernel` over pictures on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver
from post.filters.around_kernel import alike_row, least_row, pooled_row
from post.filters.constants import COARSE_POWER, HIT
from post.filters.denoise_kernel import (
    add_moments,
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
from post.filters.room_kernel import LENGTH, ROWS, add_taps, fill, finish, kind_of, limit, parts_of, taps_at_once
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
            run = hit_run(guide[b, HIT], y, 0, width)
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
                run = hit_run(guide[b, HIT], y, run[1], width)
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
            run = hit_run(guide[b, HIT], y, 0, width)
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
                            wavelet_weights(weights, guide[b], near, light, limits, y, taps, shares, edge)
                            add_values(sums, weights, values[b], taps, channels)
                            add_spread(sums[planes], weights, variance, taps)
                run = hit_run(guide[b, HIT], y, run[1], width)
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
    out, values, flat, guide, plane, width, tolerance, radius, depth_sensitivity, normal_power,
    perspective, further, rough, squares, channels, threads,
):  # fmt: skip
    """``flat`` are the values again, in one dimension."""
    batch, planes, height, size = values.shape
    for thread in prange(threads):
        room = np.empty((ROWS + len(channels)) * LENGTH, np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            place, light, picture = b * planes * height * size, values[b, planes - 1], (height, size)
            kind = kind_of(guide[b], perspective, further, rough, squares, normal_power)
            for c in range(len(channels)):
                out[b, c, y] = values[b, c, y]
            run = hit_run(guide[b, HIT], y, 0, LENGTH)
            while run[1] > run[0]:
                fill(room, guide[b], plane[b], y, run, depth_sensitivity)
                for near in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                    for part in range(parts_of(1)):
                        taps = part_of(part, y, run, near, 1, 1, picture)
                        if taps.end > taps.first:
                            add_taps(room, guide[b], light, flat, place, run, taps, kind, ())
                limit(room, light, width[b], tolerance[b], y, run, len(channels))
                for dy in range(-radius, radius + 1):
                    dx = -radius
                    while dx <= radius:
                        count = taps_at_once(radius + 1 - dx)
                        for part in range(parts_of(count)):
                            taps = part_of(part, y, run, (dx, dy), 1, count, picture)
                            if taps.end > taps.first:
                                add_taps(room, guide[b], light, flat, place, run, taps, kind, channels)
                        dx += count
                finish(out[b], room, values[b], guide[b, HIT], y, run)
                run = hit_run(guide[b, HIT], y, run[1], LENGTH)


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
