"""Textures with holes: what is seen through, near and far."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from writers.pack import (
    A,
    flat,
    table_of,
    textures,
    tile,
    write_pack,
)

from tracer.formats.minecraft.build import Builder
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.sections import Section
from tracer.scene.textures import COLOR
from tracer.worlds.regions.landscape import landscape


def test_animations_show_their_first_frame_and_holes_the_mean_colour(tmp_path: Path):
    frames = np.concatenate([flat(A, A, A, 255), flat(0, 0, 0, 255), flat(0, 0, 0, 255)])
    frames[1, 1] = 0
    table, _ = table_of(write_pack(tmp_path / "a.zip", textures(stone=frames)), "stone")
    assert tile(table, table.id("stone"), "up")[..., COLOR].flatten().tolist() == pytest.approx([0.5] * 4, abs=0.01)


def test_cutouts_are_seen_through(tmp_path: Path):
    """Leaves are hollow, with the holes of their picture; plants are two pictures that cross; glass stays whole."""
    leaves, plant = np.full((16, 16, 4), 255, np.uint8), np.zeros((16, 16, 4), np.uint8)
    leaves[4:8, 2:6], plant[8:, 6:10] = 0, 255
    pack = Pack(write_pack(tmp_path / "a.zip", textures(oak_leaves=leaves, poppy=plant, glass=leaves)))
    builder, states = Builder(pack), ("air", "oak_leaves", "poppy", "glass")
    blocks = np.zeros(4096, np.int64)
    blocks[[0, 2, 4]] = 1, 2, 3
    builder.add(0, 0, Section(y=0, states=states, blocks=blocks, biomes=("plains",), biome=None))
    built = builder.build()
    assert built.shaped is not None
    place = torch.stack(torch.meshgrid(*[torch.arange(8)] * 3, indexing="ij"), dim=-1)
    hollow = built.shaped.model.at(place) > 0
    front = torch.ones(8, 8, dtype=torch.bool)
    front[1:3, 4:6] = False  # as x, y from below: the picture's rows 4 to 8, its columns 2 to 6
    assert torch.equal(hollow[:, :, 7], front)
    assert torch.equal(hollow[:, :, 0], front.flip(0))
    assert not hollow[1:7, 1:7, 1:7].any()
    crossed = built.shaped.model.at(place + torch.tensor([16, 0, 0])) > 0
    assert crossed.nonzero().tolist() == [[x, y, z] for x in (3, 4) for y in range(4) for z in (3, 4)]
    assert built.world.at(torch.tensor([[0, 0, 0], [2, 0, 0]])).tolist() == [0, 0]
    assert int(built.world.at(torch.tensor([4, 0, 0]))) == built.world.materials.id("glass")


def test_views_are_the_same_over_leaves_with_holes(tmp_path: Path):
    """They are found on a map of heights, which leaves belong to, with holes or without."""
    leaves = np.full((16, 16, 4), 255, np.uint8)
    leaves[4:8, 2:8] = 0
    pack, views = write_pack(tmp_path / "a.zip", textures(oak_leaves=leaves)), []
    blocks = np.zeros((16, 16, 16), np.int64)  # y, z, x
    blocks[0], blocks[7:10, 3:9, 4:12], blocks[1, 12] = 1, 2, 3
    for own in (None, Pack(pack)):
        builder = Builder(own)
        states = ("air", "stone", "oak_leaves", "poppy")
        builder.add(0, 0, Section(y=2, states=states, blocks=blocks.reshape(-1), biomes=("plains",), biome=None))
        built = builder.build()
        views.append(landscape(built.world, built.instances).views)
    assert built.world.at(torch.tensor([5, 40, 5])) == 0
    for name in views[0]:
        for time in (0.0, 7.0):
            assert views[0][name].eye(time) == pytest.approx(views[1][name].eye(time)), name
