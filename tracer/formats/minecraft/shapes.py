"""Shapes of blocks that are no cubes, as 8 x 8 x 8 voxels."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

from tracer.formats.minecraft.plants import (
    GREEN_STALK,
    PLANTS,
    SOLID_STEMS,
    TALL_FLOWERS,
    blossoms,
    crossed,
    flower,
    plant,
)
from tracer.formats.minecraft.voxels import SIDE, Mask, Shape, beside, box

NOTHING = re.compile(
    "(?:.*_)?air|barrier|structure_void|light|moving_piston|tripwire.*|glow_lichen|redstone_wire|sculk_vein"
    "|end_gateway|.*button|lever|string"
)
FRONTS = {
    "jack_o_lantern": ("pumpkin", (".##..##.", ".##..##.", "........", ".#.##.#.", ".######.", "..#..#.."), 1),
    "lit_furnace": ("furnace", ("..####..", ".######.", ".######."), 1),
}
"""Cubes of which one side glows: what the rest is of, and where it glows: rows in eighths, and the lowest's height."""
OPPOSITE = {"north": "south", "south": "north", "east": "west", "west": "east"}


def is_nothing(name: str) -> bool:
    """Whether a block is air, or too thin to be drawn."""
    return NOTHING.fullmatch(name) is not None


def parse_state(state: str) -> tuple[str, dict[str, str]]:
    """``minecraft:oak_log[axis=y]`` as its name without the namespace, and its properties."""
    name, _, rest = state.partition("[")
    pairs = (pair.partition("=") for pair in rest.rstrip("]").split(",") if pair)
    return name.rpartition(":")[2], {key: value for key, _, value in pairs}


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
    if PLANTS.fullmatch(name) and name not in SOLID_STEMS:
        return plant(name)
    for pattern, make in _MAKERS:
        if re.fullmatch(pattern, name):
            return make(name, told)
    return None


def _slab(name: str, told: Mapping[str, str]) -> Shape | None:
    kind = told.get("type", "bottom")
    return None if kind == "double" else ((name, box(0, 4, 0, 8, 8, 8) if kind == "top" else box(0, 0, 0, 8, 4, 8)),)


def _stairs(name: str, told: Mapping[str, str]) -> Shape:
    facing, shape = told.get("facing", "north"), told.get("shape", "straight")
    step = beside(facing, 4)
    if shape != "straight":
        left = {"north": "west", "west": "south", "south": "east", "east": "north"}[facing]
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
        turned = {"north": "east", "east": "south", "south": "west", "west": "north"}[facing]
        facing = turned if told.get("hinge") == "left" else OPPOSITE[turned]
    return ((name, beside(OPPOSITE.get(facing, "south"), 2)),)


def _trapdoor(name: str, told: Mapping[str, str]) -> Shape:
    if told.get("open") == "true":
        return ((name, beside(OPPOSITE.get(told.get("facing", "north"), "south"), 2)),)
    return ((name, box(0, 6, 0, 8, 8, 8) if told.get("half") == "top" else box(0, 0, 0, 8, 2, 8)),)


def _torch(name: str, told: Mapping[str, str]) -> Shape:
    kind = name.replace("wall_", "").removesuffix("torch")
    x, z = {"east": (1, 3), "west": (5, 3), "south": (3, 1), "north": (3, 5)}.get(told.get("facing", ""), (3, 3))
    low = 2 if "facing" in told else 0
    head = "stick" if told.get("lit") == "false" else f"{kind}torch_head"
    return (("stick", box(x, low, z, x + 1, low + 4, z + 1)), (head, box(x, low + 4, z, x + 2, low + 6, z + 2)))


def _front(name: str, told: Mapping[str, str]) -> Shape:
    body, rows, low = FRONTS[name]
    drawn = np.zeros((SIDE, SIDE), bool)  # across, and up
    drawn[:, low : low + len(rows)] = np.array([[c == "#" for c in row] for row in reversed(rows)]).T
    along = drawn[:, :, None] if front_of(told) in ("north", "south") else drawn.T[None]
    glowing = beside(front_of(told), 1) & along
    return ((body, ~glowing), (f"{name}_front", glowing))


def front_of(told: Mapping[str, str]) -> str:
    """The side that a block's front is on."""
    return told.get("facing", "north")


def _lantern(name: str, told: Mapping[str, str]) -> Shape:
    low = 1 if told.get("hanging") == "true" else 0
    frame = box(3, low, 3, 5, low + 1, 5) | box(3, low + 5, 3, 5, low + 6, 5)
    return (("iron", frame), (f"{name}_glass", box(2, low + 1, 2, 6, low + 5, 6)))


def _layers(name: str, told: Mapping[str, str]) -> Shape | None:
    count = int(told.get("layers", "1"))
    return None if not 0 < count < 8 else ((name, box(0, 0, 0, 8, count, 8)),)


def _fluid(name: str, told: Mapping[str, str]) -> Shape | None:
    level = int(told.get("level", "0"))
    return None if not 0 < level < 8 else ((name, box(0, 0, 0, 8, 8 - level, 8)),)


def _vine(name: str, told: Mapping[str, str]) -> Shape:
    x, y, z = np.indices((SIDE,) * 3)
    sides = [beside(side, 1) for side in OPPOSITE if told.get(side) == "true"]
    sheet = np.logical_or.reduce(sides) if sides else box(0, 7, 0, 8, 8, 8)
    return ((name, sheet & ((x + z + 2 * y) % 3 > 0)),)


def _fixed(*boxes: tuple[int, int, int, int, int, int]) -> Callable[[str, Mapping[str, str]], Shape]:
    def make(name: str, told: Mapping[str, str]) -> Shape:
        return ((name, np.logical_or.reduce([box(*b) for b in boxes])),)

    return make


def _ladder(name: str, told: Mapping[str, str]) -> Shape:
    rungs = np.zeros((SIDE,) * 3, bool)
    rungs[1:7, 1::2] = rungs[:, :, 1:7][:, 1::2] = True
    return ((name, beside(OPPOSITE.get(told.get("facing", "north"), "south"), 1) & rungs),)


_MAKERS: tuple[tuple[str, Callable[[str, Mapping[str, str]], Shape | None]], ...] = (
    (".*_slab", _slab),
    (".*_stairs", _stairs),
    (".*(?:torch)", _torch),
    ("(?:soul_)?lantern", _lantern),
    ("|".join(FRONTS), _front),
    ("snow", _layers),
    ("(?:flowing_)?(?:water|lava)", _fluid),
    (".*_fence", _fence),
    (".*_wall", _wall),
    (".*_gate", _gate),
    (".*(?:glass_pane|_bars)", _pane),
    (".*_trapdoor", _trapdoor),
    (".*_door", _door),
    ("ladder", _ladder),
    ("vine", _vine),
    (
        ".*_carpet|.*rail|lily_pad|pink_petals|leaf_litter|.*pressure_plate|repeater|comparator",
        _fixed((0, 0, 0, 8, 1, 8)),
    ),
    ("dirt_path|farmland", _fixed((0, 0, 0, 8, 7, 8))),
    (".*_bed", _fixed((0, 1, 0, 8, 5, 8))),
    (".*chest|decorated_pot", _fixed((1, 0, 1, 7, 7, 7))),
    ("cactus", _fixed((1, 0, 1, 7, 8, 7))),
    ("flower_pot|potted_.*", _fixed((3, 0, 3, 5, 3, 5))),
    ("(?:iron_)?chain|end_rod|bamboo|lightning_rod|pointed_dripstone|chorus_plant", _fixed((3, 0, 3, 5, 8, 5))),
    ("(?:.*_)?anvil", _fixed((1, 0, 1, 7, 2, 7), (3, 2, 2, 5, 5, 6), (2, 5, 0, 6, 8, 8))),
    ("hopper|cauldron|composter", _fixed((2, 0, 2, 6, 3, 6), (0, 4, 0, 8, 8, 8), (1, 3, 1, 7, 4, 7))),
    ("enchanting_table|daylight_detector|stonecutter|end_portal_frame", _fixed((0, 0, 0, 8, 5, 8))),
    ("brewing_stand", _fixed((3, 0, 3, 5, 7, 5), (1, 0, 1, 7, 1, 7))),
    ("(?:soul_)?campfire", _fixed((0, 0, 0, 8, 2, 8))),
    ("lectern", _fixed((0, 0, 0, 8, 1, 8), (2, 1, 2, 6, 6, 6), (0, 6, 0, 8, 7, 8))),
    ("grindstone|bell|conduit|.*_head|.*_skull", _fixed((2, 2, 2, 6, 6, 6))),
    (".*_banner|.*sign", _fixed((3, 0, 3, 4, 4, 4), (0, 4, 3, 8, 8, 4))),
    (".*candle", _fixed((3, 0, 3, 5, 3, 5))),
)
