"""A view from within the sea, for land of which nothing else is to be seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.scene.grids import BRICK
from tracer.scene.scene import Instance
from tracer.scene.view import View
from tracer.scene.world import World
from tracer.worlds.regions.height_map import HeightMap, heights_of
from tracer.worlds.regions.outlooks import SUN
from tracer.worlds.views import Point, still

Floats = NDArray[np.float64]

DIM = 14.0  # blocks below the surface, under which there is too little light
UNDER, LEAST = 2.5, 3.0  # blocks: the eye below the highest that it looks at, and below the surface
CLEAR = 1.5  # blocks round the eye that are free
STEP, TURNS = 3, 24  # blocks between places that are tried, and directions round the compass
NEAR, FAR = 3.2, 9.0  # blocks away: what is nearer hides the rest, and what is farther is lost in the water
FADES = 0.25  # per block
HALF = math.radians(38.0)  # to each side
RISE, FOV_Y = math.radians(14.0), 70.0  # of the view, for the sky in the surface overhead


def view_within(world: World, instances: tuple[Instance, ...], level: float) -> View | None:
    """The eye among what reaches up highest into the light: plants or the sea floor; None where nothing does.

    Args:
        world: whose sea it is.
        instances: what grows in it.
        level: world y of its surface.
    """
    floor = _floor(world)
    tops = floor.top.copy()
    for instance in instances:
        _raise(tops, floor, instance)
    x, z = np.nonzero((tops > level - DIM) & (tops < level))
    if not len(x):
        return None
    high = tops[x, z]
    eyes = _eyes(tops, floor.top, level)
    if not len(eyes):
        return None
    across, along, up = (points[None] - eyes[:, k, None] for k, points in ((0, x + 0.5), (2, z + 0.5), (1, high)))
    far = np.hypot(across, along)
    worth = np.where(far > NEAR, np.exp(-FADES * far), -1.0) * (far < FAR) * np.clip(1 + up / 4, 0.1, 1.6)
    scores = []
    for turn in range(TURNS):
        way = _way(turn)
        cosine = (across * way[0] + along * way[2]) / np.maximum(far, 1e-6)
        middle = 1 + 2 * (cosine > math.cos(HALF / 3))  # where the lens focuses
        scores.append((worth * middle * (cosine > math.cos(HALF))).sum(axis=1) - 0.5 * np.dot(way, SUN.direction))
    best, turn = np.unravel_index(int(np.argmax(np.stack(scores, axis=1))), (len(eyes), TURNS))
    eye = eyes[best] + np.array([floor.x0, 0.0, floor.z0])
    way = _way(int(turn)) * math.cos(RISE) + np.array([0.0, math.sin(RISE), 0.0])
    return still(
        _point(eye),
        _point(eye + 10.0 * way),
        fov_y=FOV_Y,
        description="in the sea, among what reaches up into the light",
        by_day=True,
    )


def _point(place: Floats) -> Point:
    return float(place[0]), float(place[1]), float(place[2])


def _way(turn: int) -> Floats:
    angle = 2 * math.pi * turn / TURNS
    return np.array([math.cos(angle), 0.0, math.sin(angle)])


def _floor(world: World) -> HeightMap:
    """The heights of a world without its water."""
    dry = torch.where(world.materials.water[world.bricks.long()], 0, world.bricks)
    return heights_of(replace(world, bricks=dry, shining=None))


def _raise(tops: Floats, floor: HeightMap, instance: Instance) -> None:
    """Raise heights to the blocks of an instance that hold anything."""
    model, side = instance.model, round(1 / instance.scale)
    cells = torch.argwhere(model.index > 0).cpu().numpy()
    bricks, each = model.bricks.cpu().numpy(), BRICK // side
    held = bricks.reshape(-1, each, side, each, side, each, side).max(axis=(2, 4, 6)) > 0
    n, i, j, k = np.nonzero(held[model.index.cpu().numpy()[tuple(cells.T)]])
    low = np.array(model.origin) // side
    x, y, z = (low[a] + each * cells[n, a] + part for a, part in enumerate((i, j, k)))
    a, b = x - floor.x0, z - floor.z0
    inside = (a >= 0) & (a < len(tops)) & (b >= 0) & (b < tops.shape[1])
    np.maximum.at(tops, (a[inside], b[inside]), y[inside] + 1.0)


def _eyes(tops: Floats, floor: Floats, level: float) -> Floats:
    """``(N, 3)`` places for the eye in free water, counted from the first column."""
    reach, found = round(FAR), []
    for i in range(reach, len(tops) - reach, STEP):
        for j in range(reach, tops.shape[1] - reach, STEP):
            around = tops[i - reach : i + reach + 1, j - reach : j + reach + 1]
            if not np.isfinite(floor[i, j]):
                continue
            y = min(max(around[around < level].max(initial=-math.inf) - UNDER, floor[i, j] + 2 * CLEAR), level - LEAST)
            beside = tops[i - 1 : i + 2, j - 1 : j + 2]
            if y > level - DIM and beside.max() < y - CLEAR:
                found.append((i + 0.5, y, j + 0.5))
    return np.array(found)
