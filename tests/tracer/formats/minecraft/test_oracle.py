"""anvil-parser2, written by others, agrees on what regions hold."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")

from tracer.formats.minecraft.legacy import legacy_state
from tracer.formats.minecraft.region import Region
from tracer.formats.minecraft.sections import sections

DATA = os.environ.get("GBUFRT_TEST_DATA")
REAL = ("1.12.2/r.0.-1.mca", "1.18.2/r.0.0.mca", "1.21.1/r.0.0.mca", "synthetic_1.21/r.0.0.mca")


@pytest.mark.parametrize("name", REAL)
def test_anvil_agrees_on_every_block_of_real_regions(name: str, monkeypatch: pytest.MonkeyPatch):
    if DATA is None:
        pytest.skip("GBUFRT_TEST_DATA is not set")
    anvil = pytest.importorskip("anvil", reason="needs anvil-parser2")
    path = Path(DATA) / "mca" / name
    region, theirs = Region.of(path), anvil.Region.from_file(str(path))
    monkeypatch.setattr(anvil.chunk.Block, "from_palette", lambda tag: tag["Name"].value)  # a third of the time
    compared = 0
    for x, z in region.sectors:
        found = theirs.get_chunk(x % 32, z % 32)
        for ours in sections(region.chunk((x, z))):
            if ours.blocks.size == 1:
                continue  # anvil takes sections of one state for air
            blocks = list(found.stream_blocks(section=found.get_section(ours.y)))
            if "Level" in region.chunk((x, z)):
                blocks = [legacy_state(block.id, block.data) for block in blocks]
                names = np.array(ours.states)
            else:
                names = np.array([state.partition("[")[0] for state in ours.states])
            assert (names[ours.blocks] == np.array(blocks)).all(), (x, ours.y, z)
            compared += len(blocks)
    assert compared > 100_000


def test_anvil_agrees_on_the_names_of_numbers():
    anvil = pytest.importorskip("anvil", reason="needs anvil-parser2")
    renamed = {
        "grass": "short_grass",
        "flowing_water": "water",
        "flowing_lava": "lava",
        "dead_shrub": "dead_bush",
        "wooden_slab": "oak_slab",
    }
    for number, data in (
        (n, d) for n in (1, 2, 3, 4, 5, 12, 13, 17, 18, 24, 31, 35, 44, 50, 53, 78, 95, 159, 171) for d in range(8)
    ):
        try:
            name = anvil.OldBlock(number, data).convert().id
        except KeyError:
            continue
        assert legacy_state(number, data).partition("[")[0] == f"minecraft:{renamed.get(name, name)}", (number, data)
