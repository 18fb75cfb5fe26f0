"""Plants: upright pictures that cross, as voxels, and which blocks they are."""

from __future__ import annotations

import re
from functools import cache

import numpy as np

from tracer.formats.minecraft.voxels import SIDE, Mask, Shape, box

PLANTS = re.compile(
    ".*(?:sapling|tulip|bush|shrub|_coral|_coral_fan|_coral_wall_fan|fungus|seagrass|mushroom|orchid|daisy|roots|sprouts"
    "|propagule|kelp|kelp_plant|vines|vines_plant|_stem|crop)|(?:short_|tall_)?(?:dry_)?grass|cactus_flower|pale_hanging_moss|(?:large_)?fern|dandelion|poppy|allium|azure_bluet|cornflower"
    "|lily_of_the_valley|wither_rose|torchflower|sunflower|lilac|rose_bush|peony|sugar_cane|wheat|carrots|potatoes"
    "|beetroots|nether_wart|cobweb|amethyst_cluster|.*amethyst_bud|bamboo_sapling|pitcher_plant|.*dripleaf|fire|soul_fire"
)
SOLID = (
    "crimson_stem",
    "warped_stem",
    "mushroom_stem",
    "stripped_crimson_stem",
    "stripped_warped_stem",
    "big_dripleaf",
    "big_dripleaf_stem",
    "mangrove_roots",
    "muddy_mangrove_roots",
)
GREEN_STALK = re.compile(
    ".*(?:tulip|orchid|daisy)|(?:golden_)?dandelion|poppy|allium|azure_bluet|cornflower|lily_of_the_valley|wither_rose|torchflower"
    "|(?:open|closed)_eyeblossom"
)
TALL_FLOWERS = ("sunflower", "lilac", "rose_bush", "peony")


@cache
def crossed(low: int, high: int) -> Mask:
    """Two upright planes along the diagonals, frayed: every second voxel is left out, more of them toward the top."""
    x, y, z = np.indices((SIDE,) * 3)
    plane = (x == z) | (x == SIDE - 1 - z)
    gap = (3 * x + 5 * y + 7 * (x > z)) % 5
    return plane & (y >= low) & (y < high) & (gap > 0) & (gap * (high - low) >= (y - low) * 3)


@cache
def blossoms() -> Mask:
    x, y, _ = np.indices((SIDE,) * 3)
    return crossed(0, 8) & (y >= 2) & ((x + 2 * y) % 3 > 0)


def is_plant(name: str) -> bool:
    """Whether a block is two upright pictures that cross."""
    plant = PLANTS.fullmatch(name) is not None and name not in SOLID
    return plant or GREEN_STALK.fullmatch(name) is not None or name in TALL_FLOWERS


def cut_out(solid: Mask, *, crossed: bool) -> Mask:
    """The shape of a picture with holes: of two that cross, or of a hollow cube.

    Args:
        solid: ``(6, 8, 8)`` where each face is there; see `tracer.formats.minecraft.pack.pack.Dressed`.
        crossed: whether it is a plant.
    """
    x, y, z = np.indices((SIDE,) * 3)
    if crossed:
        return ((x == z) | (x == SIDE - 1 - z)) & solid[5, y, x]
    mask = np.zeros((SIDE,) * 3, bool)
    for face, (place, row, column) in enumerate(((x, z, y), (x, z, y), (y, z, x), (y, z, x), (z, y, x), (z, y, x))):
        mask |= (place == (SIDE - 1) * (face % 2)) & solid[face, row, column]
    return mask


def plant(name: str) -> Shape:
    return ((name, crossed(0, 8 if name.startswith(("tall", "large", "sugar", "kelp", "cob")) else 6)),)


def flower(name: str) -> Shape:
    return (("short_grass", box(3, 0, 3, 4, 4, 4) | box(4, 0, 4, 5, 2, 5)), (name, box(2, 4, 2, 5, 6, 5)))
