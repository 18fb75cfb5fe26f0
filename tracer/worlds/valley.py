"""The built-in world: a lake village under cliffs, late in the afternoon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracer.scene.scene import Scene, Sky, Sun
from tracer.worlds import flora, land
from tracer.worlds.canvas import Canvas
from tracer.worlds.cave import cave
from tracer.worlds.hall import hall
from tracer.worlds.motion import instances
from tracer.worlds.outskirts import bridge, meadow, road, windmill
from tracer.worlds.regions.landscape import plain_of
from tracer.worlds.views import views
from tracer.worlds.village import village

SUN = Sun(direction=(-0.80, 0.52, 0.34), irradiance=(4.3, 3.2, 2.0), angular_radius=0.6)
SKY = Sky(zenith=(0.07, 0.19, 0.62), horizon=(0.46, 0.60, 0.90), ground=(0.30, 0.34, 0.40))

PATH_SECONDS = 40  # the longest path
CHERRIES = ((161, 107), (117, 116), (221, 104), (157, 92), (122, 122), (200, 184), (60, 128))

CLEAR = (
    (150, 92, 228, 186),  # the village
    (143, 10, 160, 112),  # the mine and its track
    (160, 66, 216, 104),  # the hall
    (33, 101, 56, 123),  # the mill
    (88, 88, 126, 108),  # the bridge
    (122, 99, 144, 119),  # the cottage
)
"""Where nothing grows: x, z, x, z."""


def valley(seed: int = 0) -> Scene:
    """The built-in world.

    A lake with a shore and a fall, a village with a plaza of polished stone, a hall with coloured walls, a mine lit by
    lamps, a windmill, woods and cliffs; mill sails, a boat, a mine cart, a walker and three lanterns move.

    Args:
        seed: varies the land and what grows on it; the village stays where it is.

    Returns:
        The scene, 256 x 96 x 256 voxels with its low corner at the origin.
    """
    land_rng, flora_rng, detail_rng = (np.random.default_rng([seed, k]) for k in range(3))
    canvas = Canvas(land.SIZE)
    height = land.heights(land_rng)
    land.paint(canvas, height, land_rng)
    top = np.clip(np.rint(height).astype(np.int64), 4, land.SIZE[1] - 2)
    road(canvas, top)
    village(canvas, detail_rng)
    hall(canvas)
    cave(canvas, detail_rng)
    windmill(canvas)
    bridge(canvas)
    meadow(canvas, top)
    trees, herbs = _free(top, reach=10.0, tall=24), _free(top, reach=5.0, tall=4)
    for x, z in CHERRIES:
        flora.cherry(canvas, x, int(top[x, z]), z, flora_rng)
    flora.reeds(canvas, top, herbs, land.WATER, flora_rng)
    flora.forest(canvas, top, trees & (top > land.WATER + 1), flora_rng)
    flora.herbs(canvas, top, herbs, flora_rng)
    world = canvas.world()
    sky = replace(SKY, plain=plain_of(world))
    return Scene(world=world, instances=instances(), sun=SUN, sky=sky, views=views())


def _free(top: NDArray[np.int64], *, reach: float, tall: int) -> NDArray[np.bool_]:
    """Where plants ``tall`` voxels high that ``reach`` so far to the side hide neither buildings nor a view's eye."""
    free = np.ones(top.shape, bool)
    for x0, z0, x1, z1 in CLEAR:
        free[x0:x1, z0:z1] = False
    x, z = np.indices(top.shape) + 0.5
    for ex, ey, ez in {tuple(view.eye(t)) for view in views().values() for t in range(PATH_SECONDS)}:
        free &= (np.hypot(x - ex, z - ez) > reach) | (ey > top + tall)
    return free & (top < land.UPPER + 12)
