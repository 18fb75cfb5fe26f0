"""Colours, light and layers of blocks by name, from the table `blocks.toml`."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from tracer.scene.material import RGB, Material

GRASS, LEAVES = 0.50, 0.42  # albedo over a biome's colour: blades and leaves shade one another
BRIGHTEST = 0.85  # no real surface reflects more
WATER, TINGE = 0.25, 0.05  # what water scatters of its biome's colour, and how far its transmission is tinted by it
SPECK = 0.35  # share of an ore's face
DEEPEST = 6  # rules that follow one another
VARIATION = {"grass": 0.16, "leaves": 0.30}
TINTED = {
    "grass": {"grass_block", "short_grass", "grass", "tall_grass", "fern", "large_fern", "sugar_cane", "bush"},
    "leaves": {"oak_leaves", "jungle_leaves", "acacia_leaves", "dark_oak_leaves", "mangrove_leaves", "vine"},
    "water": {"water", "flowing_water", "bubble_column"},
}


@cache
def table() -> dict[str, Any]:
    """The whole of `blocks.toml`."""
    return tomllib.loads(files("tracer.formats.minecraft").joinpath("blocks.toml").read_text())


def linear(text: str) -> RGB:
    """``#rrggbb`` as linear RGB."""
    srgb = np.array([int(text[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0
    r, g, b = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).tolist()
    return r, g, b


def tint_kind(name: str) -> str | None:
    """``grass``, ``leaves`` or ``water`` where a block takes its colour from the biome."""
    return next((kind for kind, names in TINTED.items() if name in names), None)


@cache
def tint_of(kind: str, biome: str) -> RGB:
    """The colour of grass, leaves or water in a biome."""
    rows = table()["biomes"]
    return linear(next(row[kind] for row in rows if kind in row and row["match"] in biome))


@cache
def material(name: str, biome: str) -> Material:
    """The material of a block.

    Args:
        name: of the block, without ``minecraft:``.
        biome: its name, for what takes its colour from there; otherwise empty.
    """
    kind = tint_kind(name)
    base = tint_of(kind, biome) if kind else (color(name) or linear(table()["colors"]["unknown"]))
    scale = {"grass": GRASS, "leaves": LEAVES, "water": WATER}.get(kind or "", 0.5 if name.endswith("_leaves") else 1.0)
    r, g, b = (min(scale * c, BRIGHTEST) for c in base)
    label = f"{name} in {biome}" if kind else name
    through = _through(name)
    variation = VARIATION.get("leaves" if name.endswith("_leaves") else kind or "", 0.08)
    if through:
        return Material(
            name=label,
            albedo=(r, g, b),
            roughness=float(through["roughness"]),
            opacity=float(through["opacity"]),
            tint=_mixed(linear(through["tint"]), base, TINGE if kind else 1.0 if "stained" in name else 0.0),
            emission=_emission(name),
            variation=0.0,
        )
    return Material(
        name=label,
        albedo=(r, g, b),
        roughness=0.3 if _in("polished", name) or _in("metal", name) else 0.9,
        metallic=1.0 if _in("metal", name) else 0.0,
        emission=_emission(name),
        variation=0.0 if max(_emission(name)) > 0 else variation,
    )


def known(name: str) -> bool:
    """Whether the table has a colour for a block."""
    return tint_kind(name) is not None or color(name) is not None


@cache
def color(name: str, depth: int = 0) -> RGB | None:
    """Linear colour of a block that is not tinted by its biome; None where no rule leads to one."""
    for find in (_listed, _dyed, _wooden, _ore):
        if (found := find(name)) is not None:
            return found
    if depth < DEEPEST:
        for rule in table()["rules"]:
            if match := re.fullmatch(rule["match"], name):
                for like in rule["like"]:
                    other = like.replace("{1}", match[1] if match.groups() else "")
                    if other != name and (found := color(other, depth + 1)) is not None:
                        return found
    if depth == 0:  # not what rules make of a name: stairs of marble are no planks
        return next((color(row["like"]) for row in table()["modded"] if re.fullmatch(row["match"], name)), None)
    return None


def _listed(name: str) -> RGB | None:
    text = table()["colors"].get(name)
    return None if text is None else linear(text)


def _dyed(name: str) -> RGB | None:
    for dye, text in table()["dyes"].items():
        kind = name.removeprefix(f"{dye}_").removesuffix("_pane").removeprefix("wall_")
        if name.startswith(f"{dye}_") and kind in table()["dyed"]:
            toward, share = table()["dyed"][kind]
            return _mixed(linear(text), linear(toward), share)
    return None


def _wooden(name: str) -> RGB | None:
    stripped = name.startswith("stripped_")
    for wood, (planks, bark, leaves) in table()["woods"].items():
        part = name.removeprefix("stripped_").removeprefix(f"{wood}_")
        if part in ("log", "wood", "stem", "hyphae", "block"):
            return linear(planks if stripped else bark)
        if part in ("planks", "mosaic", "leaves"):
            return linear(leaves if part == "leaves" else planks)
    return None


def _ore(name: str) -> RGB | None:
    if not name.endswith("_ore"):
        return None
    host = "deepslate" if name.startswith("deepslate_") else "netherrack" if name.startswith("nether_") else "stone"
    for metal, text in table()["ores"].items():
        if metal in name:
            return _mixed(linear(table()["colors"][host]), linear(text), SPECK)
    return None


def _through(name: str) -> dict[str, Any] | None:
    rows = table()["translucent"]
    if "stained_glass" in name or name == "glass_pane":
        return rows["glass"] if name == "glass_pane" else {**rows["glass"], "opacity": 0.25}
    return rows["water"] if name in TINTED["water"] else rows.get(name)


def _emission(name: str) -> RGB:
    r, g, b = table()["emission"].get("lava" if name == "flowing_lava" else name, (0.0, 0.0, 0.0))
    return r, g, b


def _in(surface: str, name: str) -> bool:
    base = re.sub(r"^waxed_|_(stairs|slab|wall)$", "", name)
    return base in table()["surface"][surface] or f"{base}_block" in table()["surface"][surface]


def _mixed(a: RGB, b: RGB, share: float) -> RGB:
    r, g, b_ = (x + share * (y - x) for x, y in zip(a, b, strict=True))
    return r, g, b_
