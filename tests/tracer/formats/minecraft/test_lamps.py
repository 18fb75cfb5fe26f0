"""Which blocks glow, and which part of them."""

from __future__ import annotations

import pytest
from blocks import cubes_of, shape_and_glow


@pytest.mark.parametrize(
    ("facing", "axis", "place"), [("west", 0, 0), ("east", 0, 7), ("north", 2, 0), ("south", 2, 7)]
)
@pytest.mark.parametrize(("block", "name"), [("jack_o_lantern", "jack_o_lantern"), ("furnace", "lit_furnace")])
def test_faces_and_fires_glow_on_their_own_side_alone(facing: str, axis: int, place: int, block: str, name: str):
    built = cubes_of(f"minecraft:{block}[facing={facing},lit=true]").build()
    assert built.shaped is not None
    names = built.shaped.model.materials.names
    voxels = built.shaped.model.bricks.max(dim=0).values[:8, :8, :8]
    glows = voxels == names.index(f"{name}_front")
    assert bool((voxels > 0).all())
    where = glows.nonzero()
    assert (where[:, axis] == place).all()
    across = where[:, 2 - axis]  # not at the edges, where other sides would show it
    assert int(across.min()) > 0
    assert int(across.max()) < 7
    assert int(where[:, 1].min()) > 0
    assert int(where[:, 1].max()) < 7
    assert float(built.shaped.model.materials.emission[1:].amax(dim=1).gt(0).sum()) == 1


@pytest.mark.parametrize(
    ("lit", "dark"),
    [
        ("campfire[lit=true]", "campfire[lit=false]"),
        ("red_candle[candles=3,lit=true]", "red_candle[candles=3,lit=false]"),
        ("candle_cake[lit=true]", "candle_cake[lit=false]"),
        ("lava_cauldron", "water_cauldron[level=3]"),
        ("sea_pickle[pickles=2,waterlogged=true]", "sea_pickle[pickles=2,waterlogged=false]"),
        ("cave_vines[berries=true]", "cave_vines[berries=false]"),
        ("smoker[facing=east,lit=true]", "lectern"),
        ("waxed_oxidized_copper_lantern", "copper_chain"),
        ("copper_wall_torch[facing=north]", "redstone_wall_torch[facing=north,lit=false]"),
    ],
)
def test_only_a_part_glows_and_only_when_it_burns(lit: str, dark: str):
    filled, glows = shape_and_glow(lit)
    assert 0 < glows.sum() < filled.sum()
    assert not shape_and_glow(dark)[1].any()


@pytest.mark.parametrize("state", ["copper_bulb", "waxed_exposed_copper_bulb", "redstone_lamp", "redstone_ore"])
def test_whole_blocks_glow_when_they_are_lit(state: str):
    for lit in (True, False):
        materials = cubes_of(f"minecraft:{state}[lit={str(lit).lower()}]").build().world.materials
        assert (float(materials.emission.max()) > 0) is lit
