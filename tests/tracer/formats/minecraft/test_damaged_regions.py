"""Regions that are damaged or none: chunks left out and named, one line for the rest, bounded memory."""

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

from nbtlib import Byte, ByteArray, Compound, File, Int, List
from writers.region import (
    STATES,
    chunk,
    lz4_stream,
    nbt_bytes,
    random_region,
    section,
    write_region,
)

import tracer
from tracer.formats.minecraft.compression import MAX_BYTES
from tracer.formats.minecraft.nbt import parse_nbt
from tracer.formats.minecraft.save import Selection, read_minecraft
from tracer.formats.minecraft.sections import sections


def packed_tags(tags: dict[str, Any]) -> bytes:
    return b"\x02" + zlib.compress(nbt_bytes(File(tags)))


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
    with pytest.raises(ValueError, match=r"no chunk can be read: .*; give another region, or restore it from a back"):
        read_minecraft(alone)
    with pytest.raises(ValueError, match=r"no chunk can be read: .*; 1 other chunk lies elsewhere: choose another"):
        read_minecraft(path, Selection(box=(80, 0, 0, 96, 16, 16)))


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


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"short", "no region"), (b"", "holds no chunks"), (bytes(8192), "holds no chunks")],
)
def test_what_is_no_region_is_refused_in_one_line(tmp_path: Path, content: bytes, message: str):
    (tmp_path / "r.0.0.mca").write_bytes(content)
    for path in (tmp_path / "r.0.0.mca", tmp_path):
        with pytest.raises(ValueError, match=message):
            tracer.load(path)


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
