"""Names of textures in Bedrock, and in Java before 1.13, whose folder ``textures/blocks`` Bedrock has kept."""

from __future__ import annotations

import re

WORDS = (("dark_oak", "big_oak"), ("light_gray", "silver"))
RULES: tuple[tuple[str, ...], ...] = (
    ("grass_block_side_overlay", "grass_side_overlay", "grass_side"),  # its opacity says where it is grass
    (r"grass_block_(.*)", r"grass_\1"),
    (r"(?:short_)?grass", "tallgrass"),
    (r"grass_(?:side|top)",),  # of the block, not of the plant that is called grass
    ("water_still", "water_still_grey"),
    ("big_oak_sapling", "sapling_roofed_oak"),
    (r"(stripped_.*)", r"\1"),
    (r"(crimson|warped)_stem(.*)", r"\1_log\2"),
    (r"(.*)_planks", r"planks_\1"),
    (r"(.*)_(log|leaves|sapling)(_top|)", r"\2_\1\3"),
    (r"(.*)_wool", r"wool_colored_\1"),
    ("terracotta", "hardened_clay"),
    (r"(.*)_glazed_terracotta", r"glazed_terracotta_\1"),
    (r"(.*)_terracotta", r"hardened_clay_stained_\1"),
    (r"(.*)_concrete(_powder|)", r"concrete\2_\1"),
    (r"(.*)_stained_glass", r"glass_\1"),
    (r"polished_(granite|diorite|andesite)", r"stone_\1_smooth"),
    (r"(granite|diorite|andesite)", r"stone_\1"),
    (r"smooth_stone", "stone_slab_top"),
    ("stone_bricks", "stonebrick"),
    ("chiseled_stone_bricks", "stonebrick_carved"),
    (r"(mossy|cracked)_stone_bricks", r"stonebrick_\1"),
    ("mossy_cobblestone", "cobblestone_mossy"),
    (r"(red_|)sandstone", r"\1sandstone_normal"),
    (r"cut_(red_|)sandstone", r"\1sandstone_smooth"),
    (r"smooth_(red_|)sandstone", r"\1sandstone_top"),
    (r"chiseled_(red_|)sandstone", r"\1sandstone_carved"),
    (r"quartz_pillar(_top|)", r"quartz_block_lines\1"),
    (r"chiseled_quartz_block(_top|)", r"quartz_block_chiseled\1"),
    ("nether_quartz_ore", "quartz_ore"),
    (r"((?:red_)?nether)_bricks", r"\1_brick"),
    ("end_stone_bricks", "end_bricks"),
    ("bricks", "brick"),
    ("prismarine", "prismarine_rough"),
    ("dark_prismarine", "prismarine_dark"),
    (r"dirt_path_(.*)", r"grass_path_\1"),
    (r"podzol_(.*)", r"dirt_podzol_\1"),
    ("snow_block", "snow"),
    ("packed_ice", "ice_packed"),
    ("wet_sponge", "sponge_wet"),
    ("slime_block", "slime"),
    ("redstone_lamp", "redstone_lamp_off"),
    (r"((?:blast_)?furnace|smoker)_front", r"\1_front_off"),
    ("carved_pumpkin", "pumpkin_face_off"),
    ("jack_o_lantern", "pumpkin_face_on"),
    (r"tall_grass(_.*)", r"double_plant_grass\1"),
    (r"large_fern(_.*)", r"double_plant_fern\1"),
    (r"rose_bush(_.*)", r"double_plant_rose\1"),
    (r"peony(_.*)", r"double_plant_paeonia\1"),
    (r"lilac(_.*)", r"double_plant_syringa\1"),
    ("sunflower_(top|bottom)", r"double_plant_sunflower_\1"),
    ("poppy", "flower_rose"),
    ("azure_bluet", "flower_houstonia"),
    (r"(.*)_tulip", r"flower_tulip_\1"),
    ("(dandelion|blue_orchid|allium|oxeye_daisy|cornflower|lily_of_the_valley|wither_rose)", r"flower_\1"),
    ("(red|brown)_mushroom", r"mushroom_\1"),
    ("(red|brown)_mushroom_block", r"mushroom_block_skin_\1"),
    ("mushroom_stem", "mushroom_block_skin_stem"),
    ("sugar_cane", "reeds"),
    (r"kelp(?:_plant|)", "kelp_a"),
    (r"tall_seagrass_(.*)", r"seagrass_doubletall_\1_a"),
    ("lily_pad", "waterlily", "carried_waterlily"),
    ("dead_bush", "deadbush"),
    ("cobweb", "web"),
    ("torch", "torch_on"),
    ("spawner", "mob_spawner"),
)
"""What fits a whole name, and how that is called there, in order of trial; names without that are of other things."""


def older_names(name: str) -> tuple[str, ...]:
    """How a texture, named as in Java from 1.13 on, may be called there, the most likely name first."""
    older = name
    for word, own in WORDS:
        older = re.sub(rf"(?<![a-z]){word}(?![a-z])", own, older)
    for pattern, *forms in RULES:
        if match := re.fullmatch(pattern, older):
            return (*(match.expand(form) for form in forms), name) if forms else ()
    return older, name
