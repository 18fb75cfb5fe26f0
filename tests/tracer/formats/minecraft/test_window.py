"""The window over a world holds what the world has there, reads only what enters, and keeps what stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")

import torch
from hills import LONG, WIDE, save_of_hills
from writers.region import chunk, section, write_region

import tracer
from tracer.formats.minecraft.build import Blocks
from tracer.formats.minecraft.region import Region
from tracer.formats.minecraft.save import Selection, read_minecraft
from tracer.formats.minecraft.window import Window
from tracer.scene.cells import cells_of_world

ROUND = ((300.0, 50.0), (310.0, 50.0), (500.0, 40.0), (505.0, 60.0), (301.0, 49.0), (2000.0, 0.0), (310.0, 50.0))


@pytest.fixture(scope="module")
def save(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_of_hills(tmp_path_factory.mktemp("hills"))


def named(world: tracer.World) -> set[tuple[int, int, int, str]]:
    """Every voxel with the name of its material; numbers go by the order in which blocks are met."""
    if not bool((world.index > 0).any()):
        return set()
    cells, ids = cells_of_world(world)
    return {(*cell, world.materials.names[n]) for cell, n in zip(cells.tolist(), ids.tolist(), strict=True)}


def same(found: Blocks, wanted: Blocks) -> None:
    assert named(found.world) == named(wanted.world)
    assert found.shaped is not None
    assert named(found.shaped.model) == (set() if wanted.shaped is None else named(wanted.shaped.model))


def test_a_window_holds_what_the_world_has_there(save: Path):
    window = Window(save, chunks=4)
    for x, z in ROUND:
        found = window.at(x, z)
        low, high = Selection(chunks=4).chunk_range((int(x), int(z)))
        assert low[0] * 16 + window.reach <= x <= high[0] * 16 - window.reach
        if x > 16 * LONG:
            assert len(window) == len(window.pool) == 0
            assert named(found.world) == set()
            continue
        assert 0 < len(window) <= 16
        same(
            found, read_minecraft(save, Selection(box=(16 * low[0], -64, 16 * low[1], 16 * high[0], 99, 16 * high[1])))
        )


def test_only_what_enters_is_read_and_what_stays_is_left(save: Path, monkeypatch: pytest.MonkeyPatch):
    read = list[tuple[int, int]]()
    chunk_of = Region.chunk
    monkeypatch.setattr(Region, "chunk", lambda self, place: (read.append(place), chunk_of(self, place))[1])
    window = Window(save, chunks=4)
    before = window.at(320.0, 48.0)
    assert sorted(read) == [(x, z) for x in range(18, 22) for z in range(1, 5)]
    read.clear()
    assert window.at(323.0, 45.0) is before
    assert read == []
    after = window.at(336.0, 48.0)
    assert sorted(read) == [(22, z) for z in range(1, 5)]
    assert after.world.bricks is before.world.bricks
    assert torch.equal(after.world.index[:3], before.world.index[1:])
    assert torch.unique(after.world.index).numel() == 16


def test_memory_stays_that_of_a_window_on_a_long_flight(save: Path):
    window, most = Window(save, chunks=4), 0
    for x in range(0, 16 * LONG, 16):
        blocks = window.at(float(x), 48.0)
        most = max(most, len(window.pool))
        assert len(window) <= 16
        assert len(window.pool) < window.pool.capacity <= 2 * most + 2
        assert len(blocks.world.bricks) == window.pool.capacity
    window.at(-1000.0, 48.0)
    assert len(window.pool) == 0


def test_a_part_bounds_what_a_window_takes(save: Path):
    box = (310, 3, 20, 335, 12, 60)
    same(Window(save, chunks=8, selection=Selection(box=box)).at(320.0, 48.0), read_minecraft(save, Selection(box=box)))
    around = Window(save, chunks=8, selection=Selection(around=(320, 48), chunks=2))
    around.at(320.0, 48.0)
    assert len(around) == 4


def test_damage_is_told_and_left_out(tmp_path: Path):
    solid = np.ones((16, 16, 16), np.int64)
    sound = chunk("1.18", 0, 0, [section("1.18", 0, solid, ("minecraft:air", "minecraft:stone"))])
    strange = chunk("1.18", 3, 0, [section("1.18", 0, solid, ("minecraft:air", "mod:thing"))])
    chunks = {(0, 0): sound, (3, 0): strange, **{(x, 1): b"\x02broken" for x in range(5)}}
    window = Window(write_region(tmp_path / "r.0.0.mca", chunks), chunks=6)
    with pytest.warns(UserWarning, match="left out|unknown") as told:
        blocks = window.at(32.0, 0.0)
    texts = sorted(str(warning.message) for warning in told)
    assert len(texts) == 4
    assert texts[0].startswith("1 unknown block is drawn grey: thing")
    assert texts[1].startswith("chunk 0,1 of r.0.0.mca is damaged and left out: compressed data is damaged")
    assert texts[3].endswith("further ones are left out without a word")
    assert len(named(blocks.world)) == 2 * 4096


@pytest.mark.parametrize("chunks", [3, 65])
def test_windows_that_are_no_use_are_refused(save: Path, chunks: int):
    with pytest.raises(ValueError, match=f"window must lie in 4..64 chunks, got {chunks}"):
        Window(save, chunks=chunks)


def test_the_save_is_as_wide_as_it_says(save: Path):
    window = Window(save, chunks=8)
    window.at(8.0 * LONG, 8.0 * WIDE)
    assert len(window) == 8 * WIDE
