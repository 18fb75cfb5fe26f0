"""The mine: a tunnel with rails into the cliff, and a chamber off it that lamps and crystals light."""

from __future__ import annotations

import numpy as np

from tracer.worlds.canvas import Canvas
from tracer.worlds.fields import value_noise
from tracer.worlds.land import VILLAGE
from tracer.worlds.village import lamp_post

FLOOR = VILLAGE
RAILS = (149, 152)
TRACK = (22, 104)
CHAMBER = (130.0, 33.0, 31.0)


def cave(canvas: Canvas, rng: np.random.Generator) -> None:
    """Dig, prop up and furnish the mine."""
    _dig(canvas, rng)
    _pool(canvas)
    _props(canvas)
    for z in range(TRACK[0], TRACK[1]):
        canvas.box((RAILS[0] - 1, FLOOR - 1, z), (RAILS[1] + 2, FLOOR, z + 1), "timber" if z % 3 == 0 else "path")
        for x in RAILS:
            canvas.put(x, FLOOR - 1, z, "iron")
    canvas.box((RAILS[0], FLOOR, TRACK[1]), (RAILS[1] + 1, FLOOR + 2, TRACK[1] + 1), "timber")
    _crystals(canvas, rng)
    for x, z in ((139, 21), (137, 41), (119, 40), (117, 27)):
        lamp_post(canvas, x, FLOOR, z, tall=4)


def _dig(canvas: Canvas, rng: np.random.Generator) -> None:
    low, high = (106, FLOOR, 12), (156, FLOOR + 18, 50)
    part, (x, y, z) = canvas.grid(low, high)
    rough = 0.22 * value_noise(part.shape, 5.0, rng) + 0.08 * value_noise(part.shape, 2.5, rng)
    cx, cy, cz = CHAMBER
    room = ((x - cx) / 20.5) ** 2 + ((y - cy) / 12.0) ** 2 + ((z - cz) / 14.5) ** 2 + rough
    spikes = (value_noise((part.shape[0], 1, part.shape[2]), 3.0, rng) > 0.62) * 4.0 * (y > cy + 2.0)
    part[room + 0.06 * spikes * (y - cy) < 1.0] = 0
    for z0 in range(TRACK[0] - 2, 72):
        wide = 3 + int(rng.random() < 0.3)
        canvas.box((151 - wide, FLOOR, z0), (151 + wide, FLOOR + 6, z0 + 1), "air")
        canvas.box((151 - wide + 1, FLOOR + 6, z0), (151 + wide - 1, FLOOR + 7, z0 + 1), "air")


def _pool(canvas: Canvas) -> None:
    part, (x, y, z) = canvas.grid((116, FLOOR - 3, 22), (136, FLOOR, 44))
    away = ((x - 126) / 8.0) ** 2 + ((z - 33.5) / 6.0) ** 2 + 0.18 * np.sin(x) * np.cos(z * 1.3)
    pool = away + 0.25 * (FLOOR - y) < 1.0
    part[pool & (y < FLOOR - 0.9)] = canvas.id("water")
    part[pool & (y > FLOOR - 1.0)] = canvas.id("water")


def _props(canvas: Canvas) -> None:
    """Timber frames along the tunnel, a lamp in every one."""
    for z in range(26, 66, 10):
        for x in (147, 154):
            canvas.box((x, FLOOR, z), (x + 1, FLOOR + 6, z + 1), "timber")
        canvas.box((147, FLOOR + 5, z), (155, FLOOR + 6, z + 1), "timber")
        canvas.put(148, FLOOR + 4, z, "lamp")
    canvas.box((146, FLOOR, 66), (148, FLOOR + 8, 68), "timber")
    canvas.box((154, FLOOR, 66), (156, FLOOR + 8, 68), "timber")
    canvas.box((145, FLOOR + 7, 66), (157, FLOOR + 9, 68), "timber")


def _crystals(canvas: Canvas, rng: np.random.Generator) -> None:
    """Clusters growing from the floor of the chamber, and veins of gold in its walls."""
    spots = ((120, 20, "crystal"), (128, 44, "amethyst"), (144, 32, "amethyst"))
    for x, z, name in spots:  # each within one cell of 4 voxels cubed, so that it counts as one lamp
        for _ in range(3):
            i, k = x + int(rng.integers(0, 4)), z + int(rng.integers(0, 4))
            canvas.box((i, FLOOR, k), (i + 1, FLOOR + int(rng.integers(1, 4)), k + 1), name, into_air=True)
    part, _ = canvas.grid((106, FLOOR - 1, 10), (158, FLOOR + 16, 54))
    vein = value_noise(part.shape, 3.5, rng) > 0.74
    rock = (part > 0) & np.isin(part, canvas.ids(("rock", "rock_dark", "rock_warm", "rock_pale")))
    part[rock & vein & (rng.random(part.shape) < 0.4)] = canvas.id("gold")
