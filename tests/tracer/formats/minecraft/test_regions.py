"""Regions and saves: every packing reads as it was written, parts are found, and damage is named and bounded."""

from __future__ import annotations

import resource
import struct
import time
import warnings
import zlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")
pytest.importorskip("lz4", reason="needs gbufrt[worlds]")

import lz4.block
import torch
from nbtlib import Byte, ByteArray, Compound, Double, File, Int, List
from region_writer import VERSIONS, chunk, nbt_bytes, pack, section, write_region

import tracer
from tracer.formats.minecraft.compression import MAX_BYTES
from tracer.formats.minecraft.nbt import parse_nbt
from tracer.formats.minecraft.save import Selection, read_minecraft, untextured_told
from tracer.formats.minecraft.sections import sections, unpack

CUBES = ("stone", "dirt", "sand", "gravel", "bricks", "glowstone", "obsidian", "clay", "red_wool", "polished_diorite")
CUBES += ("bookshelf", "gold_block", "iron_block", "glass", "ice", "diamond_block", "mossy_cobblestone", "cobblestone")
STATES = ("minecraft:air", *(f"minecraft:{name}" for name in CUBES))
NUMBERS = ("0:0", "1:0", "3:0", "12:0", "13:0", "45:0", "89:0", "49:0", "82:0", "35:14", "1:4")
NUMBERS += ("47:0", "41:0", "42:0", "20:0", "79:0", "57:0", "48:0", "4:0")
PLACES = [(x, z) for x in range(4) for z in range(4)]


def states_of(version: str) -> tuple[str, ...]:
    return NUMBERS if version == "1.12" else STATES


def random_region(path: Path, version: str) -> tuple[Path, dict[tuple[int, int, int], np.ndarray]]:
    """16 chunks of three sections, the lowest below 0 where the version has such."""
    rng = np.random.default_rng(1)
    low = -4 if VERSIONS[version] >= 2860 else 0
    made = {(x, low + k, z): rng.integers(0, 19, (16, 16, 16)) for x, z in PLACES for k in range(3)}
    for x, z in PLACES[:4]:
        made[x, low, z] = np.full((16, 16, 16), 1)
    chunks = {
        (x, z): chunk(
            version, x, z, [section(version, y, made[x, y, z], states_of(version)) for y in range(low, low + 3)]
        )
        for x, z in PLACES
    }
    return write_region(path / "r.0.0.mca", chunks), made


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


def test_biomes_tint_grass(tmp_path: Path):
    grass = [np.zeros((16, 16, 16), int)]
    chunks = {
        (x, 0): chunk("1.21", x, 0, [section("1.21", 0, grass[0], ["minecraft:grass_block"], f"minecraft:{biome}")])
        for x, biome in enumerate(("plains", "desert"))
    }
    world = read_minecraft(write_region(tmp_path / "r.0.0.mca", chunks)).world
    one, other = (int(world.at(torch.tensor([16 * x, 0, 0]))) for x in range(2))
    assert not torch.allclose(world.materials.albedo[one], world.materials.albedo[other], atol=0.02)


def packed_tags(tags: dict[str, Any]) -> bytes:
    return b"\x02" + zlib.compress(nbt_bytes(File(tags)))


def lz4_stream(data: bytes, size: int = 1 << 16) -> bytes:
    """As lz4-java writes it: blocks of some size, the first stored as it is, and an empty one last."""
    out = b""
    for at in range(0, len(data), size):
        plain = data[at : at + size]
        packed = lz4.block.compress(plain, store_size=False) if at else plain
        out += b"LZ4Block" + struct.pack("<BiiI", 0x26 if at else 0x16, len(packed), len(plain), 0) + packed
    return out + b"LZ4Block" + struct.pack("<BiiI", 0x16, 0, 0, 0)


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


@cache
def damaged_chunks() -> dict[str, bytes]:
    whole = nbt_bytes(chunk("1.21", 0, 0, [section("1.21", 0, np.ones((16, 16, 16), int), STATES)]))
    packed = b"\x02" + zlib.compress(whole)
    flipped = bytearray(packed)
    flipped[len(packed) // 2] ^= 0x10
    return {
        "truncated": packed[:-20],
        "damaged": bytes(flipped),
        "decompresses to more than": b"\x02" + zlib.compress(bytes(1 << 25)),
        "nested too deep": b"\x02" + zlib.compress(b"\x0a\0\0" + b"\x0a\0\1a" * 5000),
        "list of nothing": b"\x02" + zlib.compress(b"\x0a\0\0\x09\0\1a\0\x7f\xff\xff\xff\0"),
        "NBT ends at byte": b"\x02" + zlib.compress(whole[:-30]),
        "but 8589934584 more": b"\x02" + zlib.compress(b"\x0a\0\0\x0c\0\1a\x3f\xff\xff\xff\0"),
        "NBT is damaged": b"\x02" + zlib.compress(b"\x0a\0\0\x63\0\1a"),
        "compression must be": b"\x05" + packed[1:],
        "no head of an LZ4 block": b"\x04" + packed[1:] + bytes(21),
        "data is truncated": b"\x04" + lz4_stream(whole)[:-40],
        "than the 8388608 bytes": b"\x04" + lz4_stream(bytes(1 << 24)),
        "holds entities": packed_tags({"DataVersion": Int(3955), "Entities": List[Compound]([])}),
        "or points of interest, no blocks": packed_tags({"DataVersion": Int(3955), "Sections": Compound({})}),
        "DataVersion must be int": packed_tags({"DataVersion": List[Int]([1, 2])}),
        "c.5.0.mcc, which does not exist": b"\x82",
        "values allowed": b"\x02" + zlib.compress(b"\x0a\0\0\x09\0\1a\x01\0\x40\0\0" + bytes(1 << 22) + b"\0"),
    }


@pytest.mark.parametrize("message", damaged_chunks())
def test_a_damaged_chunk_is_left_out_and_named(tmp_path: Path, message: str):
    good = chunk("1.21", 1, 0, [section("1.21", 0, np.ones((16, 16, 16), int), STATES)])
    path = write_region(tmp_path / "r.0.0.mca", {(1, 0): good, (5, 0): damaged_chunks()[message]})
    before, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.warns(UserWarning, match=r"1 of 2 chunks are damaged and left out: chunk 5,0 of r\.0\.0\.mca") as told:
        world = read_minecraft(path).world
    assert message in str(told[0].message)
    assert "\n" not in str(told[0].message)
    assert world.bounds() == ((16, 0, 0), (32, 16, 16))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 40 * MAX_BYTES / 1024
    assert time.process_time() - begin < 8
    alone = write_region(tmp_path / "alone/r.0.0.mca", {(5, 0): damaged_chunks()[message]})
    with pytest.raises(ValueError, match="no chunk can be read"):
        read_minecraft(alone)


def sections_that_break_rules() -> dict[str, Compound]:
    good = section("1.21", 0, np.random.default_rng(0).integers(0, 3, (16, 16, 16)), STATES)
    states = good["block_states"]
    return {
        "longs, got 255": Compound({**good, "block_states": Compound({**states, "data": states["data"][:-1]})}),
        "has no entry": Compound({**good, "block_states": Compound({**states, "palette": states["palette"][:2]})}),
        "palette must be list": Compound({**good, "block_states": Compound({**states, "palette": Int(3)})}),
        "palette must have 1 to 4096": Compound({**good, "block_states": Compound({"palette": List[Compound]([])})}),
        "Name must be str": Compound(
            {"Y": Byte(0), "block_states": Compound({"palette": List[Compound]([Compound()])})}
        ),
        "Y must be int": Compound({"block_states": states}),
        "2048 bytes, got 3": Compound({"Y": Byte(0), "Blocks": ByteArray([0] * 4096), "Data": ByteArray([0] * 3)}),
    }


@pytest.mark.parametrize("message", sections_that_break_rules())
def test_a_section_that_breaks_a_rule_is_refused(message: str):
    with pytest.raises(ValueError, match=message):
        list(sections(chunk("1.21", 0, 0, [sections_that_break_rules()[message]])))


def test_sections_that_come_twice_and_unknown_blocks_are_told(tmp_path: Path):
    same = section("1.21", 0, np.ones((16, 16, 16), int), ["minecraft:air", "mod:strange"])
    twice = write_region(tmp_path / "a/r.0.0.mca", {(0, 0): chunk("1.21", 0, 0, [same, same])})
    with pytest.raises(ValueError, match="a section comes twice"):
        read_minecraft(twice)
    with pytest.warns(UserWarning, match="1 unknown block is drawn grey: strange"):
        read_minecraft(write_region(tmp_path / "b/r.0.0.mca", {(0, 0): chunk("1.21", 0, 0, [same])}))


def test_blocks_are_told_in_numbers_and_names():
    assert untextured_told(()) == ""
    assert untextured_told(["poppy"]) == "1 block has no texture in the pack: poppy"
    assert untextured_told(list("abcdefghi")) == "9 blocks have no texture in the pack: a, b, c, d, e, f, g, h, ..."


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"short", "no region"), (b"", "holds no chunks"), (bytes(8192), "holds no chunks")],
)
def test_what_is_no_region_is_refused_in_one_line(tmp_path: Path, content: bytes, message: str):
    (tmp_path / "r.0.0.mca").write_bytes(content)
    for path in (tmp_path / "r.0.0.mca", tmp_path):
        with pytest.raises(ValueError, match=message):
            tracer.load(path)


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


def test_flipped_bytes_never_do_worse_than_a_message(tmp_path: Path):
    path, _ = random_region(tmp_path, "1.18")
    data, rng = path.read_bytes(), np.random.default_rng(0)
    raw = nbt_bytes(chunk("1.18", 0, 0, [section("1.18", 0, rng.integers(0, 9, (16, 16, 16)), STATES)]))
    said = list[str]()
    for n in range(60):
        changed = bytearray(data if n % 2 else raw)
        for at in rng.integers(0, len(changed) if n % 4 == 0 else 4096 if n % 2 else 300, 4):
            changed[at % len(changed)] = rng.integers(0, 256)
        content = bytes(changed) if n % 2 else bytes(struct.pack(">I", 2 << 8 | 255).ljust(8192, b"\0"))
        if n % 2 == 0:
            content += (struct.pack(">I", len(changed) + 1) + b"\3" + bytes(changed)).ljust(8192, b"\0")
        path.write_bytes(content[: int(rng.integers(1, len(content)))] if n % 5 == 0 else content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                read_minecraft(path)
            except ValueError as error:
                said.append(str(error))
    assert len(said) > 5
    assert not any("\n" in line for line in said)


def test_bytes_that_are_no_nbt_are_refused():
    for data in (b"", b"\0", b"\x0a", b"hello", b"\xff" * 40):
        with pytest.raises(ValueError, match="NBT"):
            parse_nbt(data)
