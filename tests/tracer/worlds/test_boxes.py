"""Parts of saves that are cut within chunks."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")

import numpy as np
import torch
from writers.region import chunk, section, write_region

import tracer

STATES = ("minecraft:air", "minecraft:stone", "minecraft:grass_block")
SIDE = 10  # chunks
BOX = (3, 0, 5, 155, 16, 150)  # X0, Y0, Z0, X1, Y1, Z1


@pytest.fixture(scope="module")
def region(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Steps that rise along x."""
    made = {}
    for x, z in np.ndindex(SIDE, SIDE):
        y = np.indices((16, 16, 16))[0]
        blocks = np.where(y < 4 + x, 1, np.where(y == 4 + x, 2, 0))
        made[x, z] = chunk("1.18", x, z, [section("1.18", 0, blocks, STATES)])
    return write_region(tmp_path_factory.mktemp("steps") / "r.0.0.mca", made)


def _tops(world: tracer.World, x: range, z: int = 80) -> list[int]:
    cells = torch.stack(torch.meshgrid(torch.tensor(x), torch.arange(16), indexing="ij"), dim=-1)
    full = torch.cat([cells, torch.full_like(cells[..., :1], z)], dim=-1)
    return (world.at(full) > 0).sum(dim=1).tolist()


def test_land_goes_on_beyond_a_box_that_cuts_through_chunks(region: Path) -> None:
    scene = tracer.load(region, box=BOX)
    assert scene.haze is not None
    own = [5 + x // 16 for x in range(160)]
    assert _tops(scene.world, range(-160, 320)) == own[::-1] + own + own[::-1]
    assert scene.world.at(torch.tensor([[80, 0, 80]])) > 0


def test_bare_it_is_cut_as_it_says(region: Path) -> None:
    world = tracer.load(region, box=BOX, bare=True).world
    assert _tops(world, range(-16, 176)) == [0] * 19 + [5 + x // 16 for x in range(3, 155)] + [0] * 21
    assert [_tops(world, range(80, 81), z)[0] > 0 for z in (4, 5, 149, 150)] == [False, True, True, False]
