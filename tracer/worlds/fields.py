"""Smooth random fields that landscapes are made of."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Field = NDArray[np.float64]


def smoothstep(low: float, high: float, x: ArrayLike) -> Field:
    """0 below ``low``, 1 above ``high`` (or the other way round), with level ends."""
    t = np.clip((np.asarray(x, np.float64) - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def value_noise(size: tuple[int, ...], cell: float, rng: np.random.Generator) -> Field:
    """Value noise in [-1, 1] on a 2D or 3D grid, with features ``cell`` voxels wide."""
    lattice = rng.uniform(-1.0, 1.0, [int(n / cell) + 3 for n in size])
    for axis, n in enumerate(size):
        at = np.arange(n) / cell
        low = at.astype(int)
        t = at - low
        t = (t * t * t * (t * (6.0 * t - 15.0) + 10.0)).reshape([-1 if a == axis else 1 for a in range(len(size))])
        lattice = np.take(lattice, low, axis) * (1.0 - t) + np.take(lattice, low + 1, axis) * t
    return lattice


def fractal_noise(size: tuple[int, ...], cell: float, rng: np.random.Generator, *, octaves: int = 4) -> Field:
    """Octaves of `value_noise`, each half as wide and half as strong, scaled to about [-1, 1]."""
    total = sum(0.5**o * value_noise(size, max(cell * 0.5**o, 1.0), rng) for o in range(octaves))
    return np.asarray(total) / (2.0 - 0.5 ** (octaves - 1)) * 1.4


def terraces(height: Field, step: float, *, sharpness: float = 0.75) -> Field:
    """Steps of ``step`` with steep risers: the share ``sharpness`` of every step is level."""
    whole = np.floor(height / step)
    return (whole + smoothstep(sharpness, 1.0, height / step - whole)) * step
