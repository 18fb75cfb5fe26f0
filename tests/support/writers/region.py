"""A tiny writer of Minecraft regions, for tests: every packing of blocks from 1.12 to 26.3."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from nbtlib import Byte, ByteArray, Compound, File, Int, IntArray, List, LongArray, String
from numpy.typing import NDArray

VERSIONS = {"1.12": 1343, "1.13": 1631, "1.15": 2230, "1.16": 2566, "1.18": 2975, "1.21": 3955, "26.3": 5023}
Blocks = NDArray[np.int64]


def pack(numbers: Blocks, bits: int, *, padded: bool) -> LongArray:
    """Numbers in longs, one bit after the other."""
    digits = (numbers.reshape(-1, 1) >> np.arange(bits)) & 1
    if padded:
        each = 64 // bits
        digits = np.pad(digits, ((0, -len(digits) % each), (0, 0))).reshape(-1, each * bits)
        digits = np.pad(digits, ((0, 0), (0, 64 - each * bits)))
    stream = np.pad(digits.reshape(-1), (0, -digits.size % 64)).reshape(-1, 64).astype(np.uint64)
    return LongArray((stream << np.arange(64, dtype=np.uint64)).sum(axis=1, dtype=np.uint64).view(np.int64))


def palette_of(states: Sequence[str], version: str) -> List:
    """Block states as the game writes them: since 26.3 those without properties as names, wrapped among compounds."""
    short = VERSIONS[version] >= 5023
    entries, names = list[Compound](), ("id", "properties") if short else ("Name", "Properties")
    for state in states:
        name, _, rest = state.partition("[")
        pairs = (pair.split("=") for pair in rest.rstrip("]").split(",") if pair)
        told = Compound({key: String(value) for key, value in pairs})
        whole = Compound({names[0]: String(name), **({names[1]: told} if told else {})})
        entries.append(whole if told or not short else Compound({"": String(name)}))
    if all("" in entry for entry in entries):
        return List[String]([entry[""] for entry in entries])
    return List[Compound](entries)


def section(version: str, y: int, blocks: Blocks, states: Sequence[str], biome: str = "minecraft:plains") -> Compound:
    """16 x 16 x 16 blocks in the order y, z, x; before 1.13 the states are ``NUMBER:DATA``."""
    tags = Compound({"Y": Byte(y)})
    if version == "1.12":
        pairs = np.array([[int(n) for n in state.split(":")] for state in states])[blocks.reshape(-1)]
        tags["Blocks"] = ByteArray(pairs[:, 0].astype(np.uint8).view(np.int8))
        low, high = pairs[0::2, 1], pairs[1::2, 1]
        tags["Data"] = ByteArray((low | high << 4).astype(np.uint8).view(np.int8))
        return tags
    used, which = np.unique(blocks.reshape(-1), return_inverse=True)
    palette = palette_of([str(states[n]) for n in used.tolist()], version)
    data = pack(which.astype(np.int64), max(4, (len(used) - 1).bit_length()), padded=VERSIONS[version] >= 2529)
    if VERSIONS[version] < 2860:
        return Compound({**tags, "Palette": palette, "BlockStates": data})
    tags["block_states"] = Compound({"palette": palette, **({"data": data} if len(used) > 1 else {})})
    tags["biomes"] = Compound({"palette": List[String]([String(biome)])})
    return tags


def chunk(version: str, x: int, z: int, sections: Sequence[Compound]) -> File:
    """A chunk as the root of its NBT."""
    tags: dict[str, Any] = {"xPos": Int(x), "zPos": Int(z)}
    if VERSIONS[version] < 2860:
        biomes = {
            "1.12": ByteArray([1] * 256),
            "1.13": IntArray([1] * 256),
            "1.15": IntArray([1] * 1024),
            "1.16": IntArray([1] * 1024),
        }[version]
        level = Compound({**tags, "Biomes": biomes, "Sections": List[Compound](sections)})
        return File({"DataVersion": Int(VERSIONS[version]), "Level": level})
    return File({"DataVersion": Int(VERSIONS[version]), **tags, "sections": List[Compound](sections)})


def nbt_bytes(tags: File) -> bytes:
    """A file of NBT, not compressed."""
    out = io.BytesIO()
    tags.write(out)
    return out.getvalue()


def write_region(path: Path, chunks: Mapping[tuple[int, int], File | bytes]) -> Path:
    """A region file; a chunk given as bytes is what follows its length, compression kind included."""
    path.parent.mkdir(parents=True, exist_ok=True)
    table, body = bytearray(4096), bytearray(4096)
    for (x, z), tags in chunks.items():
        data = tags if isinstance(tags, bytes) else b"\x02" + zlib.compress(nbt_bytes(tags))
        sectors = -(-(len(data) + 4) // 4096)
        place = 4 * (x % 32 + 32 * (z % 32))
        table[place : place + 4] = struct.pack(">I", (1 + len(body) // 4096) << 8 | min(sectors, 255))
        body += (struct.pack(">I", len(data)) + data).ljust(sectors * 4096, b"\0")
    path.write_bytes(bytes(table) + bytes(body))
    return path


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


def lz4_stream(data: bytes, size: int = 1 << 16) -> bytes:
    """As lz4-java writes it: blocks of some size, the first stored as it is, and an empty one last."""
    import lz4.block

    out = b""
    for at in range(0, len(data), size):
        plain = data[at : at + size]
        packed = lz4.block.compress(plain, store_size=False) if at else plain
        out += b"LZ4Block" + struct.pack("<BiiI", 0x26 if at else 0x16, len(packed), len(plain), 0) + packed
    return out + b"LZ4Block" + struct.pack("<BiiI", 0x16, 0, 0, 0)
