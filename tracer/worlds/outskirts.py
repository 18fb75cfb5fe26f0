"""What stands outside the village: the windmill on its hill, the bridge over the river, the road between them."""

from __future__ import annotations

import itertools

import numpy as np

from tracer.worlds.canvas import Canvas
from tracer.worlds.land import WATER, river_x
from tracer.worlds.village import lamp_post

MILL = (44, 44, 112)
HUB = (MILL[0] + 0.5 + 3.9, MILL[1] + 17.0, MILL[2] + 0.5 + 4.6)
BRIDGE_Z = 98


def windmill(canvas: Canvas) -> None:
    """A tapering white tower with a slate cap; its sails are an instance that turns at ``HUB``."""
    mx, my, mz = MILL
    canvas.box((mx - 8, my, mz - 8), (mx + 9, my + 34, mz + 9), "air")
    for i in range(-6, 20):
        r = 5.6 - 0.10 * max(i, 0)
        part, (x, _, z) = canvas.grid((mx - 7, my + i, mz - 7), (mx + 8, my + i + 1, mz + 8))
        away = np.hypot(x - mx - 0.5, z - mz - 0.5)
        hollow = (away < r - 1.3) & (i % 8 != 7) & (i >= 0)
        part[(away < r)] = canvas.id("masonry" if i < 3 else "timber" if i in (9, 17) else "plaster")
        part[hollow] = 0
    for i in range(7):
        part, (x, _, z) = canvas.grid((mx - 8, my + 20 + i, mz - 8), (mx + 9, my + 21 + i, mz + 9))
        part[np.hypot(x - mx - 0.5, z - mz - 0.5) < 5.6 - 0.85 * i] = canvas.id("roof_slate")
    canvas.box((mx - 1, my, mz + 4), (mx + 2, my + 5, mz + 7), "air")
    canvas.box((mx - 1, my, mz + 5), (mx + 2, my + 5, mz + 6), "planks")
    for dx, dz, tall in ((5, 0, 12), (0, 5, 11), (-5, 0, 5), (5, 0, 4)):
        canvas.put(mx + dx, my + tall, mz + dz, "glass")
        canvas.put(mx + dx, my + tall + 1, mz + dz, "glass")
    canvas.put(mx, my + 12, mz, "lamp")
    canvas.box((mx + 1, my + 16, mz + 2), (mx + 3, my + 18, mz + 4), "timber")


def bridge(canvas: Canvas) -> None:
    """A planked arch over the river with railings and four lamps."""
    middle = int(river_x(np.array(float(BRIDGE_Z))))
    for x in range(middle - 15, middle + 16):
        rise = round(4.0 * (1.0 - ((x - middle) / 15.0) ** 2))
        y = WATER + 2 + rise
        canvas.box((x, WATER + 2, BRIDGE_Z - 3), (x + 1, y, BRIDGE_Z + 4), "air")
        canvas.box((x, y - 1, BRIDGE_Z - 2), (x + 1, y, BRIDGE_Z + 3), "planks")
        canvas.box((x, y - 2, BRIDGE_Z - 3), (x + 1, y, BRIDGE_Z - 2), "timber")
        canvas.box((x, y - 2, BRIDGE_Z + 3), (x + 1, y, BRIDGE_Z + 4), "timber")
        canvas.box((x, y, BRIDGE_Z - 2), (x + 1, y + 5, BRIDGE_Z + 3), "air")
        for z in (BRIDGE_Z - 3, BRIDGE_Z + 3):
            canvas.put(x, y + 1, z, "timber")
            if x % 4 == 0:
                canvas.box((x, y, z), (x + 1, y + 2, z + 1), "timber")
    for x in (middle - 12, middle + 12):
        lamp_post(canvas, x, WATER + 2 + round(4.0 * (1.0 - 0.64)), BRIDGE_Z + 3, tall=4)


def road(canvas: Canvas, top: np.ndarray) -> None:
    """Trodden earth from the village over the bridge to the windmill, following the ground."""
    points = ((156, 100), (140, 98), (122, 98), (92, 98), (74, 104), (60, 116), (46, 120))
    for (x0, z0), (x1, z1) in itertools.pairwise(points):
        steps = 2 * max(abs(x1 - x0), abs(z1 - z0))
        for s in range(steps + 1):
            x, z = x0 + (x1 - x0) * s / steps, z0 + (z1 - z0) * s / steps
            for dx in (-1, 0, 1):
                for dz in (-1, 0, 1):
                    i, k = int(x) + dx, int(z) + dz
                    if top[i, k] > WATER:
                        canvas.put(i, int(top[i, k]) - 1, k, "path")


def meadow(canvas: Canvas, top: np.ndarray) -> None:
    """Haystacks on the slope below the mill."""
    for x, z in ((66, 92), (70, 94), (64, 97)):
        y = int(top[x, z])
        canvas.box((x - 1, y, z - 1), (x + 2, y + 2, z + 2), "hay")
        canvas.put(x, y + 2, z, "hay")
