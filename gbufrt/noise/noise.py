"""Noise that depends on pixel, frame index and seed alone, never on the position in a batch.

`blue_noise` is the default; `hilbert_r2` is the alternative of XeGTAO; `pixel_hash` is white.
"""

from __future__ import annotations

import math
from functools import cache
from importlib.resources import files

import numpy as np
import torch
from torch import Tensor

from gbufrt.compute.resident import resident_on
from gbufrt.numeric import check_counts

TILE = 256
SLICES = 128
GOLDEN = (math.sqrt(5) - 1) / 2
PLASTIC = 1.32471795724474602596  # root of x^3 = x + 1: the two-dimensional golden ratio (Roberts 2018, "R2")


def blue_noise(
    height: int,
    width: int,
    *,
    index: int | Tensor = 0,
    dims: int = 1,
    seed: int = 0,
    device: torch.device | str | None = None,
) -> Tensor:
    """Blue noise over the picture, low-discrepancy over time.

    A 256x256 void-and-cluster tile repeats over the picture; each frame adds the golden ratio modulo 1, for 128
    frames; each dimension and seed reads the tile at another toroidal offset.

    Args:
        height: H in pixels.
        width: W in pixels.
        index: frame number; on a device it may be a 0-dim integer tensor there, so that a captured CUDA graph makes
            other noise when it is replayed with another number in it.
        dims: how many independent numbers a pixel needs.
        seed: each seed gives another noise.
        device: where to put it.

    Returns:
        ``(dims, H, W)`` float32 in [0, 1).

    Raises:
        TypeError: index or seed is no whole number.

    Source: Ulichney 1993 (void and cluster); Wolfe et al. 2022 on golden-ratio animation.
    """
    check_counts(index=index, seed=seed)
    tile = resident_on(torch.device(device or "cpu"), _tile, torch.float32)
    number = index.double() if isinstance(index, Tensor) else index  # rounds once, as Python's floats do
    wide = (tile + number % SLICES * GOLDEN).frac().repeat(1, 1 - (-width // TILE))
    rows = torch.arange(height, device=tile.device)
    planes = tile.new_empty(dims, height, width)
    for dim, plane in enumerate(planes):
        step = dim + 1 + 101 * seed
        dx, dy = int(TILE * (step / PLASTIC % 1)), int(TILE * (step / PLASTIC**2 % 1))
        torch.index_select(wide[:, dx : dx + width], 0, (rows + dy) % TILE, out=plane)
    return planes


def hilbert_r2(
    height: int, width: int, *, index: int | Tensor = 0, seed: int = 0, device: torch.device | str | None = None
) -> Tensor:
    """Two numbers a pixel: the R2 sequence at the pixel's place along a 64x64 Hilbert curve, advanced by the frame.

    Returns:
        ``(2, H, W)`` float32 in [0, 1).

    Source: XeGTAO (Intel 2021); Roberts 2018 for R2.
    """
    check_counts(index=index, seed=seed)
    curve = torch.from_numpy(_hilbert(64)).to(device or "cpu")
    rows = torch.arange(height, device=curve.device) % 64
    columns = torch.arange(width, device=curve.device) % 64
    place = (curve[rows][:, columns] + 288 * (index % 64) + 4096 * seed).double()
    planes = torch.stack([0.5 + place / PLASTIC, 0.5 + place / PLASTIC**2])
    return (planes % 1.0).float().clamp_max(1 - 2**-24)


def pixel_hash(
    height: int,
    width: int,
    *,
    index: int | Tensor = 0,
    dims: int = 1,
    seed: int = 0,
    device: torch.device | str | None = None,
) -> Tensor:
    """White noise: ``(dims, H, W)`` float32 in [0, 1), by the PCG hash (Jarzynski and Olano 2020)."""
    check_counts(index=index, seed=seed)
    grid = torch.arange(height * width, device=device or "cpu", dtype=torch.int64).view(1, height, width)
    dim = torch.arange(dims, device=grid.device, dtype=torch.int64).view(-1, 1, 1)
    return _pcg(grid + _pcg(dim + _pcg(torch.zeros_like(dim) + index + (seed << 16)))).float() / 2.0**24


def radical_inverse(base: int, number: int) -> float:
    """The van der Corput sequence: digits of ``number`` in ``base``, reversed after the radix point."""
    result, scale = 0.0, 1.0 / base
    while number:
        result += scale * (number % base)
        number, scale = number // base, scale / base
    return result


def halton_jitter(index: int, *, length: int = 16) -> tuple[float, float]:
    """Camera jitter in pixels, in [-0.5, 0.5): Halton bases 2 and 3, repeating after ``length`` frames."""
    check_counts(index=index, length=length)
    if length < 1:
        raise ValueError(f"length must be at least 1, got {length}")
    place = index % length + 1
    return radical_inverse(2, place) - 0.5, radical_inverse(3, place) - 0.5


def _pcg(value: Tensor) -> Tensor:
    """One round of PCG, 24 bits out; 64-bit arithmetic stands in for unsigned 32-bit."""
    mask = 0xFFFFFFFF
    state = (value * 747796405 + 2891336453) & mask
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & mask
    return ((word >> 22) ^ word) >> 8


@cache
def _tile() -> Tensor:
    with files("gbufrt.noise").joinpath("blue_noise_256.npz").open("rb") as file:
        ranks = np.load(file)["ranks"]
    return torch.from_numpy((ranks.astype(np.float32) + 0.5) / ranks.size)


@cache
def _hilbert(size: int) -> np.ndarray:
    """Distance along the Hilbert curve that fills a ``size`` square, by quadrant from the largest down."""
    y, x = np.mgrid[0:size, 0:size]
    distance = np.zeros((size, size), dtype=np.int64)
    half = size // 2
    while half:
        right, lower = (x & half) > 0, (y & half) > 0
        distance += half * half * ((3 * right) ^ lower)
        flip = ~lower & right
        x, y = np.where(flip, size - 1 - x, x), np.where(flip, size - 1 - y, y)
        x, y = np.where(~lower, y, x), np.where(~lower, x, y)
        half //= 2
    return distance


def dithered(image: Tensor, *, index: int | Tensor = 0, seed: int = 0) -> Tensor:
    """A picture with blue noise of one 8-bit step, so that rounding to 8 bits makes no bands.

    Args:
        image: ``(..., C, H, W)`` in [0, 1].
        index: see `blue_noise`.
        seed: likewise.
    """
    channels, height, width = image.shape[-3:]
    noise = blue_noise(height, width, index=index, dims=channels, seed=seed, device=image.device).to(image.dtype)
    return (image + (noise - 0.5) / 255).clamp(0, 1)
