"""Run the row bodies of `post.display.kernel` over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

import numpy as np
from numba import prange

from gbufrt.compute.each import Each, pixel_of
from gbufrt.compute.kernel import driver, scalar
from post.display.constants import STRIP
from post.display.kernel import agx_row, encode_row, histogram_row, vignette_row


@driver
def agx_rows(out, color, exposure, contrast, saturation, inset, outset, threads):
    batch, _, height, width = color.shape
    for thread in prange(threads):
        look = np.float32(contrast), np.float32(saturation)
        for row in range(thread, batch * height, threads):
            b, y = row // height, row % height
            agx_row(out[b], color[b], y, 0, width, exposure[b], *look, inset, outset)


@scalar
def agx_pixel(i, out, color, exposure, contrast, saturation, inset, outset):
    b, y, x = pixel_of(i, color.shape[2], color.shape[3])
    look = np.float32(contrast), np.float32(saturation)
    agx_row(out[b], color[b], y, x, x + 1, exposure[b], *look, inset, outset)


agx_each = Each(agx_pixel)


@driver
def encode_rows(out, image, threads):
    batch, _, height, width = image.shape
    for thread in prange(threads):
        for row in range(thread, batch * height, threads):
            encode_row(out[row // height], image[row // height], row % height, 0, width)


@scalar
def encode_pixel(i, out, image):
    b, y, x = pixel_of(i, image.shape[2], image.shape[3])
    encode_row(out[b], image[b], y, x, x + 1)


encode_each = Each(encode_pixel)


@driver
def vignette_rows(out, image, strength, inner, outer, threads):
    batch, _, height, width = image.shape
    for thread in prange(threads):
        circles = np.float32(strength), np.float32(inner), np.float32(outer - inner)
        for row in range(thread, batch * height, threads):
            vignette_row(out[row // height], image[row // height], row % height, 0, width, *circles)


@scalar
def vignette_pixel(i, out, image, strength, inner, outer):
    b, y, x = pixel_of(i, image.shape[2], image.shape[3])
    circles = np.float32(strength), np.float32(inner), np.float32(outer - inner)
    vignette_row(out[b], image[b], y, x, x + 1, *circles)


vignette_each = Each(vignette_pixel)


@driver
def histogram_rows(out, color, threads):
    """``out`` ``(B, strips, 2, BINS)`` float64 is 0 before: counts and sums of each strip."""
    batch, _, height, width = color.shape
    strips = out.shape[1]
    for thread in prange(threads):
        stops = np.empty(width, np.float32)
        for item in range(thread, batch * strips, threads):
            b, strip = item // strips, item % strips
            for y in range(strip * STRIP, min((strip + 1) * STRIP, height)):
                histogram_row(out[b, strip, 0], out[b, strip, 1], stops, color[b], y)
