"""Run the row bodies of `post.filters.kernel` over pictures on CPU threads."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.kernel import driver
from post.filters.around_kernel import alike_row, least_row, pooled_row
from post.filters.bilateral_kernel import add_taps, finish, limit, limits_row, noise_row, taps_at_once, unlit
from post.filters.constants import COARSE_POWER, HIT
from post.filters.denoise_kernel import (
    add_moments,
    add_wavelet,
    begin_moments,
    begin_wavelet,
    finish_moments,
    finish_wavelet,
    moments_at_once,
)
from post.filters.fxaa_kernel import edge_row, luma_row, smooth_row
from post.filters.kernel import edge_of, hit_run, part_of, parts_of, surface_row, unit_row
from post.filters.weight_kernel import LENGTH, ROWS, fill, kind_of


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
def moments_rows(out, light, guide, plane, radius, depth_sensitivity, perspective, further, rough, squares, threads):
    batch, height, width = light.shape
    for thread in prange(threads):
        room = np.empty((ROWS + 2) * LENGTH, np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            kind = kind_of(guide[b], perspective, further, rough, squares, COARSE_POWER)
            run = hit_run(guide[b, HIT], y, 0, LENGTH)
            if run[1] - run[0] < width:
                out[b, 0, y], out[b, 1, y] = light[b, y], 0
            while run[1] > run[0]:
                fill(room, guide[b], plane[b], y, run, depth_sensitivity)
                begin_moments(room, light[b], y, run)
                for dy in range(-radius, radius + 1):
                    dx = -radius
                    while dx <= radius:
                        count = moments_at_once(radius + 1 - dx)
                        for part in range(parts_of(count)):
                            taps = part_of(part, y, run, (dx, dy), 1, count, (height, width))
                            if taps.end > taps.first:
                                add_moments(room, guide[b], light[b], run, taps, kind)
                        dx += count
                finish_moments(out[b], room, y, run)
                run = hit_run(guide[b, HIT], y, run[1], LENGTH)


@driver
def wavelet_rows(
    out, values, flat, guide, plane, reach, step, phi_color, phi_depth, phi_normal, perspective, further, rough,
    squares, channels, threads,
):  # fmt: skip
    """``flat`` are the values again, in one dimension."""
    batch, planes, height, width = values.shape
    for thread in prange(threads):
        room = np.empty((ROWS + planes - 1) * LENGTH, np.float32)
        noise = np.empty((2, width), np.float32)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            place, picture = b * planes * height * width, (height, width)
            kind = kind_of(guide[b], perspective, further, rough, squares, phi_normal)
            run = hit_run(guide[b, HIT], y, 0, LENGTH)
            if run[1] - run[0] < width:
                for c in range(planes):
                    out[b, c, y] = values[b, c, y]
            if run[1] > run[0]:
                noise_row(noise[0], noise[1], values[b, planes - 1], y)
            while run[1] > run[0]:
                fill(room, guide[b], plane[b], y, run, phi_depth)
                begin_wavelet(room, values[b], noise[0], reach[b], y, run, phi_color, channels)
                for j in range(5):
                    for part in range(parts_of(5)):
                        taps = part_of(part, y, run, (-2 * step, (j - 2) * step), step, 5, picture)
                        if taps.end > taps.first:
                            add_wavelet(room, guide[b], flat, place, run, taps, j, kind, channels)
                finish_wavelet(out[b], room, values[b], guide[b, HIT], y, run, channels)
                run = hit_run(guide[b, HIT], y, run[1], LENGTH)


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
                unlit(room, run)
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
