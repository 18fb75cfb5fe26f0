"""Makes the blue-noise tile of this folder: ``python -m gbufrt.noise.void_and_cluster out.npz`` (two minutes)."""

from __future__ import annotations

import sys

import numpy as np

SIGMA = 1.9  # Ulichney 1993 uses 1.5; 1.9 keeps less energy in the low frequencies


def void_and_cluster(size: int, *, sigma: float = SIGMA, seed: int = 0) -> np.ndarray:
    """Rank every cell of a square torus so that every threshold of the ranks is blue noise.

    Args:
        size: cells a side.
        sigma: width in cells of the Gaussian that measures crowding.
        seed: of the initial random pattern.

    Returns:
        ``(size, size)`` uint16, a permutation of ``0 .. size * size - 1``.

    Source: Ulichney 1993, "The void-and-cluster method for dither array generation".
    """
    reach = np.minimum(np.arange(size), size - np.arange(size)).astype(np.float64)
    bell = np.exp(-(reach[:, None] ** 2 + reach[None, :] ** 2) / (2 * sigma**2))
    doubled = np.tile(bell, (2, 2))
    rng = np.random.default_rng(seed)
    count = size * size // 10
    pattern = np.zeros((size, size), dtype=bool)
    pattern.flat[rng.permutation(size * size)[:count]] = True
    crowding = np.real(np.fft.ifft2(np.fft.fft2(pattern) * np.fft.fft2(bell)))

    def add(cell: int, sign: float) -> None:
        y, x = divmod(cell, size)
        crowding[...] += sign * doubled[size - y : 2 * size - y, size - x : 2 * size - x]

    def tightest() -> int:
        return int(np.argmax(np.where(pattern, crowding, -np.inf)))

    def emptiest() -> int:
        return int(np.argmin(np.where(pattern, np.inf, crowding)))

    while True:  # spread the initial points until the tightest one is already in the largest void
        cluster = tightest()
        pattern.flat[cluster] = False
        add(cluster, -1)
        void = emptiest()
        pattern.flat[void] = True
        add(void, +1)
        if void == cluster:
            break
    ranks = np.zeros((size, size), dtype=np.uint16)
    initial, initial_crowding = pattern.copy(), crowding.copy()
    for rank in range(count - 1, -1, -1):
        cluster = tightest()
        pattern.flat[cluster] = False
        add(cluster, -1)
        ranks.flat[cluster] = rank
    pattern[...], crowding[...] = initial, initial_crowding
    for rank in range(count, size * size):  # past half, the tightest cluster of zeros is also the largest void of ones
        void = emptiest()
        pattern.flat[void] = True
        add(void, +1)
        ranks.flat[void] = rank
    return ranks


if __name__ == "__main__":
    np.savez_compressed(sys.argv[1], ranks=void_and_cluster(256))
