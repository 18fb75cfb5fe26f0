"""Packs of Bedrock, and of Java before 1.13: names of their own, TGA pictures, one value for a whole map."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from writers.pack import flat, png, write_pack

from tracer.formats.minecraft.build import Builder
from tracer.formats.minecraft.colors import tint_of
from tracer.formats.minecraft.pack.older import older_names
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.sections import Section
from tracer.scene.textures import COLOR, COLUMNS, GLOW, METAL, ROUGH, TILT

BLOCKS = "textures/blocks/"
FACES = ("west", "east", "down", "up", "north", "south")
A, B = 188, 137  # sRGB of 0.5 and 0.25
MER, MERS = "metalness_emissive_roughness", "metalness_emissive_roughness_subsurface"


def tga(pixels: Any) -> bytes:
    out = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(out, "TGA")
    return out.getvalue()


def told(**layers: Any) -> bytes:
    return b"// of a tool\n" + json.dumps({"format_version": "1.21.30", "minecraft:texture_set": layers}).encode()


def built(pack: Path, *states: str) -> tuple[dict[str, dict[str, np.ndarray]], tuple[str, ...]]:
    """Texels ``(S, S, 10)`` of materials by name and face, rows along the face's second axis; and what has none."""
    builder, blocks = Builder(Pack(pack)), np.zeros(4096, np.int64)
    blocks[: 2 * len(states) : 2] = np.arange(1, len(states) + 1)
    given = ("air", *states)
    builder.add(0, 0, Section(y=0, states=given, blocks=blocks, biomes=("plains",), biome=None))
    done = builder.build()
    table = done.world.materials
    assert table.textures is not None
    found: dict[str, dict[str, np.ndarray]] = {}
    for number, name in enumerate(table.names):
        for face, (first, side) in zip(FACES, table.textures.faces[number].tolist(), strict=True):
            texels = table.textures.texels[first : first + side * side].view(side, side, COLUMNS)
            found.setdefault(name, {})[face] = texels.numpy()
    return found, done.untextured


def test_older_names_of_files(tmp_path: Path):
    files = {
        "log_oak.png": png(flat(A, A, A)),
        "log_big_oak_top.png": png(flat(A, A, A)),
        "log_oak_top.png": png(flat(B, B, B)),
        "planks_big_oak.png": png(flat(A, 0, 0)),
        "wool_colored_silver.tga": tga(flat(0, A, 0)),
        "stone_granite.png": png(flat(0, 0, A)),
        "deepslate/deepslate.png": png(flat(A, A, 0)),
        "leaves_birch.tga": tga(flat(A, A, A, 255)),
        "grass_side.png": png(flat(B, 0, 0)),
        "grass_top.png": png(flat(A, A, A)),
    }
    pack = write_pack(tmp_path / "a.mcpack", {BLOCKS + name: data for name, data in files.items()})
    states = ("oak_log", "dark_oak_planks", "light_gray_wool", "granite", "deepslate", "birch_leaves", "short_grass")
    found, without = built(pack, *states)
    assert without == ("short_grass",), "the sides of grass blocks are no picture of the plant"
    assert found["oak_log"]["up"][0, 0, COLOR] == pytest.approx(0.25, abs=0.01)
    means = {name: found[name]["south"][0, 0, COLOR : COLOR + 3].round(1).tolist() for name in states[:5]}
    assert means == {
        "oak_log": [0.5, 0.5, 0.5],
        "dark_oak_planks": [0.5, 0.0, 0.0],
        "light_gray_wool": [0.0, 0.5, 0.0],
        "granite": [0.0, 0.0, 0.5],
        "deepslate": [0.5, 0.5, 0.0],
    }


def test_words_are_whole_in_older_names():
    assert older_names("dark_oak_sapling")[0] == "sapling_roofed_oak"
    assert older_names("dark_oaken") == ("dark_oaken", "dark_oaken")


@pytest.mark.parametrize("masked", [True, False])
def test_opacity_of_the_side_of_grass_says_where_it_is_tinted(tmp_path: Path, masked: bool):
    side = np.array(flat(B, B, B, 0 if masked else 255))
    side[0] = A, A, A, 255
    files = {"grass_side.tga": tga(side), "grass_top.png": png(flat(A, A, A)), "dirt.png": png(flat(B, B, B))}
    pack = write_pack(tmp_path / "a", {BLOCKS + name: data for name, data in files.items()})
    found, without = built(pack, "grass_block")
    low, high = found["grass_block in plains"]["south"][:, 0, COLOR : COLOR + 3]  # y goes up
    tint = np.array(tint_of("grass", "plains")) if masked else np.ones(3)
    assert without == ()
    assert high == pytest.approx(0.5 * tint, abs=0.01)
    assert low == pytest.approx([0.25] * 3, abs=0.01)


@pytest.mark.parametrize(
    ("layers", "metal", "rough"),
    [
        ({MER: [255, 0, 51]}, 1.0, 0.2),
        ({MER: "#330033"}, 0.2, 0.2),
        ({MERS: "#80000033"}, 0.0, 0.2),
        ({MERS: "stone_mers"}, 0.4, 0.8),
        ({MER: [255, 0, 999]}, 0.0, None),
    ],
)
def test_maps_are_pictures_or_one_value(tmp_path: Path, layers: dict[str, Any], metal: float, rough: float | None):
    files = {
        "stone.png": png(flat(A, A, A)),
        "stone_mers.tga": tga(flat(102, 0, 204, 0)),
        "stone.texture_set.json": told(color="stone", **layers),
        "andesite.png": png(flat(A, A, A)),
    }
    found, _ = built(write_pack(tmp_path / "a.zip", {BLOCKS + n: data for n, data in files.items()}), "stone")
    texel = found["stone"]["up"][0, 0]
    if rough is not None:
        assert texel[ROUGH] == pytest.approx(rough, abs=0.01)
    assert texel[METAL] == pytest.approx(metal, abs=0.01)
    assert texel[GLOW] == 0


def test_height_maps_turn_normals_away_from_what_is_high(tmp_path: Path):
    height = np.zeros((16, 16), np.uint8)
    height[4:12, 4:12] = 255
    files = {
        "stone.png": png(flat(A, A, A, side=16)),
        "stone_h.png": png(height),
        "stone.texture_set.json": told(color="stone", heightmap="stone_h"),
    }
    found, _ = built(write_pack(tmp_path / "a.zip", {BLOCKS + n: data for n, data in files.items()}), "stone")
    tilt = found["stone"]["up"][..., TILT : TILT + 2]  # rows along z, columns along x
    slope = 0.5 / np.hypot(1, 0.5)  # half a texel's width in height over one texel
    assert tilt[8, 3] == pytest.approx([-slope, 0], abs=1e-4)
    assert tilt[8, 12] == pytest.approx([slope, 0], abs=1e-4)
    assert tilt[3, 8] == pytest.approx([0, -slope], abs=1e-4)
    assert not tilt[8, 8].any()


def test_grey_of_sixteen_bits_is_not_cut_off(tmp_path: Path):
    out = io.BytesIO()
    Image.fromarray(np.full((2, 2), A * 257, np.uint16)).save(out, "PNG")
    found, _ = built(write_pack(tmp_path / "a.zip", {f"{BLOCKS}stone.png": out.getvalue()}), "stone")
    assert found["stone"]["up"][..., COLOR] == pytest.approx(np.full((2, 2), 0.5), abs=0.01)
