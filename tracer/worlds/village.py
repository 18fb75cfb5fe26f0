"""The village: plaza with its fountain, houses round it, quay, pier, stalls, gardens and the lamps of the streets."""

from __future__ import annotations

import numpy as np

from tracer.worlds.canvas import Canvas
from tracer.worlds.houses import House, build
from tracer.worlds.land import VILLAGE, WATER

PLAZA = (186, 122)
PLAZA_RADIUS = 15
G = VILLAGE

HOUSES = (
    House(at=(163, 138), ground=G, size=(13, 11), storeys=2, ridge="z", door="west"),
    House(at=(163, 156), ground=G, size=(11, 13), wall="plaster_ochre", roof="roof_slate", door="west"),
    House(at=(127, 104), ground=G, size=(12, 10), wall="plaster", roof="roof_moss", door="south"),
    House(at=(182, 144), ground=G, size=(15, 10), storeys=2, wall="plaster_blue", door="north"),
    House(at=(206, 108), ground=G, size=(11, 15), storeys=2, roof="roof_slate", door="west", ridge="z"),
    House(at=(206, 130), ground=G, size=(13, 11), wall="plaster_ochre", door="west"),
    House(at=(181, 164), ground=G, size=(13, 10), wall="plaster_rose", roof="roof_slate", door="north"),
    House(at=(205, 152), ground=G, size=(11, 13), storeys=2, wall="plaster", roof="roof_clay", door="west", ridge="z"),
)


def lamp_post(canvas: Canvas, x: int, y: int, z: int, *, tall: int = 5) -> None:
    """An iron pole with a lamp under a cap."""
    canvas.put(x, y, z, "masonry_dark")
    canvas.box((x, y + 1, z), (x + 1, y + tall, z + 1), "iron")
    canvas.put(x, y + tall, z, "lamp")
    canvas.put(x, y + tall + 1, z, "iron")


def fence(canvas: Canvas, start: tuple[int, int], stop: tuple[int, int], y: int, *, name: str = "planks") -> None:
    """Posts every third voxel with a rail between; ``start`` and ``stop`` differ along one axis."""
    steps = max(abs(stop[0] - start[0]), abs(stop[1] - start[1]), 1)
    for i in range(steps + 1):
        x, z = (round(a + (b - a) * i / steps) for a, b in zip(start, stop, strict=True))
        canvas.put(x, y, z, name if i % 3 == 0 else "air")
        canvas.put(x, y + 1, z, name)
        if i % 3 == 0:
            canvas.put(x, y + 2, z, name)


def plaza(canvas: Canvas) -> None:
    """A disc of polished stone in rings, a fountain with a gilded column in its middle, lamps round it."""
    cx, cz = PLAZA
    r = PLAZA_RADIUS
    part, (x, _, z) = canvas.grid((cx - r - 2, G - 1, cz - r - 2), (cx + r + 2, G, cz + r + 2))
    away = np.hypot(x - cx - 0.5, z - cz - 0.5) + 0.0 * part
    angle = np.arctan2(z - cz - 0.5, x - cx - 0.5)
    spoke = np.abs((angle / (np.pi / 4) + 0.5) % 1.0 - 0.5) * (np.pi / 4) * away < 0.8
    ring = (away.astype(int) % 5 == 0) | (spoke & (away > 5))
    floor = np.where(ring, canvas.id("marble_dark"), canvas.id("marble"))
    floor = np.where((away > r - 2) & (away < r), canvas.id("tile_teal"), floor)
    part[away < r] = floor[away < r]
    part[(away >= r) & (away < r + 1.3)] = canvas.id("masonry")
    _fountain(canvas, cx, cz)
    for i in range(4):
        a = np.pi / 4 + i * np.pi / 2
        lamp_post(canvas, round(cx + (r - 0.5) * np.cos(a)), G, round(cz + (r - 0.5) * np.sin(a)))


def _fountain(canvas: Canvas, cx: int, cz: int) -> None:
    part, (x, y, z) = canvas.grid((cx - 5, G, cz - 5), (cx + 6, G + 2, cz + 6))
    away = np.hypot(x - cx - 0.5, z - cz - 0.5) + 0.0 * y
    part[(away < 5.2) & (away > 3.7) & (y < G + 2)] = canvas.id("marble")
    part[(away <= 3.7) & (y < G + 1)] = canvas.id("water")
    canvas.box((cx - 1, G, cz - 1), (cx + 2, G + 2, cz + 2), "marble_dark")
    canvas.box((cx, G + 2, cz), (cx + 1, G + 6, cz + 1), "marble")
    canvas.box((cx - 1, G + 6, cz - 1), (cx + 2, G + 7, cz + 2), "copper")
    for dx, dy, dz in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):  # a ball: a cube without its corners and edges
        canvas.box((cx - dx, G + 8 - dy, cz - dz), (cx + 1 + dx, G + 9 + dy, cz + 1 + dz), "gold")
    canvas.box((cx - 1, G + 8, cz - 1), (cx + 2, G + 9, cz + 2), "gold")
    canvas.box((cx, G + 10, cz), (cx + 1, G + 12, cz + 1), "gold")


def streets(canvas: Canvas, seed_rng: np.random.Generator) -> None:
    """Cobbles from the plaza to the quay, the mine, the houses and the meadow."""
    lanes = (
        ((154, G - 1, 99), (160, G, 179)),
        ((158, G - 1, 120), (172, G, 125)),
        ((176, G - 1, 98), (198, G, 108)),
        ((177, G - 1, 135), (181, G, 184)),
        ((198, G - 1, 120), (206, G, 125)),
        ((200, G - 1, 125), (204, G, 170)),
        ((156, G - 1, 98), (176, G, 101)),
        ((181, G - 1, 160), (204, G, 164)),
    )
    for low, high in lanes:
        part, _ = canvas.grid(low, high)
        dice = seed_rng.random(part.shape)
        stones = np.where(dice < 0.25, canvas.id("masonry_dark"), canvas.id("cobble"))
        part[part > 0] = np.where(dice > 0.85, canvas.id("path"), stones)[part > 0]


def quay(canvas: Canvas) -> None:
    """The wall along the lake with its railing, and a pier."""
    canvas.box((152, WATER - 10, 126), (154, G, 179), "masonry")
    canvas.box((152, G - 1, 126), (155, G, 179), "masonry_dark")
    for z in (*range(126, 137, 3), *range(143, 179, 3)):
        canvas.put(153, G, z, "masonry")
    for z in (128, 150, 172):
        lamp_post(canvas, 154, G, z)
    canvas.box((132, WATER + 1, 137), (152, WATER + 2, 141), "planks")
    for i, x in enumerate((149, 150, 151)):
        canvas.box((x, WATER + 1, 137), (x + 2, WATER + 2 + i, 141), "planks")
    for x in (132, 140, 147):
        for z in (136, 141):
            canvas.box((x, WATER - 9, z), (x + 1, WATER + 4, z + 1), "timber")
    for x, z in ((132, 136),):
        canvas.put(x, WATER + 4, z, "lamp")
        canvas.put(x, WATER + 5, z, "iron")
    canvas.box((134, WATER + 2, 138), (136, WATER + 4, 140), "planks")
    canvas.box((137, WATER + 2, 139), (138, WATER + 3, 140), "hay")


def stall(canvas: Canvas, x: int, z: int, cloth: str) -> None:
    """A market stall five by four under a striped awning."""
    for dx in (0, 5):
        for dz in (0, 3):
            canvas.box((x + dx, G, z + dz), (x + dx + 1, G + 5, z + dz + 1), "timber")
    canvas.box((x, G, z), (x + 6, G + 2, z + 1), "planks")
    goods = ("flower_yellow", "leaf_red", "leaf_light", "flower_violet")
    for i in range(4):
        canvas.put(x + 1 + i, G + 2, z, goods[i])
    for i in range(8):
        name = cloth if i % 2 else "canvas"
        canvas.box((x - 1 + i, G + 5, z - 1), (x + i, G + 6, z + 2), name)
        canvas.box((x - 1 + i, G + 6, z + 1), (x + i, G + 7, z + 5), name)
    canvas.put(x + 3, G + 4, z + 2, "lamp")


def crates(canvas: Canvas, x: int, z: int) -> None:
    """Crates and a barrel, stacked so that there are dark corners."""
    for dx, dz, tall, name in ((0, 0, 2, "planks"), (1, 2, 1, "hay"), (-1, 2, 1, "timber"), (2, 1, 1, "planks")):
        canvas.box((x + dx, G, z + dz), (x + dx + 1, G + tall, z + dz + 1), name)
    canvas.put(x + 2, G + 1, z + 1, "leaf_red")
    canvas.put(x + 1, G, z, "copper")


def garden(canvas: Canvas, low: tuple[int, int], high: tuple[int, int]) -> None:
    """Beds of flowers behind a fence."""
    for a, b in (
        (low, (high[0], low[1])),
        ((high[0], low[1]), high),
        ((low[0], high[1]), high),
        (low, (low[0], high[1])),
    ):
        fence(canvas, a, b, G)
    beds = ("flower_white", "flower_violet", "flower_yellow", "blossom")
    for x in range(low[0] + 2, high[0] - 1):
        for z in range(low[1] + 2, high[1] - 1, 2):
            canvas.put(x, G - 1, z, "dirt")
            canvas.put(x, G, z, "leaf_light" if (x + z) % 3 else beds[(z // 2) % 4])


def village(canvas: Canvas, rng: np.random.Generator) -> None:
    """Everything above, in order."""
    canvas.box((150, G, 98), (224, G + 3, 182), "air")
    streets(canvas, rng)
    plaza(canvas)
    quay(canvas)
    for house in HOUSES:
        build(canvas, house)
    stall(canvas, 167, 127, "cloth_red")
    stall(canvas, 194, 134, "cloth_blue")
    crates(canvas, 163, 129)
    garden(canvas, (195, 173), (212, 181))
    garden(canvas, (163, 172), (174, 181))
    for x, z in ((176, 142), (204, 147), (160, 118), (178, 178)):
        lamp_post(canvas, x, G, z)
