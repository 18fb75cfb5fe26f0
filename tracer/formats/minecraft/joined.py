"""What blocks before 1.13 leave to their neighbours: arms of fences, walls and panes, corners of stairs, and halves of
doors and tall plants."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.legacy import AIR
from tracer.formats.minecraft.sections import Section, state_of
from tracer.formats.minecraft.shapes import is_nothing, parse_state, shape_of
from tracer.formats.minecraft.voxels import COMPASS
from tracer.scene.grids import BRICK

Numbers = NDArray[np.int64]
Mask = NDArray[np.bool_]
STEPS = {"north": (1, -1), "east": (2, 1), "south": (1, 1), "west": (2, -1), "up": (0, 1), "down": (0, -1)}
"""Axis and direction of each side, in the order y, z, x."""
CORNERS = ("straight", "outer_left", "outer_right", "inner_left", "inner_right")
TALL = ("sunflower", "lilac", "tall_grass", "large_fern", "rose_bush", "peony")
POST = 16  # the bit of a wall's post, over those of four arms
KINDS = {
    "fence": "(?!nether_brick).*_fence",
    "brick_fence": "nether_brick_fence",
    "gate": ".*_fence_gate",
    "wall": ".*_wall",
    "pane": ".*glass_pane|iron_bars",
    "glass": ".*glass",
}
ARMS = {
    "fence": ("fence", "gate"),
    "brick_fence": ("brick_fence", "gate"),
    "wall": ("wall", "gate"),
    "pane": ("pane", "glass"),
}
"""What each kind joins, beside full cubes and the backs of stairs."""
TOLD = re.compile("|".join(f"(?:{like})" for like in (*(KINDS[kind] for kind in ARMS), ".*_stairs", ".*_door", *TALL)))
LOOSE = re.compile(
    ".*(?:leaves|glass|pumpkin|o_lantern|shulker_box|ice)|melon|barrier|beacon|glowstone|sea_lantern|water|lava"
)
"""Cubes that nothing joins."""


def joined_chunk(column: Sequence[Section]) -> list[Section]:
    """The sections of a chunk from before 1.13, with all that they leave to their neighbours.

    Other chunks are not known: an arm leads over the border if there is one on the opposite side.
    """
    if not any(TOLD.fullmatch(parse_state(state)[0]) for section in column for state in section.states):
        return list(column)
    low, names = min(section.y for section in column), [AIR]
    blocks = np.zeros((max(section.y for section in column) + 1 - low, BRICK, BRICK, BRICK), np.int64)
    for section in column:
        blocks[section.y - low] = np.broadcast_to(section.blocks, BRICK**3).reshape((BRICK,) * 3) + len(names)
        names += section.states
    names, whole = joined(names, blocks.reshape(-1, BRICK, BRICK), goes_on=True)
    parts = whole.reshape(blocks.shape)
    return [_section(section, names, parts[section.y - low]) for section in column]


def joined(names: Sequence[str], blocks: Numbers, *, goes_on: bool = False) -> tuple[list[str], Numbers]:
    """Block states with all that they leave to their neighbours.

    Args:
        names: of states.
        blocks: ``(Y, Z, X)`` which.
        goes_on: whether an arm leads over the border if there is one on the opposite side; else nothing lies beyond.

    Returns:
        The same with longer names.
    """
    states = [parse_state(name) for name in names]
    kinds = {
        kind: _of(blocks, [re.fullmatch(like, name) is not None for name, _ in states]) for kind, like in KINDS.items()
    }
    facing = _of(blocks, [_facing(told) if name.endswith("_stairs") else -1 for name, told in states])
    full = _of(blocks, [_is_full(name, told) for name, told in states])
    code = _corners(facing, _of(blocks, [told.get("half") == "top" for _, told in states]))
    for kind, others in ARMS.items():
        to = np.logical_or.reduce([full, *(kinds[other] for other in others)])
        code += kinds[kind] * _arms(to, facing, goes_on=goes_on)
    straight = np.isin(code, (0b0101, 0b1010))
    code += POST * (kinds["wall"] & ~(straight & ~_near(full | kinds["wall"], "up", False)))
    code += _halves(blocks, states)
    most = int(code.max()) + 1
    pairs, which = np.unique(blocks * most + code, return_inverse=True)
    used = [divmod(int(n), most) for n in pairs]
    longer = [_longer(names[n], states[n][0], states[n][1], extra) for n, extra in used]
    return longer, which.reshape(blocks.shape)


def _section(section: Section, names: Sequence[str], blocks: Numbers) -> Section:
    used, which = np.unique(blocks, return_inverse=True)
    return replace(section, states=tuple(names[n] for n in used), blocks=which.reshape(-1))


def _of(blocks: Numbers, values: Sequence[int]) -> Numbers:
    """What states have, at the blocks of these states."""
    return np.array(values)[blocks]


def _facing(told: Mapping[str, str]) -> int:
    return COMPASS.index(told["facing"]) if told.get("facing") in COMPASS else 0


def _is_full(name: str, told: Mapping[str, str]) -> bool:
    return not is_nothing(name) and not LOOSE.fullmatch(name) and shape_of(name, told) is None


def _near(values: Numbers, side: str, beyond: int) -> Numbers:
    """The values of the blocks on one side."""
    axis, step = STEPS[side]
    moved = np.roll(values, -step, axis)
    moved[(slice(None),) * axis + (-1 if step > 0 else 0,)] = beyond
    return moved


def _arms(to: Mask, facing: Numbers, *, goes_on: bool) -> Numbers:
    """A bit for each side to which an arm leads, the lowest for the first of `COMPASS`."""
    arms = [_near(to | (facing == (n + 2) % 4), side, 0) for n, side in enumerate(COMPASS)]
    if goes_on:
        for n, side in enumerate(COMPASS):
            axis, step = STEPS[side]
            border = (slice(None),) * axis + (-1 if step > 0 else 0,)
            arms[n][border] = arms[(n + 2) % 4][border]
    return np.stack([arm * (1 << n) for n, arm in enumerate(arms)]).sum(axis=0)


def _corners(facing: Numbers, top: Numbers) -> Numbers:
    """Which of `CORNERS` stairs make with others that face to the side; ``facing`` is -1 where there are none."""
    corners = np.zeros_like(facing)
    if (facing < 0).all():
        return corners
    kind = np.where(facing < 0, -1, 2 * facing + top)
    near = [_near(kind, side, -1) for side in COMPASS]
    for n in range(4):
        for rises, first in ((n, 1), ((n + 2) % 4, 3)):  # outer ones meet in front, which is where stairs rise to
            for left in (True, False):
                turned = (n + (3 if left else 1)) % 4
                other = 2 * turned + top
                blocked = near[(turned + 2) % 4 if first == 1 else turned] == kind
                made = (facing == n) & (corners == 0) & (near[rises] == other) & ~blocked
                corners[made] = first + (not left)
    return corners


def _halves(blocks: Numbers, states: Sequence[tuple[str, Mapping[str, str]]]) -> Numbers:
    """What each half takes from the other, plus one; 0 where there is no other."""
    names = sorted({name for name, _ in states if name.endswith("_door") or name in TALL})
    whose = _of(blocks, [names.index(name) if name in names else -1 for name, _ in states])
    door = _of(blocks, [name.endswith("_door") for name, _ in states])
    upper = _of(blocks, [told.get("half") == "upper" for _, told in states])
    lends = _of(blocks, [_lent(name, told) for name, told in states])
    takes = np.zeros_like(blocks)
    for side, taker in (("down", upper == 1), ("up", upper == 0)):
        like, their, lent = (_near(values, side, -1) for values in (whose, upper, lends))
        plants = (side == "down") & (like >= 0) & (_near(door, side, 0) == 0)
        fits = np.where(door == 1, like == whose, plants) & (their != upper)
        takes += np.where(taker & (whose >= 0) & fits, lent + 1, 0)
    return takes


def _lent(name: str, told: Mapping[str, str]) -> int:
    if name in TALL:
        return TALL.index(name)
    if told.get("half") == "upper":
        return int(told.get("hinge") == "right")
    return _facing(told) + 4 * (told.get("open") == "true")


def _longer(whole: str, name: str, told: dict[str, str], code: int) -> str:
    if not TOLD.fullmatch(name):
        return whole
    if name.endswith("_stairs"):
        told = told | {"shape": CORNERS[code]}
    elif name in TALL:
        name = TALL[code - 1] if code and told.get("half") == "upper" else name
    elif not name.endswith("_door"):
        told = told | {side: "true" for n, side in enumerate(COMPASS) if code >> n & 1}
        told |= {"up": str(code >= POST).lower()} if name.endswith("_wall") else {}
    elif code and told.get("half") == "upper":
        told = told | {"facing": COMPASS[(code - 1) % 4], "open": str(code > 4).lower()}
    elif code:
        told = told | {"hinge": ("left", "right")[code - 1]}
    return state_of(f"minecraft:{name}", told)
