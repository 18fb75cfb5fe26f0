"""Resource packs: which texture lies how on which face, its maps and its tint."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from writers.pack import (
    CORNERS,
    FACES,
    UPRIGHT,
    A,
    B,
    C,
    at,
    flat,
    json_files,
    png,
    seen_from_outside,
    table_of,
    textures,
    tile,
    write_pack,
)

from tracer.formats.minecraft.build import Builder
from tracer.formats.minecraft.colors import material, tint_of
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.sections import Section
from tracer.scene.textures import COLOR, GLOW, METAL, ROUGH, TILT


@pytest.mark.parametrize("where", ["pack.zip", "pack", "pack.jar"])
def test_pictures_stand_upright_on_every_side(tmp_path: Path, where: str):
    table, (number,) = table_of(write_pack(tmp_path / where, textures(stone=CORNERS)), "stone")
    for face in FACES:
        assert seen_from_outside(table, number, face) == UPRIGHT, face


def test_logs_lie_along_their_axis(tmp_path: Path):
    """By names alone: the bark's picture, which stands upright on a tree, points along the axis."""
    pack = write_pack(tmp_path / "a.zip", textures(oak_log=CORNERS, oak_log_top=flat(A, A, A)))
    table, (up, x, z) = table_of(pack, "oak_log", "oak_log[axis=x]", "oak_log[axis=z]")
    for number, ends in ((up, ("up", "down")), (x, ("east", "west")), (z, ("north", "south"))):
        whole = {face: len(set(tile(table, number, face)[..., COLOR].flatten().tolist())) == 1 for face in FACES}
        assert {face for face, one in whole.items() if one} == set(ends)
    assert seen_from_outside(table, up, "south") == UPRIGHT
    above = [[float(at(table, x, "up", (a, 1.0, b))[COLOR]) for a in (0.25, 0.75)] for b in (0.25, 0.75)]
    columns = {round(sum(pair), 2) for pair in zip(*above, strict=True)}
    assert columns == {0.75, 0.12}, "the picture's rows must lie across x"


def test_fronts_face_where_their_state_says(tmp_path: Path):
    """By names alone: most packs hold textures and no models."""
    grey = {name: flat(B, B, B) for name in ("furnace_side", "furnace_top", "pumpkin_side", "pumpkin_top")}
    fronts = dict.fromkeys(("furnace_front", "carved_pumpkin", "jack_o_lantern"), CORNERS)
    pack = write_pack(tmp_path / "a.zip", textures(**grey, **fronts, furnace_front_on=flat(A, A, A)))
    states = ("furnace[facing=east,lit=false]", "furnace[facing=north,lit=true]", "carved_pumpkin[facing=west]")
    table, numbers = table_of(pack, *states, "jack_o_lantern[facing=south]")
    plain, lit = [[0.25] * 2] * 2, [[0.5] * 2] * 2
    for number, wanted, front in zip(
        numbers, ["east", "north", "west", "south"], (UPRIGHT, lit, UPRIGHT, UPRIGHT), strict=True
    ):
        for face in FACES:
            assert seen_from_outside(table, number, face) == (front if face == wanted else plain), (wanted, face)


CUBE = {"from": [0, 0, 0], "to": [16, 16, 16]}


def test_models_follow_parents_references_uv_and_rotation(tmp_path: Path):
    faces: dict[str, Any] = {face: {"texture": "#around"} for face in FACES}
    faces["up"] = {"texture": "#lid", "rotation": 90}
    faces["north"] = {"texture": "#lid", "uv": [16, 0, 0, 16]}
    pack = write_pack(
        tmp_path / "a.zip",
        textures(side=flat(B, B, B), lid=CORNERS)
        | json_files(
            models__block__base={"elements": [{**CUBE, "faces": faces}], "textures": {"around": "block/lid"}},
            models__block__child={"parent": "block/base", "textures": {"lid": "#real", "around": "block/side"}},
            models__block__barrel={"parent": "minecraft:block/child", "textures": {"real": "minecraft:block/lid"}},
            blockstates__barrel={
                "variants": {
                    "facing=up": {"model": "block/barrel"},
                    "facing=east": [{"model": "block/barrel", "y": 90}, {"model": "block/none"}],
                    "facing=north": {"model": "block/barrel", "x": 90},
                }
            },
        ),
    )
    states = [f"barrel[facing={way}]" for way in ("up", "east", "north")]
    table, (up, east, north, bare) = table_of(pack, *states, "barrel")
    turned, mirrored = [[0.12, 0.5], [0.0, 0.25]], [[0.25, 0.5], [0.0, 0.12]]
    assert seen_from_outside(table, up, "up") == turned
    assert seen_from_outside(table, up, "north") == mirrored
    assert seen_from_outside(table, up, "south") == [[0.25, 0.25], [0.25, 0.25]]
    assert seen_from_outside(table, east, "east") == mirrored, "y = 90 turns north to east"
    assert seen_from_outside(table, east, "up") == [[0.0, 0.12], [0.25, 0.5]], "the lid turns with it"
    assert seen_from_outside(table, north, "north") == [[0.25, 0.0], [0.5, 0.12]], "x = 90 turns up to north"
    assert bare == north, "a state that leaves a property out has its default"


def test_biomes_tint_what_is_grey(tmp_path: Path):
    overlay = np.zeros((2, 2, 4), np.uint8)
    overlay[0] = (A, A, A, 255)
    pack = write_pack(
        tmp_path / "a.zip",
        textures(
            grass_block_top=flat(A, A, A),
            grass_block_side=flat(B, B, B),
            grass_block_side_overlay=overlay,
            stone=CORNERS,
        )
        | textures(dirt=flat(C, C, C), spruce_leaves=flat(A, A, A)),
    )
    for biome in ("plains", "desert"):
        table, (grass, leaves) = table_of(pack, "grass_block", "spruce_leaves", biome=biome)
        tint = torch.tensor(tint_of("grass", biome))
        torch.testing.assert_close(at(table, grass, "up", (0.5, 1, 0.5))[:3], 0.5 * tint, atol=0.01, rtol=0)
        torch.testing.assert_close(at(table, grass, "south", (0.5, 0.8, 1))[:3], 0.5 * tint, atol=0.01, rtol=0)
        assert at(table, grass, "south", (0.5, 0.2, 1))[:3].tolist() == pytest.approx([0.25] * 3, abs=0.01)
        assert at(table, grass, "down", (0.5, 0, 0.5))[:3].tolist() == pytest.approx([0.12] * 3, abs=0.01)
        own = material("spruce_leaves", "").albedo
        assert at(table, leaves, "up", (0.5, 1, 0.5))[:3].tolist() == pytest.approx(own, abs=0.01)


def test_shaped_blocks_and_families_have_the_texture_of_what_they_are_made_of(tmp_path: Path):
    pack = write_pack(tmp_path / "a.zip", textures(oak_planks=CORNERS, stone_bricks=flat(A, A, A)))
    builder = Builder(Pack(pack))
    states = ("minecraft:oak_stairs[facing=north]", "minecraft:stone_brick_slab[type=bottom]", "minecraft:torch")
    blocks = np.arange(4096) % 3
    builder.add(0, 0, Section(y=0, states=states, blocks=blocks, biomes=("plains",), biome=None))
    built = builder.build()
    textures_of = built.world.materials.textures
    assert built.shaped is not None
    assert textures_of is not None
    has = dict(zip(built.world.materials.names, (textures_of.faces[..., 1] > 0).all(dim=1).tolist(), strict=True))
    assert has["oak_stairs"]
    assert has["stone_brick_slab"]
    assert not has["stick"]
    assert built.untextured == ()
    assert built.shaped.model.materials is built.world.materials


def test_faces_and_fires_glow_on_their_own_side_alone(tmp_path: Path):
    """What is brighter than most of the front does: a quarter of it here, in which the power of the front lies."""
    front = np.repeat(np.repeat(np.array([[[A, 0, 0], [B, 0, 0]], [[B, 0, 0], [B, 0, 0]]]), 4, axis=0), 4, axis=1)
    plain = {name: flat(A, A, A) for name in ("pumpkin_side", "pumpkin_top", "furnace_side", "furnace_top")}
    pack = write_pack(tmp_path / "a.zip", textures(**plain, jack_o_lantern=front, furnace_front_on=front))
    states = {"jack_o_lantern[facing=south]": "south", "furnace[facing=west,lit=true]": "west"}
    table, numbers = table_of(pack, *states)
    for number, side, name in zip(numbers, states.values(), ("jack_o_lantern", "lit_furnace"), strict=True):
        for other in ("west", "east", "down", "up", "north", "south"):
            glow = tile(table, number, other)[..., GLOW : GLOW + 3]
            assert bool(glow.any()) == (other == side)
            if other == side:
                assert float((glow[..., 0] > 0).float().mean()) == 0.25
                torch.testing.assert_close(glow.mean(dim=(0, 1)), torch.tensor(material(name, "").emission))


def test_what_has_no_texture_keeps_its_colour_and_is_told(tmp_path: Path):
    builder = Builder(Pack(write_pack(tmp_path / "a.zip", textures(stone=CORNERS))))
    blocks = np.arange(4096) % 2
    builder.add(0, 0, Section(y=0, states=("stone", "gold_block"), blocks=blocks, biomes=("plains",), biome=None))
    built = builder.build()
    number = built.world.materials.id("gold_block")
    assert built.untextured == ("gold_block",)
    assert built.world.materials.albedo[number].tolist() == pytest.approx(material("gold_block", "").albedo)
    assert built.world.materials.textures is not None
    assert not built.world.materials.textures.faces[number].any()


def test_lab_pbr(tmp_path: Path):
    """Smoothness, metals from 230 on, emission up to 254 (255 is none), and normals that are x right and y down."""
    normal = np.full((2, 2, 4), 255, np.uint8)
    normal[..., 0], normal[..., 1] = 204, 166  # 0.6 rightward, 0.3 downward
    lab = np.array([[[255, 10, 0, 255], [0, 229, 0, 254]], [[51, 230, 0, 127], [51, 255, 0, 0]]], np.uint8)
    pack = write_pack(tmp_path / "a.zip", textures(stone=flat(A, A, A), stone_n=normal, stone_s=lab))
    table, (number,) = table_of(pack, "stone")
    top = tile(table, number, "up")  # rows along z, columns along x: as in the picture
    torch.testing.assert_close(top[..., ROUGH], torch.tensor([[0.0, 1.0], [0.8, 0.8]]), atol=1e-3, rtol=0)
    assert top[..., METAL].tolist() == [[0, 0], [1, 1]]
    glow = top[..., GLOW]
    assert glow[0, 0] == glow[1, 1] == 0
    assert float(glow[0, 1]) == pytest.approx(2 * float(glow[1, 0]))
    assert float(table.emission[number, 0]) == pytest.approx(float(glow.mean()), rel=1e-4), "voxels light by the mean"
    tilts = {"up": (0.6, 0.3), "south": (0.6, -0.3), "north": (-0.6, -0.3), "east": (-0.3, -0.6), "west": (-0.3, 0.6)}
    for face, tilt in tilts.items():
        assert tile(table, number, face)[0, 0, TILT : TILT + 2].tolist() == pytest.approx(tilt, abs=0.01), face


def test_bedrock_texture_sets(tmp_path: Path):
    told = {"minecraft:texture_set": {"color": "stone", "metalness_emissive_roughness": "stone_mer"}}
    files = {
        "textures/blocks/stone.png": png(CORNERS),
        "textures/blocks/stone_mer.png": png(flat(255, 51, 102)),
        "textures/blocks/stone.texture_set.json": json.dumps(told).encode(),
    }
    table, (number,) = table_of(write_pack(tmp_path / "a.zip", files), "stone")
    texel = at(table, number, "up", (0.1, 1, 0.1))
    assert texel[METAL] == 1
    assert float(texel[ROUGH]) == pytest.approx(0.4)
    assert float(texel[GLOW]) == pytest.approx(0.5 * 0.2 * 5.0, rel=0.02)


def test_lamps_keep_their_power(tmp_path: Path):
    """A lamp sends as much light with textures as without, but its dark texels less than its bright ones."""
    table, (number,) = table_of(write_pack(tmp_path / "a.zip", textures(glowstone=CORNERS)), "glowstone")
    assert table.emission[number].tolist() == pytest.approx(material("glowstone", "").emission, rel=1e-4)
    glow = tile(table, number, "up")[..., GLOW]
    assert float(glow[0, 0]) > 1.5 * float(glow[0, 1]) > 0
