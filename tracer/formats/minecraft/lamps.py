"""Shapes of blocks of which a part glows: torches, lanterns, campfires, candles, faces and fires."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tracer.formats.minecraft.plants import crossed
from tracer.formats.minecraft.voxels import SIDE, Mask, Shape, beside, box, boxes

FRONTS = {
    "jack_o_lantern": ("pumpkin", (".##..##.", ".##..##.", "........", ".#.##.#.", ".######.", "..#..#.."), 1),
    "lit_furnace": ("furnace", ("..####..", ".######.", ".######."), 1),
    "lit_smoker": ("smoker", (".######.", "..####.."), 1),
    "lit_blast_furnace": ("blast_furnace", (".##..##.", ".##..##."), 1),
}
"""Cubes of which one side glows: what the rest is of, and where it glows: rows in eighths, and the lowest's height."""
CANDLES = ((3, 3), (5, 4), (2, 5), (4, 2))  # where they stand, the first of as many as there are
PICKLES = ((3, 3), (5, 5), (1, 4), (4, 1))
BERRIES = ((2, 2, 3), (5, 4, 4), (3, 5, 5))


def torch(name: str, told: Mapping[str, str]) -> Shape:
    kind = name.replace("wall_", "").removesuffix("torch")
    leans = {"east": (1, 3), "west": (5, 3), "south": (3, 1), "north": (3, 5)}
    on_a_wall = "wall_" in name
    (x, z), low = (leans[told.get("facing", "north")], 2) if on_a_wall else ((3, 3), 0)
    head = "stick" if told.get("lit") == "false" else f"{kind}torch_head"
    return (("stick", box(x, low, z, x + 1, low + 4, z + 1)), (head, box(x, low + 4, z, x + 2, low + 6, z + 2)))


def front(name: str, told: Mapping[str, str]) -> Shape:
    body, rows, low = FRONTS[name]
    drawn = np.zeros((SIDE, SIDE), bool)  # across, and up
    drawn[:, low : low + len(rows)] = np.array([[c == "#" for c in row] for row in reversed(rows)]).T
    along = drawn[:, :, None] if front_of(told) in ("north", "south") else drawn.T[None]
    glowing = beside(front_of(told), 1) & along
    return ((body, ~glowing), (f"{name}_front", glowing))


def front_of(told: Mapping[str, str]) -> str:
    """The side that a block's front is on."""
    return told.get("facing", "north")


def lantern(name: str, told: Mapping[str, str]) -> Shape:
    """Lanterns of iron, for the souls, and of copper of any age."""
    low = 1 if told.get("hanging") == "true" else 0
    frame = box(3, low, 3, 5, low + 1, 5) | box(3, low + 5, 3, 5, low + 6, 5)
    metal = name.removesuffix("lantern").rstrip("_")
    copper = metal.endswith("copper")
    glass = "copper_lantern" if copper else name
    return ((metal if copper else "iron", frame), (f"{glass}_glass", box(2, low + 1, 2, 6, low + 5, 6)))


def campfire(name: str, told: Mapping[str, str]) -> Shape:
    logs = ("oak_log", boxes([(0, 0, 1, 8, 2, 3), (0, 0, 5, 8, 2, 7), (1, 2, 0, 3, 4, 8), (5, 2, 0, 7, 4, 8)]))
    if told.get("lit", "true") == "false":
        return (logs,)
    flames = crossed(1, 8) & box(2, 1, 2, 6, 8, 6) & ~logs[1]
    return (logs, ("soul_fire" if name.startswith("soul") else "fire", flames))


def candles(name: str, told: Mapping[str, str]) -> Shape:
    """One candle to four, on a cake or not."""
    cake = box(1, 0, 1, 7, 4, 7)
    on = 4 if name.endswith("_cake") else 0
    places = CANDLES[: _count(told, "candles")]
    wax = boxes((x, on, z, x + 1, on + 3, z + 1) for x, z in places)
    parts: Shape = ((name.removesuffix("_cake"), wax),)
    if told.get("lit") == "true":
        parts += (("candle_flame", boxes((x, on + 3, z, x + 1, on + 4, z + 1) for x, z in places)),)
    return (("cake", cake), *parts) if on else parts


def sea_pickles(name: str, told: Mapping[str, str]) -> Shape:
    """They glow under water."""
    places = PICKLES[: _count(told, "pickles")]
    stalks = boxes((x, 0, z, x + 2, 2, z + 2) for x, z in places)
    tips = boxes((x, 2, z, x + 2, 3, z + 2) for x, z in places)
    return ((name, stalks), (f"{name}_tip" if told.get("waterlogged", "true") == "true" else name, tips))


def cave_vines(name: str, told: Mapping[str, str]) -> Shape:
    """Their berries glow."""
    leaves: Mask = crossed(0, 8)
    if told.get("berries") != "true":
        return ((name, leaves),)
    berries = boxes((x, y, z, x + 2, y + 2, z + 2) for x, y, z in BERRIES)
    return ((name, leaves & ~berries), ("glow_berries", berries))


def _count(told: Mapping[str, str], what: str) -> int:
    return min(max(int(told.get(what, "1")), 1), 4)
