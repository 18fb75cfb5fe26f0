"""Shapes of blocks that are no cubes, as 8 x 8 x 8 voxels."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from tracer.formats.minecraft import lamps
from tracer.formats.minecraft.colors import table
from tracer.formats.minecraft.plants import (
    GREEN_STALK,
    PLANTS,
    SOLID,
    TALL_FLOWERS,
    blossoms,
    crossed,
    flower,
    plant,
)
from tracer.formats.minecraft.voxels import COMPASS, QUARTERS, SIDE, Mask, Shape, beside, box, boxes, laid, turned

NOTHING = re.compile(
    "(?:.*_)?air|barrier|structure_void|light|moving_piston|tripwire.*|redstone_wire|end_gateway|.*button|lever|string"
)
OPPOSITE = {"north": "south", "south": "north", "east": "west", "west": "east"}
SIDES = (*OPPOSITE, "up", "down")


def is_nothing(name: str) -> bool:
    """Whether a block is air, or too thin to be drawn."""
    return NOTHING.fullmatch(name) is not None


def parse_state(state: str) -> tuple[str, dict[str, str]]:
    """``minecraft:oak_log[axis=y]`` as its name without the namespace, and its properties."""
    name, _, rest = state.partition("[")
    pairs = (pair.partition("=") for pair in rest.rstrip("]").split(",") if pair)
    return name.rpartition(":")[2], {key: value for key, _, value in pairs}


@cache
def defaults_of(name: str) -> Mapping[str, str]:
    """What a block's state may leave out: since 26.3 the game writes no property that has its default."""
    rows = (row["told"] for row in table()["defaults"] if re.fullmatch(row["match"], name))
    return {key: value for row in rows for key, value in row.items()}


def shape_of(name: str, told: Mapping[str, str]) -> Shape | None:
    """The parts of a block that is no cube, or None where it is one.

    Args:
        name: without the namespace.
        told: the properties of its state.
    """
    if GREEN_STALK.fullmatch(name):
        return flower(name)
    if name in TALL_FLOWERS:
        return (("short_grass", crossed(0, 8)), (name, blossoms())) if told.get("half") == "upper" else plant("fern")
    for pattern, make in _MAKERS:
        if re.fullmatch(pattern, name):
            return make(name, told)
    return _of_boxes(name, told) or (plant(name) if PLANTS.fullmatch(name) and name not in SOLID else None)


def _slab(name: str, told: Mapping[str, str]) -> Shape | None:
    kind = told.get("type", "bottom")
    return None if kind == "double" else ((name, box(0, 4, 0, 8, 8, 8) if kind == "top" else box(0, 0, 0, 8, 4, 8)),)


def _stairs(name: str, told: Mapping[str, str]) -> Shape:
    facing, shape = told.get("facing", "north"), told.get("shape", "straight")
    step = beside(facing, 4)
    if shape != "straight":
        left = COMPASS[QUARTERS[facing] - 1]
        other = beside(left if shape.endswith("left") else OPPOSITE[left], 4)
        step = step & other if shape.startswith("outer") else step | other
    top = told.get("half") == "top"
    base, rise = (
        (box(0, 4, 0, 8, 8, 8), box(0, 0, 0, 8, 4, 8)) if top else (box(0, 0, 0, 8, 4, 8), box(0, 4, 0, 8, 8, 8))
    )
    return ((name, base | (rise & step)),)


def _arms(told: Mapping[str, str], low: int, high: int, a: int, b: int) -> Mask:
    """Bars from a block's middle to the sides where its state says that it is connected."""
    sides = {"west": (0, a, a, b), "east": (b, 8, a, b), "north": (a, b, 0, a), "south": (a, b, b, 8)}
    mask = np.zeros((SIDE,) * 3, bool)
    for side, (x0, x1, z0, z1) in sides.items():
        if told.get(side, "false") not in ("false", "none"):
            mask |= box(x0, low, z0, x1, high, z1)
    return mask


def _fence(name: str, told: Mapping[str, str]) -> Shape:
    return ((name, box(3, 0, 3, 5, 8, 5) | _arms(told, 3, 4, 3, 5) | _arms(told, 6, 7, 3, 5)),)


def _wall(name: str, told: Mapping[str, str]) -> Shape:
    post = box(2, 0, 2, 6, 8, 6) if told.get("up", "true") == "true" else box(3, 0, 3, 5, 7, 5)
    return ((name, post | _arms(told, 0, 7, 2, 6)),)


def _pane(name: str, told: Mapping[str, str]) -> Shape:
    return ((name, box(3, 0, 3, 4, 8, 4) | _arms(told, 0, 8, 3, 4)),)


def _gate(name: str, told: Mapping[str, str]) -> Shape:
    across = told.get("facing", "north") in ("north", "south")
    posts = box(0, 2, 3, 1, 8, 5) | box(7, 2, 3, 8, 8, 5), box(3, 2, 0, 5, 8, 1) | box(3, 2, 7, 5, 8, 8)
    bars = box(0, 3, 3, 8, 4, 5) | box(0, 6, 3, 8, 7, 5), box(3, 3, 0, 5, 4, 8) | box(3, 6, 0, 5, 7, 8)
    which = 0 if across else 1
    return ((name, posts[which] if told.get("open") == "true" else posts[which] | bars[which]),)


def _door(name: str, told: Mapping[str, str]) -> Shape:
    facing = told.get("facing", "north")
    if told.get("open") == "true":
        right = COMPASS[(QUARTERS[facing] + 1) % 4]
        facing = right if told.get("hinge") == "left" else OPPOSITE[right]
    return ((name, beside(OPPOSITE.get(facing, "south"), 2)),)


def _trapdoor(name: str, told: Mapping[str, str]) -> Shape:
    if told.get("open") == "true":
        return ((name, beside(OPPOSITE.get(told.get("facing", "north"), "south"), 2)),)
    return ((name, box(0, 6, 0, 8, 8, 8) if told.get("half") == "top" else box(0, 0, 0, 8, 2, 8)),)


def _layers(name: str, told: Mapping[str, str]) -> Shape | None:
    count = int(told.get("layers", "1"))
    return None if not 0 < count < 8 else ((name, box(0, 0, 0, 8, count, 8)),)


def _fluid(name: str, told: Mapping[str, str]) -> Shape | None:
    level = int(told.get("level", "0"))
    return None if not 0 < level < 8 else ((name, box(0, 0, 0, 8, 8 - level, 8)),)


def _sheets(name: str, told: Mapping[str, str]) -> Shape:
    """What grows on the sides of other blocks."""
    x, y, z = np.indices((SIDE,) * 3)
    sides = [beside(side, 1) for side in SIDES if told.get(side) == "true"]
    sheet = np.logical_or.reduce(sides) if sides else box(0, 7, 0, 8, 8, 8)
    return ((name, sheet & ((x + z + 2 * y) % 3 > 0)),)


def _ladder(name: str, told: Mapping[str, str]) -> Shape:
    rungs = np.zeros((SIDE,) * 3, bool)
    rungs[1:7, 1::2] = rungs[:, :, 1:7][:, 1::2] = True
    return ((name, beside(OPPOSITE.get(told.get("facing", "north"), "south"), 1) & rungs),)


def _vessel(name: str, told: Mapping[str, str]) -> Shape:
    """A cauldron or composter, and what it is filled with."""
    legs = box(0, 0, 0, 8, 1, 8) & ~box(2, 0, 0, 6, 1, 8) & ~box(0, 0, 2, 8, 1, 6)
    walls = box(0, 1, 0, 8, 8, 8) & ~box(1, 2, 1, 7, 8, 7)
    contents = name.removesuffix("_cauldron")
    if contents == name:
        return ((name, legs | walls),)
    level = int(told.get("level", "3"))
    return (("cauldron", legs | walls), (contents, box(1, 2, 1, 7, min(max(3 + level, 3), 7), 7)))


def _grate(name: str, told: Mapping[str, str]) -> Shape:
    """A hollow cube of bars: of four along each side, the inner two leave the middle open."""
    x, y, z = np.indices((SIDE,) * 3)
    bars = [np.isin(axis, (0, 2, 5, 7)) for axis in (x, y, z)]
    ends = [np.isin(axis, (0, SIDE - 1)) for axis in (x, y, z)]
    mask = np.zeros((SIDE,) * 3, bool)
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        mask |= ends[a] & (bars[b] | bars[c])
    return ((name, mask),)


def _litter(name: str, told: Mapping[str, str]) -> Shape:
    """Petals and leaves on the ground."""
    x, _, z = np.indices((SIDE,) * 3)
    return ((name, box(0, 0, 0, 8, 1, 8) & ((3 * x + 5 * z) % 8 < 4)),)


def _of_boxes(name: str, told: Mapping[str, str]) -> Shape | None:
    """A block of the boxes that `blocks.toml` lists for it."""
    for row in table()["boxes"]:
        if re.fullmatch(row["match"], name):
            mask = boxes(row["boxes"])
            if row.get("turns"):
                mask = turned(mask, told.get("facing", told.get("axis", "north")))
            if row.get("lies"):
                mask = laid(mask, told.get("axis", told.get("facing", "up")))
            return ((name, mask),)
    return None


_MAKERS: tuple[tuple[str, Callable[[str, Mapping[str, str]], Shape | None]], ...] = (
    (".*_slab", _slab),
    (".*_stairs", _stairs),
    (".*(?:torch)", lamps.torch),
    ("(?:soul_|(?:.*_)?copper_)?lantern", lamps.lantern),
    ("|".join(lamps.FRONTS), lamps.front),
    ("(?:soul_)?campfire", lamps.campfire),
    ("(?:.*_)?candle(?:_cake)?", lamps.candles),
    ("sea_pickle", lamps.sea_pickles),
    ("cave_vines(?:_plant)?", lamps.cave_vines),
    ("snow", _layers),
    ("(?:flowing_)?(?:water|lava)", _fluid),
    (".*_fence", _fence),
    (".*_wall", _wall),
    (".*_gate", _gate),
    (".*(?:glass_pane|_bars)", _pane),
    (".*_trapdoor", _trapdoor),
    (".*_door", _door),
    ("ladder", _ladder),
    ("vine|resin_clump|glow_lichen|sculk_vein", _sheets),
    ("(?:.*_)?cauldron|composter", _vessel),
    (".*(?:_grate|spawner|mangrove_roots)|vault", _grate),
    ("pink_petals|wildflowers|leaf_litter", _litter),
)
