"""Voxel models that move over the built-in world: mill sails, a boat, a mine cart, a walker, paper lanterns."""

from __future__ import annotations

import numpy as np

from tracer.scene.world import World
from tracer.worlds.canvas import Canvas


def sails() -> World:
    """Four lattice sails round an axle along z; the middle is at (0.5, 0.5, 0.5)."""
    canvas = Canvas((49, 49, 4), origin=(-24, -24, -1))
    for turn in range(4):
        blade = np.zeros((25, 7), np.int16)  # along the arm, across it
        blade[:, 0] = canvas.id("timber")
        blade[5:25, 1:7] = canvas.id("canvas")
        blade[5:25:5, :] = canvas.id("timber")
        blade[5:25, 6] = canvas.id("timber")
        blade[6:9, 2:6] = canvas.id("cloth_red")
        plane = np.zeros((49, 49), np.int16)
        plane[24:49, 24:31] = blade
        plane = np.rot90(plane, turn)
        target = canvas.voxels[:, :, 2]
        target[plane > 0] = plane[plane > 0]
    canvas.box((-2, -2, -1), (3, 3, 3), "timber")
    canvas.box((-1, -1, 2), (2, 2, 3), "iron")
    return canvas.world()


def boat() -> World:
    """A sailing boat, bow toward +x, its waterline at y = 0, made for a quarter-unit voxel."""
    canvas = Canvas((46, 52, 18), origin=(-22, -4, -9))
    for y in range(-4, 5):
        part, (x, _, z) = canvas.grid((-22, y, -9), (24, y + 1, 9))
        length, beam = 19.0 + 0.7 * (y + 4), 5.4 + 0.42 * (y + 4)
        edge = np.abs(z) / beam + np.where(x > 0, (x / (length + 2.0)) ** 2, (np.abs(x) / length) ** 6)
        inside = edge + 0.0 * part < 1.0
        hollow = edge * (1.0 + 1.2 / beam) + 0.10 < 1.0
        name = "cloth_red" if y == 2 else "white_wall" if y == 3 else "timber" if y == 4 else "planks"
        part[inside] = canvas.id(name)
        if y >= 2:
            part[inside & hollow] = 0
        elif y == 1:
            part[inside & hollow] = canvas.id("planks")
    canvas.box((-1, 1, -1), (1, 46, 1), "timber")
    canvas.box((-17, 9, 0), (0, 10, 1), "timber")
    for y in range(11, 43):
        reach = round(16.0 * (1.0 - (y - 11) / 33.0) ** 0.8)
        belly = 1 if 15 < y < 34 else 0
        stripe = "cloth_red" if (y // 6) % 3 == 1 else "canvas"
        canvas.box((-1 - reach, y, belly), (-1, y + 1, belly + 1), stripe)
    for y in range(12, 36):
        canvas.box((1, y, 0), (2 + round(15.0 * (1.0 - (y - 12) / 25.0)), y + 1, 1), "canvas")
    canvas.box((19, 5, -1), (20, 9, 0), "iron")
    canvas.box((18, 9, -2), (20, 11, 0), "lamp")
    canvas.box((18, 11, -2), (20, 12, 0), "iron")
    canvas.box((-9, 2, -3), (-5, 5, 3), "hay")
    canvas.box((6, 2, -2), (9, 4, 2), "timber")
    return canvas.world()


def mine_cart() -> World:
    """An iron cart full of ore and gold, rolling along z on wheels at y = 0, made for a quarter-unit voxel."""
    canvas = Canvas((16, 18, 24), origin=(-8, 0, -12))
    for z in (-8, 5):
        for x in (-7, 6):
            canvas.box((x, 0, z), (x + 1, 4, z + 4), "iron")
        canvas.box((-6, 1, z + 1), (6, 2, z + 3), "timber")
    for y in range(3, 11):
        w, d = 5 + (y - 3) // 3, 9 + (y - 3) // 3
        canvas.shell((-w, y, -d), (w, y + 1, d), "iron" if y in (4, 10) else "copper")
        if y < 5:
            canvas.box((-w, y, -d), (w, y + 1, d), "iron")
    rng = np.random.default_rng(7)
    part, (x, y, z) = canvas.grid((-6, 5, -10), (6, 14, 10))
    heap = (y < 12.5 - 0.030 * (x * x + 0.45 * z * z) + rng.uniform(-0.9, 0.9, part.shape)) & (part == 0)
    kinds = canvas.ids(("rock_dark", "rock_dark", "gold", "rock", "gold"))
    part[heap] = kinds[rng.integers(0, 5, part.shape)][heap]
    canvas.box((0, 10, 11), (1, 16, 12), "iron")
    canvas.box((0, 16, 10), (2, 18, 12), "lamp")
    return canvas.world()


def walker_body() -> World:
    """Head, hat and body of a figure 14 voxels tall that faces +z; hips at y = 0, made for a quarter-unit voxel."""
    canvas = Canvas((8, 14, 8), origin=(-4, -1, -4))
    canvas.box((-2, 0, -1), (2, 5, 1), "cloth_blue")
    canvas.box((-2, 0, -1), (2, 1, 1), "timber")
    canvas.box((-2, 5, -2), (2, 9, 2), "skin")
    canvas.box((-2, 6, -2), (2, 9, -1), "hair")
    canvas.box((-2, 8, -2), (2, 9, 2), "hair")
    canvas.put(-2, 7, 1, "hair")
    canvas.put(1, 7, 1, "hair")
    canvas.box((-3, 9, -3), (3, 10, 3), "hay")
    canvas.box((-2, 10, -2), (2, 11, 2), "hay")
    canvas.box((-2, 1, -3), (2, 5, -1), "planks")
    return canvas.world()


def walker_leg() -> World:
    """A leg that hangs from y = 0."""
    canvas = Canvas((2, 5, 3), origin=(-1, -5, -1))
    canvas.box((-1, -4, -1), (1, 0, 1), "timber")
    canvas.box((-1, -5, -1), (1, -4, 2), "hair")
    return canvas.world()


def walker_arm() -> World:
    """An arm that hangs from y = 0."""
    canvas = Canvas((1, 5, 2), origin=(0, -5, -1))
    canvas.box((0, -5, -1), (1, 0, 1), "cloth_blue")
    canvas.box((0, -5, -1), (1, -4, 1), "skin")
    return canvas.world()


def lantern() -> World:
    """A paper lantern that glows, made for a quarter-unit voxel; its middle is at (2, 2, 2).

    What glows fills one cell of 4 voxels cubed, so that it counts as one lamp.
    """
    canvas = Canvas((6, 9, 6), origin=(-1, -2, -1))
    canvas.box((0, 0, 0), (4, 4, 4), "lantern")
    for y in (-1, 4):
        canvas.box((0, y, 0), (4, y + 1, 4), "timber")
    for x, z in ((-1, -1), (-1, 4), (4, -1), (4, 4)):
        canvas.box((x, -1, z), (x + 1, 5, z + 1), "timber")
    canvas.box((1, 5, 1), (3, 6, 3), "iron")
    canvas.box((1, -2, 1), (3, -1, 3), "cloth_red")
    return canvas.world()
