"""Regions and saves: every packing reads as it was written, parts are found, blocks are told."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")
pytest.importorskip("lz4", reason="needs gbufrt[worlds]")

import torch
from nbtlib import Compound, Double, File, Int, IntArray, List, String
from writers.region import (
    CUBES,
    STATES,
    VERSIONS,
    chunk,
    lz4_stream,
    nbt_bytes,
    pack,
    random_region,
    section,
    write_region,
)

import tracer
from tracer.formats.minecraft.region import Region
from tracer.formats.minecraft.save import Selection, read_minecraft, untextured_told
from tracer.formats.minecraft.sections import sections, unpack


def names_at(world: tracer.World, cell: tuple[int, int, int]) -> np.ndarray:
    """Names of the blocks of a section, in the order y, z, x."""
    y, z, x = np.indices((16, 16, 16)).reshape(3, -1)
    where = torch.from_numpy(np.stack([x, y, z], axis=1) + 16 * np.array(cell))
    return np.array(world.materials.names)[world.at(where).numpy()]


@pytest.mark.parametrize("version", VERSIONS)
def test_every_packing_reads_as_it_was_written(tmp_path: Path, version: str):
    path, made = random_region(tmp_path, version)
    blocks = read_minecraft(path)
    wanted = np.array(["air", *CUBES])
    for cell, numbers in made.items():
        assert (names_at(blocks.world, cell) == wanted[numbers.reshape(-1)]).all(), cell
    assert blocks.shaped is None
    assert blocks.unknown == ()


@pytest.mark.parametrize(("bits", "padded"), [(4, True), (5, True), (5, False), (9, True), (9, False), (13, False)])
def test_longs_are_unpacked_bit_by_bit(bits: int, padded: bool):
    numbers = np.random.default_rng(bits).integers(0, 1 << bits, 4096)
    longs = pack(numbers, bits, padded=padded)
    words = [int(n) & (1 << 64) - 1 for n in longs.tolist()]
    each = 64 // bits
    for n in (0, 1, each - 1, each, 777, 4095):  # by whole numbers, independent of the writer
        place = (n // each * 64 + n % each * bits) if padded else n * bits
        both = words[place // 64] | (words[place // 64 + 1] << 64 if place // 64 + 1 < len(words) else 0)
        assert both >> place % 64 & (1 << bits) - 1 == numbers[n]
    assert (unpack(longs, bits, 4096, padded=padded) == numbers).all()
    with pytest.raises(ValueError, match="longs"):
        unpack(longs[:-1], bits, 4096, padded=padded)


def test_a_box_holds_its_blocks_and_no_more(tmp_path: Path):
    path, _ = random_region(tmp_path, "1.21")
    whole, part = read_minecraft(path).world, read_minecraft(path, Selection(box=(5, -60, 17, 40, -33, 30))).world
    grid = torch.stack(torch.meshgrid(*(torch.arange(-66, 66, 3),) * 3, indexing="ij"), dim=-1)
    inside = torch.ones(grid.shape[:3], dtype=torch.bool)
    for axis, (low, high) in enumerate(((5, 40), (-60, -33), (17, 30))):
        inside &= (grid[..., axis] >= low) & (grid[..., axis] < high)
    names = np.array(whole.materials.names)[whole.at(grid).numpy()]
    names[~inside.numpy()] = "air"
    assert (np.array(part.materials.names)[part.at(grid).numpy()] == names).all()


def test_chunks_are_taken_round_a_place_or_the_player(tmp_path: Path):
    stone = [section("1.21", 0, np.ones((16, 16, 16), int), STATES)]
    for x, z in ((0, 0), (1, 0), (-1, 0)):
        chunks = {
            (32 * x + i, z + j): chunk("1.21", 32 * x + i, z + j, stone) for i in range(0, 32, 4) for j in range(4)
        }
        write_region(tmp_path / f"region/r.{x}.{z}.mca", chunks)
    around = read_minecraft(tmp_path, Selection(around=(-64, 16), chunks=4)).world
    assert around.bounds() == ((-64, 0, 0), (-48, 16, 48))
    player = Compound({"Pos": List[Double]([Double(600.5), Double(64), Double(20)])})
    level = File({"Data": Compound({"Player": player})})
    (tmp_path / "level.dat").write_bytes(zlib.compress(nbt_bytes(level), wbits=31))
    assert read_minecraft(tmp_path, Selection(chunks=2)).world.bounds() == ((576, 0, 0), (592, 16, 32))
    (tmp_path / "level.dat").write_bytes(b"\x1f\x8bdamaged")
    assert read_minecraft(tmp_path, Selection(chunks=8)).world.bounds()[0][0] >= -64  # the middle of the chunks
    with pytest.raises(ValueError, match=r"no chunks in that part; its chunks lie in x -512\.\.976 and z 0\.\.64"):
        read_minecraft(tmp_path, Selection(around=(9000, 9000), chunks=2))


def test_since_26_1_a_save_keeps_its_overworld_and_its_players_in_other_folders(tmp_path: Path):
    stone = [section("26.3", 0, np.ones((16, 16, 16), int), STATES)]
    chunks = {(x, 0): chunk("26.3", x, 0, stone) for x in range(0, 32, 4)}
    write_region(tmp_path / "dimensions/minecraft/overworld/region/r.0.0.mca", chunks)
    write_region(tmp_path / "dimensions/minecraft/the_nether/region/r.0.0.mca", {(9, 0): chunk("26.3", 9, 0, stone)})
    (tmp_path / "region").mkdir()  # the game may leave it behind
    assert read_minecraft(tmp_path).world.bounds() == ((64, 0, 0), (400, 16, 16))  # the middle of the chunks
    assert read_minecraft(tmp_path / "dimensions/minecraft/the_nether").world.bounds()[0] == (144, 0, 0)
    alone, guest = "00000001-0000-0002-0000-00030000abcd", "00000000-0000-0002-0000-00030000abcd"
    level = File({"Data": Compound({"singleplayer_uuid": IntArray([1, 2, 3, 0xABCD])})})
    (tmp_path / "level.dat").write_bytes(zlib.compress(nbt_bytes(level), wbits=31))
    for name, x, dimension in ((guest, 72, "overworld"), (alone, 456, "overworld"), (alone, 456, "the_nether")):
        tags = {"Pos": List[Double]([x, 64, 8]), "Dimension": String(f"minecraft:{dimension}")}
        (tmp_path / "players/data").mkdir(parents=True, exist_ok=True)
        (tmp_path / f"players/data/{name}.dat").write_bytes(zlib.compress(nbt_bytes(File(tags)), wbits=31))
        followed = 72 if (name, dimension) != (alone, "overworld") else 456
        first = read_minecraft(tmp_path, Selection(chunks=2)).world.bounds()[0][0]
        assert first == followed // 64 * 64, "who plays alone goes first, but not from another dimension"


def test_since_26_3_a_palette_tells_only_what_is_not_the_default(tmp_path: Path):
    states = ["minecraft:oak_log", "minecraft:oak_log[axis=x]", "minecraft:oak_slab", "minecraft:stone"]
    blocks = np.arange(4096).reshape(16, 16, 16) % 4
    for palette in (states, states[:1] + states[2:]):  # with a compound among the names, and without
        tags = chunk("26.3", 0, 0, [section("26.3", 0, blocks % len(palette), palette)])
        found = next(iter(sections(Region.of(write_region(tmp_path / "r.0.0.mca", {(0, 0): tags})).chunk((0, 0)))))
        assert [found.states[n] for n in found.blocks[: len(palette)]] == palette


def test_biomes_tint_grass(tmp_path: Path):
    grass = [np.zeros((16, 16, 16), int)]
    chunks = {
        (x, 0): chunk("1.21", x, 0, [section("1.21", 0, grass[0], ["minecraft:grass_block"], f"minecraft:{biome}")])
        for x, biome in enumerate(("plains", "desert"))
    }
    world = read_minecraft(write_region(tmp_path / "r.0.0.mca", chunks)).world
    one, other = (int(world.at(torch.tensor([16 * x, 0, 0]))) for x in range(2))
    assert not torch.allclose(world.materials.albedo[one], world.materials.albedo[other], atol=0.02)


def test_lz4_reads_as_zlib(tmp_path: Path):
    tags = chunk("1.21", 0, 0, [section("1.21", 0, np.random.default_rng(0).integers(0, 19, (16, 16, 16)), STATES)])
    names = []
    for folder, data in {
        "zlib": b"\x02" + zlib.compress(nbt_bytes(tags)),
        "lz4": b"\x04" + lz4_stream(nbt_bytes(tags), 512),
    }.items():
        world = read_minecraft(write_region(tmp_path / folder / "r.0.0.mca", {(0, 0): data})).world
        names.append(names_at(world, (0, 0, 0)))
    assert len(set(names[0])) == 19
    assert (names[0] == names[1]).all()


def test_blocks_are_told_in_numbers_and_names():
    assert untextured_told(()) == ""
    assert untextured_told(["poppy"]) == "1 block has no texture in the pack: poppy"
    assert untextured_told(list("abcdefghi")) == "9 blocks have no texture in the pack: a, b, c, d, e, f, g, h, ..."


def test_a_folder_without_regions_and_parts_of_other_worlds_are_refused(tmp_path: Path):
    with pytest.raises(ValueError, match="no region files"):
        tracer.load(tmp_path)
    with pytest.raises(ValueError, match="are for Minecraft regions and saves; leave them out for valley"):
        tracer.load("valley", chunks=3)
    with pytest.raises(ValueError, match="each first below its second"):
        Selection(box=(0, 0, 0, 4, 0, 4))
    with pytest.raises(ValueError, match="exclude each other"):
        Selection(box=(0, 0, 0, 4, 4, 4), chunks=3)
    with pytest.raises(ValueError, match=r"chunks must lie in 1\.\.64"):
        Selection(chunks=0)


@pytest.mark.parametrize("place", ["region", "DIM7/region"])
@pytest.mark.parametrize("old", [False, True])
def test_blocks_of_mods_before_1_13_have_the_names_that_forge_lists(place: str, old: bool, tmp_path: Path):
    mark = "\x01" if old else ""
    listed = [{"K": String(f"{mark}twilightforest:twilight_log"), "V": Int(253)}]
    listed += [{"K": String("\x02twilightforest:ore_meter"), "V": Int(253)}] if old else []
    ids = List[Compound]([Compound(entry) for entry in listed])
    forge = {"ItemData": ids} if old else {"Registries": Compound({"minecraft:blocks": Compound({"ids": ids})})}
    tags = chunk("1.12", 0, 0, [section("1.12", 4, np.zeros(4096, np.int64), ("253:0",))])
    (tmp_path / place).mkdir(parents=True)
    file = write_region(tmp_path / place / "r.0.0.mca", {(0, 0): tags})
    with pytest.warns(UserWarning, match="1 unknown block is drawn grey: legacy_253"):
        read_minecraft(file)
    File({"FML": Compound(forge)}).save(str(tmp_path / "level.dat"), gzipped=True)
    assert read_minecraft(file).unknown == ()
