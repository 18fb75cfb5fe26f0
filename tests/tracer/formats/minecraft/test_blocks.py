"""What blocks look like: colours, light, layers and shapes."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from blocks import cubes_of, shape_and_glow

from post import display_encode, tone_map
from tracer.formats.minecraft.build import Builder
from tracer.formats.minecraft.colors import color, known, linear, material, table, tint_of
from tracer.formats.minecraft.legacy import legacy_state
from tracer.formats.minecraft.sections import Section
from tracer.formats.minecraft.shapes import is_nothing, parse_state, shape_of
from tracer.scene.cells import cells_of_world
from tracer.scene.scene import Scene
from tracer.traversal.rays import trace

COMMON = """
stone grass_block dirt oak_planks spruce_log stripped_birch_log jungle_leaves cherry_leaves glass water lava
red_wool light_blue_concrete white_stained_glass_pane waxed_oxidized_cut_copper_stairs
polished_blackstone_brick_wall deepslate_diamond_ore infested_stone mossy_stone_brick_slab
smooth_quartz_stairs crimson_hyphae bamboo_mosaic chain torch soul_lantern sea_lantern
prismarine_brick_stairs end_stone_brick_wall dark_oak_fence_gate iron_bars oak_wall_sign red_sandstone_wall
cut_sandstone nether_brick_fence purpur_pillar mud_brick_slab lime_shulker_box pink_bed cobweb kelp
flowering_azalea_leaves snow powder_snow packed_ice magma_block glow_lichen potted_poppy
brown_mushroom_block
campfire candle_cake lava_cauldron sea_pickle copper_lantern oxidized_copper_chain copper_torch copper_grate
waxed_weathered_lightning_rod spore_blossom big_dripleaf frogspawn resin_clump tube_coral_wall_fan warped_fungus
sulfur_spike polished_sulfur_wall cinnabar_brick_stairs potent_sulfur red_poplar_leaves poplar_shelf red_shrub
shelf_mushroom straw_bed cyan_concrete_slab magenta_wool_stairs golden_dandelion
closed_eyeblossom cactus_flower tall_dry_grass wildflowers cocoa turtle_egg dried_ghast sign grass_path shulker_box
"""


@pytest.mark.parametrize("name", COMMON.split())
def test_common_blocks_have_a_colour_or_are_left_out(name: str):
    assert known(name) or is_nothing(name) or shape_of(name, {}) is not None
    assert max(material(name, "plains").albedo) <= 0.85


def test_every_number_before_1_13_is_drawn():
    for number in range(256):
        for data in range(16):
            name, told = parse_state(legacy_state(number, data))
            if name.startswith("legacy_"):
                assert number in (253, 254)
                continue
            parts = shape_of(name, told)
            drawn = [name] if parts is None else [part for part, _ in parts]
            assert is_nothing(name) or all(known(part) or part in table()["emission"] for part in drawn), name


def test_families_follow_their_table():
    assert color("red_wool") == linear(table()["dyes"]["red"])
    assert color("spruce_stairs") == color("spruce_planks") == linear(table()["woods"]["spruce"][0])
    assert color("stripped_oak_log") == linear(table()["woods"]["oak"][0])
    assert color("waxed_cut_copper_slab") == color("copper_block")
    assert color("nothing_of_the_kind") is None
    assert tint_of("water", "swamp") != tint_of("water", "plains")


def test_blocks_of_mods_have_the_colour_of_what_their_names_end_in():
    """As in a world of Twilight Forest, whose wood was grey."""
    names = ("canopy_leaves", "canopy_log", "canopy_fence", "stripped_canopy_log", "canopy_bark", "ruby_ore")
    kinds = ("oak_leaves", "oak_log", "oak_planks", "oak_planks", "oak_log", "stone")
    assert [color(name) for name in names] == [color(kind) for kind in kinds]
    assert color("marble_stairs") is None


def test_layers_and_light():
    assert material("stone", "").opacity == 1
    assert 0.05 < material("oak_leaves", "jungle").albedo[1] < 0.4
    assert material("water", "plains").opacity < 0.5
    assert material("blue_stained_glass", "").tint[2] > material("blue_stained_glass", "").tint[0]
    for lamp in ("torch_head", "glowstone", "lava", "sea_lantern", "lantern_glass"):
        assert max(material(lamp, "").emission) > 1, lamp
    assert material("lit_redstone_lamp", "").emission != material("redstone_lamp", "").emission


@pytest.mark.parametrize(("lamp", "green", "blue"), [("lava", 0.85, 0.6), ("glowstone", 0.93, 0.7)])
def test_lamps_have_a_colour_in_pictures_by_day(lamp: str, green: float, blue: float):
    """They were cream: film fades to white what is bright."""
    light = torch.tensor(material(lamp, "").emission).view(1, 3, 1, 1)
    r, g, b = display_encode(tone_map(light, exposure=1.55)).flatten().tolist()
    assert g < green * r
    assert b < blue * r


@pytest.mark.parametrize(
    ("state", "count"),
    [
        ("oak_slab[type=bottom]", 256),
        ("oak_slab[type=top]", 256),
        ("oak_stairs[facing=east,half=bottom,shape=straight]", 384),
        ("oak_stairs[facing=east,half=top,shape=inner_left]", 448),
        ("oak_stairs[facing=east,half=bottom,shape=outer_right]", 320),
        ("snow[layers=3]", 192),
        ("water[level=3]", 320),
        ("oak_fence[north=true]", 32 + 2 * 6),
        ("red_carpet", 64),
        ("torch", 12),
    ],
)
def test_shapes_fill_what_they_should(state: str, count: int):
    blocks = cubes_of(f"minecraft:{state}").build()
    assert blocks.shaped is not None
    cells, _ = cells_of_world(blocks.shaped.model)
    assert len(cells) == count
    assert cells.min() >= 0
    assert cells.max() < 8


def test_what_hangs_on_a_wall_is_turned_with_it():
    for facing, (axis, place) in {"north": (2, 7), "south": (2, 0), "east": (0, 0), "west": (0, 7)}.items():
        filled = np.argwhere(shape_and_glow(f"oak_wall_sign[facing={facing}]")[0])
        assert (filled[:, axis] == place).all()
    where = np.argwhere(shape_and_glow("cocoa[facing=west]")[0])
    assert where[:, 0].max() < 4


@pytest.mark.parametrize(
    ("state", "axis"),
    [("iron_chain[axis=x]", 0), ("chain[axis=y]", 1), ("lightning_rod[facing=up]", 1), ("end_rod[facing=south]", 2)],
)
def test_rods_lie_along_their_axis(state: str, axis: int):
    filled = shape_and_glow(state)[0]
    assert np.ptp(np.argwhere(filled), axis=0).tolist() == [7 if n == axis else 1 for n in range(3)]


@pytest.mark.parametrize(
    ("bare", "told"),
    [
        ("soul_wall_torch", "soul_wall_torch[facing=north]"),
        ("redstone_torch", "redstone_torch[lit=true]"),
        ("water_cauldron", "water_cauldron[level=1]"),
        ("tube_coral_fan", "tube_coral_fan[waterlogged=true]"),
        ("end_rod", "end_rod[facing=up]"),
        ("iron_chain", "iron_chain[axis=y]"),
        ("nether_portal", "nether_portal[axis=x]"),
        ("vine[north=true]", "vine[north=true,up=false,south=false]"),
        ("brick_wall[east=tall]", "brick_wall[east=tall,up=true,west=none]"),
        ("oak_stairs[half=top]", "oak_stairs[facing=north,half=top,shape=straight]"),
    ],
)
def test_what_a_state_leaves_out_is_as_the_game_has_it(bare: str, told: str):
    for one, other in zip(shape_and_glow(bare), shape_and_glow(told), strict=True):
        assert (one == other).all()
    wet = [bool(cells_of_world(cubes_of(f"minecraft:{state}").build().world)[1].any()) for state in (bare, told)]
    assert wet[0] == wet[1] == (bare == "tube_coral_fan")


def test_portals_are_as_thin_as_their_axis_says():
    assert np.ptp(np.argwhere(shape_and_glow("nether_portal[axis=x]")[0]), axis=0).tolist() == [7, 7, 1]
    assert np.ptp(np.argwhere(shape_and_glow("nether_portal[axis=z]")[0]), axis=0).tolist() == [1, 7, 7]


def test_what_grows_on_sides_lies_on_them():
    filled = shape_and_glow("glow_lichen[down=true,north=true]")[0]
    _, y, z = np.argwhere(filled).T
    assert ((y == 0) | (z == 0)).all()
    assert ((y == 0) & (z > 0)).any()
    assert ((z == 0) & (y > 0)).any()


def test_full_forms_are_cubes():
    blocks = cubes_of("minecraft:oak_slab[type=double]", "minecraft:snow[layers=8]", "minecraft:water[level=0]").build()
    assert blocks.shaped is None
    assert len(cells_of_world(blocks.world)[0]) == 3


def test_stairs_rise_to_where_they_face():
    for facing, (x, z) in {"east": (1, 0), "west": (-1, 0), "south": (0, 1), "north": (0, -1)}.items():
        parts = shape_of("oak_stairs", {"facing": facing})
        assert parts is not None
        where = np.argwhere(parts[0][1][:, 4:]).mean(axis=0) - (3.5, 1.5, 3.5)
        assert np.allclose(where[[0, 2]], (2 * x, 2 * z))


def test_what_stands_in_water_stands_in_water():
    blocks = cubes_of("minecraft:seagrass", "minecraft:oak_slab[type=top,waterlogged=true]").build()
    names = [blocks.world.materials.names[int(n)] for n in cells_of_world(blocks.world)[1]]
    assert names == ["water in plains"] * 2
    assert blocks.shaped is not None


def test_shapes_lie_where_their_blocks_are():
    states = ["minecraft:air"] * 19  # the last one lies in the next row
    states[0], states[1], states[18] = "minecraft:stone", "minecraft:oak_slab[type=bottom]", "minecraft:snow[layers=2]"
    blocks = cubes_of(*states).build()
    scene = Scene(world=blocks.world, instances=blocks.instances)
    origins = torch.tensor([[0.5, 9.0, 0.5], [1.5, 9.0, 0.5], [2.5, 9.0, 1.5], [2.5, 9.0, 0.5]])
    hits = trace(scene, origins, torch.tensor([[0.0, -1.0, 0.0]]).expand(4, 3), poses=scene.poses([0.0])[0][None])
    assert hits.hit.tolist() == [True, True, True, False]
    assert torch.allclose(hits.t[:3], torch.tensor([8.0, 8.5, 8.75]))


def test_same_groups_of_shapes_share_their_bricks():
    builder = Builder()
    blocks = np.ones(4096, np.int64)
    for x in range(8):
        states = ("minecraft:air", "minecraft:poppy")
        builder.add(x, 0, Section(y=0, states=states, blocks=blocks, biomes=("plains",), biome=None))
    shaped = builder.build().shaped
    assert shaped is not None
    assert len(shaped.model.bricks) == 2
    assert int((shaped.model.index > 0).sum()) == 8 * 512
