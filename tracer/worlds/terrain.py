"""Plain rolling terrain: what tracing speed is measured on."""

from __future__ import annotations

import numpy as np

from tracer.scene.scene import Scene, Sky
from tracer.scene.view import View
from tracer.worlds.canvas import Canvas
from tracer.worlds.fields import fractal_noise
from tracer.worlds.regions.landscape import plain_of
from tracer.worlds.views import still


def terrain(size: tuple[int, int, int] = (256, 128, 256), seed: int = 0) -> Scene:
    """Rolling hills of turf over soil and rock, with one view along them to the horizon.

    Args:
        size: voxels along x, y and z, each at least 16.
        seed: varies the hills.

    Raises:
        ValueError: a side is shorter than 16.
    """
    if len(size) != 3 or min(size) < 16:
        raise ValueError(f"size must be three sides of at least 16 voxels, got {size}")
    rng = np.random.default_rng(seed)
    nx, ny, nz = size
    relief = fractal_noise((nx, nz), 64.0, rng, octaves=5)
    height = np.clip(np.rint(ny * (0.36 + 0.24 * relief)), 2, ny - 8).astype(np.int64)
    canvas = Canvas(size)
    depth = height[:, None, :] - np.arange(ny)[None, :, None]
    turf = canvas.ids(("moss", "grass", "meadow"))[rng.integers(0, 3, (nx, nz))]
    ids = np.where(depth > 4, canvas.id("rock"), canvas.id("dirt"))
    ids = np.where(depth == 1, turf[:, None, :], ids)
    canvas.voxels[...] = np.where(depth > 0, ids, 0)
    world = canvas.world()
    return Scene(world=world, sky=Sky(plain=plain_of(world)), views={"horizon": _horizon(size, height)})


def _horizon(size: tuple[int, int, int], height: np.ndarray) -> View:
    """From a corner, above the ground, to the far corner at the same height."""
    nx, _, nz = size
    x, z = nx // 16, nz - 1 - nz // 16
    eye = (x + 0.5, float(height[: nx // 4, 3 * nz // 4 :].max()) + 6.5, z + 0.5)
    return still(eye, (0.8 * nx, eye[1] - 12.0, 0.2 * nz), fov_y=60.0, description="over the hills to the horizon")
