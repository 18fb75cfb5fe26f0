"""Blocks and biomes before 1.13: numbers as the names that came after."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from tracer.formats.minecraft.nbt import read_nbt

AIR = "minecraft:air"
UNKNOWN = "minecraft:legacy_"
MAX_LEVEL = 1 << 26
TURNS = ("east", "west", "south", "north")
COMPASS = ("south", "west", "north", "east")
WALLS = ("north", "north", "north", "south", "west", "east")
AXES = ("y", "x", "z")


@cache
def legacy_state(number: int, data: int) -> str:
    """The block state of a number and its four bits of data; ``minecraft:legacy_N`` where the number is not known."""
    entry = _tables()["blocks"].get(str(number))
    if entry is None:
        return f"{UNKNOWN}{number}"
    names, mask, kind = _entry(entry)
    name = names[min(data & mask, len(names) - 1)]
    properties = _KINDS[kind](data) if kind else ""
    return f"minecraft:{name}[{properties}]" if properties else f"minecraft:{name}"


def mod_names(region: Path) -> Mapping[str, str]:
    """Blocks of mods by the names that `legacy_state` gives their numbers, as Forge lists them in a region's save."""
    levels = (folder / "level.dat" for folder in region.resolve().parents[:3])
    level = next((file for file in levels if file.is_file()), None)
    return {} if level is None else _forge_names(level, level.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _forge_names(level: Path, _changed: int) -> Mapping[str, str]:
    """Of the list since 1.8, or of that before, where blocks begin with a 1 and items with a 2."""
    try:
        forge = read_nbt(level, limit=MAX_LEVEL).get("FML", {})
        listed = forge["Registries"]["minecraft:blocks"]["ids"] if "Registries" in forge else forge.get("ItemData", ())
        blocks = [(str(entry["K"]), int(entry["V"])) for entry in listed if not str(entry["K"]).startswith("\x02")]
    except (ValueError, TypeError, KeyError, AttributeError):
        return {}  # a damaged list must not hide the world
    return {f"{UNKNOWN}{number}": name.removeprefix("\x01") for name, number in blocks}


def legacy_biome(number: int) -> str:
    """The name of a biome's number; plains where it is not known."""
    return f"minecraft:{_tables()['biomes'].get(str(number & 127), 'plains')}"


def _entry(entry: Any) -> tuple[list[str], int, str]:
    if isinstance(entry, dict):
        names = entry["names"]
        return ([names] if isinstance(names, str) else names), int(entry.get("mask", 15)), str(entry.get("kind", ""))
    return ([entry] if isinstance(entry, str) else entry), 15, ""


@cache
def _tables() -> dict[str, dict[str, Any]]:
    return tomllib.loads(files("tracer.formats.minecraft").joinpath("legacy.toml").read_text())


def _torch(data: int) -> str:
    return f"facing={TURNS[data - 1]}" if 1 <= data <= 4 else ""


def _told(bit: int) -> str:
    return "true" if bit else "false"


def _vine(data: int) -> str:
    sides = ("south", "west", "north", "east")
    return ",".join(f"{side}=true" for bit, side in enumerate(sides) if data >> bit & 1)


_KINDS: dict[str, Callable[[int], str]] = {
    "stairs": lambda data: f"facing={TURNS[data & 3]},half={'top' if data & 4 else 'bottom'}",
    "slab": lambda data: f"type={'top' if data & 8 else 'bottom'}",
    "double": lambda _: "type=double",
    "axis": lambda data: f"axis={AXES[min(data >> 2, 2)]}" if data < 12 else "",
    "fluid": lambda data: f"level={data}",
    "snow": lambda data: f"layers={(data & 7) + 1}",
    "torch": _torch,
    "vine": _vine,
    "half": lambda data: f"half={'upper' if data & 8 else 'lower'}",
    "door": lambda data: (
        f"half=upper,hinge={'right' if data & 1 else 'left'}"
        if data & 8
        else f"facing={('east', 'south', 'west', 'north')[data & 3]},half=lower,open={_told(data & 4)}"
    ),
    "gate": lambda data: f"facing={COMPASS[data & 3]},open={_told(data & 4)}",
    "portal": lambda data: f"axis={'z' if data & 3 == 2 else 'x'}",
    "rod": lambda data: f"facing={('down', 'up', *WALLS[2:])[min(data & 7, 5)]}",
    "trapdoor": lambda data: (
        f"facing={('north', 'south', 'west', 'east')[data & 3]},half={'top' if data & 8 else 'bottom'},"
        f"open={_told(data & 4)}"
    ),
    "wall": lambda data: f"facing={WALLS[min(data, 5)]}",
    "compass": lambda data: f"facing={COMPASS[data & 3]}",
    "bed": lambda data: f"facing={COMPASS[data & 3]},part={'head' if data & 8 else 'foot'}",
}
