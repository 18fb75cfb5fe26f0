"""A garden of Minecraft's blocks, written as a schematic, and a resource pack whose pictures are drawn here.

Quads, slabs, stairs and fences, and blocks of each render layer: solid bricks, cutout glass and flowers, mipped cutout
leaves, translucent water and stained glass. Needs `pip install gbufrt[worlds]`.
"""

from pathlib import Path

import nbtlib
import numpy as np
from PIL import Image

import tracer

EYE, TARGET = (12.0, 6.5, 25.0), (13.0, 6.0, 6.0)
FLOWERS = {"poppy": (214, 40, 30), "dandelion": (250, 206, 50), "cornflower": (70, 110, 230)}
v, u = np.mgrid[:16, :16]
every, edge, stem = u >= 0, (u % 15 == 0) | (v % 15 == 0), (abs(u - 7.5) < 1) & (v > 6)
head, hole = abs(u - 7.5) + abs(v - 5.5) < 4, np.random.default_rng(1).random((8, 8)).repeat(2, 0).repeat(2, 1) < 0.25
PICTURES = {  # of the pack: a colour, another one and where it is, and how opaque the picture is
    "bricks": ((150, 62, 48), (176, 168, 160), (v % 4 == 0) | ((u + v // 4 * 4) % 8 == 0), every),
    "oak_planks": ((186, 146, 92), (120, 88, 52), v % 4 == 0, every),
    "oak_log": ((104, 82, 50), (66, 50, 30), u % 4 == 0, every),
    "oak_leaves": ((120, 160, 90), (90, 130, 70), hole.T, ~hole),
    "glass": ((225, 235, 240), (225, 235, 240), every, edge | (abs(u + v - 12) < 1)),
    "red_stained_glass": ((200, 40, 40), (140, 20, 20), edge, np.where(edge, 1.0, 0.4)),
    "short_grass": ((130, 160, 110), (100, 130, 80), u % 4 == 0, v >= 3 * (u // 2 * 5 % 4)),
    **{name: ((60, 130, 40), color, head, stem | head) for name, color in FLOWERS.items()},
}


def garden(folder: Path, *, textured: bool) -> tracer.Scene:
    """The garden at 16.2 h, with the pack's pictures or in gbufrt's own colours; its files go into ``folder``."""
    random, blocks = np.random.default_rng(3), np.full((14, 30, 30), "air", dtype="U64")  # y, z, x
    blocks[:3], blocks[3] = "dirt", "grass_block"
    blocks[4] = random.choice([*FLOWERS, "short_grass", "air"], (30, 30), p=[0.1, 0.1, 0.1, 0.2, 0.5])
    blocks[3:5, 11:17, 6:14], blocks[3, 11:17, 6:14] = "air", "water"  # a pond
    blocks[3, 8:26, 15:17], blocks[4, 8:26, 15:17] = "cobblestone", "stone_slab[type=bottom]"  # a path
    blocks[4:8, 2:8, 12:21], blocks[4:8, 3:7, 13:20] = "bricks", "air"  # a house
    blocks[4:7, 7, 15:17], blocks[5:7, 7, 13], blocks[5:7, 7, 18:20] = "air", "red_stained_glass", "glass"
    for n in range(4):  # its roof
        blocks[8 + n, 1 + n, 11:22], blocks[8 + n, 8 - n, 11:22] = (
            "oak_stairs[facing=south]",
            "oak_stairs[facing=north]",
        )
        blocks[8 + n, 2 + n : 8 - n, 12:21] = "oak_planks"
    blocks[4:8, 8, 4], blocks[7:10, 6:11, 2:7], blocks[10, 7:10, 3:6] = "oak_log", "oak_leaves", "oak_leaves"
    blocks[4, 18, 3:14], blocks[4, 18, 18:27] = ("oak_fence[east=true,west=true]",) * 2
    blocks[5, 18, [3, 13, 18, 26]] = "torch"
    names, numbers = np.unique(blocks, return_inverse=True)
    tags = {"Version": 2, "DataVersion": 2586, "Width": 30, "Height": 14, "Length": 30}
    schematic = nbtlib.Compound({key: nbtlib.Int(value) for key, value in tags.items()})
    schematic["Palette"] = nbtlib.Compound({f"minecraft:{name}": nbtlib.Int(n) for n, name in enumerate(names)})
    schematic["BlockData"] = nbtlib.ByteArray(numbers.ravel().astype(np.int8))
    (textures := folder / "pack/assets/minecraft/textures/block").mkdir(parents=True, exist_ok=True)
    nbtlib.File(schematic, gzipped=True, root_name="Schematic").save(path := folder / "garden.schem")
    for name, (color, other, where, opaque) in PICTURES.items():
        rgb = np.where(where[..., None], other, color) * random.uniform(0.85, 1.0, (16, 16, 1))
        Image.fromarray(np.dstack([rgb, 255 * opaque]).astype(np.uint8)).save(textures / f"{name}.png")
    return tracer.at_hour(tracer.load(path, pack=folder / "pack" if textured else None), 16.2)
