"""What blocks before 1.13 leave to their neighbours."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tracer.formats.minecraft.joined import joined, joined_chunk
from tracer.formats.minecraft.legacy import legacy_state
from tracer.formats.minecraft.sections import Section
from tracer.formats.minecraft.shapes import parse_state

AIR, STONE, FENCE, BARS, WALL, GATE = (0, 0), (1, 0), (85, 0), (101, 0), (139, 0), (107, 0)


def told(*layers: list[list[tuple[int, int]]], goes_on: bool = False) -> dict[tuple[int, int, int], dict[str, str]]:
    """What the states of ``layers`` (from below, rows from north) say, by x, y, z; ``name`` is that of the block."""
    states = sorted({block for layer in layers for row in layer for block in row})
    blocks = np.array([[[states.index(block) for block in row] for row in layer] for layer in layers])
    names, numbers = joined([legacy_state(*state) for state in states], blocks, goes_on=goes_on)
    return {
        (int(x), int(y), int(z)): {"name": parse_state(names[n])[0], **parse_state(names[n])[1]}
        for (y, z, x), n in np.ndenumerate(numbers)
    }


def arms(properties: dict[str, str]) -> str:
    return "".join(side[0] for side in ("north", "east", "south", "west") if properties.get(side) == "true")


def test_fences_and_panes_reach_for_what_they_join():
    found = told([[AIR, FENCE, AIR], [STONE, FENCE, GATE], [AIR, BARS, (20, 0)]])
    assert arms(found[1, 0, 1]) == "new"  # a fence, a gate and a stone, but not bars
    assert arms(found[1, 0, 0]) == "s"
    assert arms(found[1, 0, 2]) == "e"  # glass; a fence is none of theirs
    assert arms(told([[(113, 0), FENCE, (18, 0)]])[1, 0, 0]) == ""  # fences of nether brick keep apart, leaves too


def test_fences_reach_the_backs_of_stairs_alone():
    assert arms(told([[FENCE, (53, 1)]])[0, 0, 0]) == "e"  # rises to the west
    assert arms(told([[FENCE, (53, 0)]])[0, 0, 0]) == ""


def test_walls_are_posts_but_where_they_run_straight_under_nothing():
    row = [WALL, WALL, WALL]
    assert told([row])[1, 0, 0]["up"] == "false"
    assert told([row])[0, 0, 0]["up"] == "true"
    assert told([row], [[AIR, STONE, AIR]])[1, 0, 0]["up"] == "true"


def test_arms_go_on_into_chunks_that_are_not_known():
    assert arms(told([[FENCE, FENCE]], goes_on=True)[1, 0, 0]) == "ew"
    assert arms(told([[FENCE, FENCE]])[1, 0, 0]) == "w"


def test_stairs_turn_at_corners():
    # a roof that rises inwards, and a pit that falls inwards
    east, west, south, north = ((53, n) for n in range(4))
    roof = told([[south] * 3, [east, AIR, west], [north] * 3])
    assert {place: roof[place]["shape"] for place in ((0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 0, 2), (2, 0, 2))} == {
        (0, 0, 0): "outer_left",
        (1, 0, 0): "straight",
        (2, 0, 0): "outer_right",
        (0, 0, 2): "outer_right",
        (2, 0, 2): "outer_left",
    }
    pit = told([[north] * 3, [west, AIR, east], [south] * 3])
    assert pit[0, 0, 0]["shape"] == "inner_left"
    assert pit[2, 0, 0]["shape"] == "inner_right"
    upside_down = told([[(53, 6), south], [(53, 0), AIR]])
    assert upside_down[0, 0, 0]["shape"] == "straight"


def test_a_corner_is_no_corner_where_stairs_go_on():
    east, south = (53, 0), (53, 2)
    assert told([[AIR, south, south], [AIR, east, AIR]])[1, 0, 0]["shape"] == "outer_left"
    assert told([[south, south, south], [AIR, east, AIR]])[1, 0, 0]["shape"] == "straight"


def test_halves_of_doors_know_of_each_other():
    lower, upper = (64, 4 + 1), (64, 8 + 1)  # to the south, open; hinge on the right
    found = told([[lower]], [[upper]])
    assert found[0, 1, 0] == {"name": "oak_door", "facing": "south", "open": "true", "hinge": "right", "half": "upper"}
    assert found[0, 0, 0] == {"name": "oak_door", "facing": "south", "open": "true", "hinge": "right", "half": "lower"}
    closed = told([[(64, 2)]], [[(64, 8)]])[0, 1, 0]
    assert (closed["facing"], closed["open"], closed["hinge"]) == ("west", "false", "left")
    other = told([[lower]], [[(71, 8)]])
    assert "hinge" not in other[0, 0, 0]
    assert "facing" not in other[0, 1, 0]


def test_upper_halves_are_of_the_plant_below():
    for kind, name in enumerate(("sunflower", "lilac", "tall_grass", "large_fern", "rose_bush", "peony")):
        found = told([[(175, kind)]], [[(175, 8)]])
        assert found[0, 1, 0] == {"name": name, "half": "upper"}


def section(y: int, states: tuple[str, ...], blocks: np.ndarray) -> Section:
    return Section(y=y, states=states, blocks=blocks.reshape(-1), biomes=("plains",), biome=None)


def test_chunks_are_joined_across_sections_that_are_taken_apart_again():
    lower, upper = np.zeros((16, 16, 16), np.int64), np.zeros((16, 16, 16), np.int64)
    lower[15, 3, 4] = upper[0, 3, 4] = 1
    door = [legacy_state(64, 3), legacy_state(64, 8)]
    column = [section(5, ("minecraft:air", door[1]), upper), section(4, ("minecraft:air", door[0]), lower)]
    high, low = joined_chunk(column)
    assert (high.y, low.y) == (5, 4)
    place = 16 * 3 + 4
    assert parse_state(high.states[high.blocks[place]])[1]["facing"] == "north"
    assert parse_state(low.states[low.blocks[15 * 256 + place]])[1]["hinge"] == "left"
    assert np.count_nonzero(high.blocks) == np.count_nonzero(low.blocks) == 1


def test_chunks_with_nothing_to_tell_stay_as_they_are():
    column = [section(0, ("minecraft:stone",), np.zeros(1, np.int64))]
    assert joined_chunk(column)[0] is column[0]


def test_a_real_region_changes_in_its_tall_plants_alone():
    data = os.environ.get("GBUFRT_TEST_DATA")
    if data is None:
        pytest.skip("GBUFRT_TEST_DATA is not set")
    pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")
    from tracer.formats.minecraft.region import Region
    from tracer.formats.minecraft.sections import sections

    region = Region.of(Path(data) / "mca/1.12.2/r.0.-1.mca")
    changed = Counter[str]()
    for place in region.sectors:
        before = list(sections(region.chunk(place)))
        for old, new in zip(before, joined_chunk(before), strict=True):
            if new is not old:
                was, now = (np.array(part.states)[part.blocks] for part in (old, new))
                changed.update(now[was != now].tolist())
    assert changed == {"minecraft:rose_bush[half=upper]": 8, "minecraft:peony[half=upper]": 2}
