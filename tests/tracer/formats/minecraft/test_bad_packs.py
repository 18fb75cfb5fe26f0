"""Resource packs that are damaged, too large or odd: refused in one line, or read without harm."""

from __future__ import annotations

import struct
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from writers.pack import (
    CORNERS,
    JAVA,
    UPRIGHT,
    A,
    flat,
    json_files,
    png,
    seen_from_outside,
    table_of,
    textures,
    write_pack,
)

from tracer.formats.minecraft.build import Builder
from tracer.formats.minecraft.pack.archive import Archive
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.sections import Section


def claimed(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds nothing."""
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(b"\0")), (b"IEND", b""))
    parts = (struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


STONE = f"{JAVA}textures/block/stone.png"
CIRCLE = {"blockstates__stone": {"variants": {"": {"model": "block/a"}}}, "models__block__a": {"parent": "block/b"}}
WRONG: dict[str, dict[str, bytes]] = {
    "has no textures of blocks": {"pack.mcmeta": b"{}", f"{JAVA}textures/item/stick.png": b""},
    "leads out of it": {STONE: png(CORNERS), "../stone.png": b""},
    "stone.png is damaged": {STONE: png(CORNERS)[:45]},
    "3600000000 pixels": {STONE: claimed(60000, 60000)},
    "claims 16 x 4000000": {STONE: claimed(16, 4000000)},
    "round in a circle": {STONE: png(CORNERS), **json_files(**CIRCLE, models__block__b={"parent": "block/a"})},
    "not a JSON object": {STONE: png(CORNERS), f"{JAVA}blockstates/stone.json": b"[" * 100000},
    "unpacks to more": {STONE: bytes(1 << 25)},
}


@pytest.mark.parametrize("message", WRONG)
def test_bad_packs_are_refused_in_one_line(tmp_path: Path, message: str):
    pack = write_pack(tmp_path / "a.zip", WRONG[message])
    with pytest.raises(ValueError, match=message) as refused:
        table_of(pack, "stone")
    assert "\n" not in str(refused.value)
    assert str(pack) in str(refused.value)


def test_damaged_archives_are_refused(tmp_path: Path):
    whole = write_pack(tmp_path / "a.zip", textures(stone=np.random.default_rng(0).integers(0, 255, (16, 16, 3))))
    data = whole.read_bytes()
    for cut in (0, 10, len(data) // 2, len(data) - 5):
        whole.write_bytes(data[:cut])
        with pytest.raises(ValueError, match="truncated"):
            Pack(whole)
    for place in range(0, len(data), 7):
        whole.write_bytes(data[:place] + bytes([data[place] ^ 0x41]) + data[place + 1 :])
        with suppress(ValueError):  # and nothing else
            table_of(whole, "stone")
    with pytest.raises(FileNotFoundError, match="does not exist"):
        Pack(tmp_path / "none.zip")


def test_the_limit_counts_what_is_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pack = write_pack(tmp_path / "a.zip", textures(stone=CORNERS, dirt=CORNERS.copy()))
    bytes_of_one = len(png(CORNERS))
    monkeypatch.setenv("GBUFRT_MAX_GB", str(1.5 * bytes_of_one / 2**30))
    archive = Archive(pack)
    assert archive.read(STONE)
    with pytest.raises(ValueError, match="left of the limit"):
        archive.read(STONE.replace("stone", "dirt"))
    with pytest.raises(ValueError, match="GBUFRT_MAX_GB"):
        table_of(pack, "stone")


def test_links_out_of_a_folder_are_not_followed(tmp_path: Path):
    (tmp_path / "secret.png").write_bytes(png(flat(A, A, A)))
    pack = write_pack(tmp_path / "pack", textures(dirt=CORNERS))
    (pack / STONE).symlink_to(tmp_path / "secret.png")
    builder = Builder(Pack(pack))
    builder.add(0, 0, Section(y=0, states=("stone",), blocks=np.zeros(1, np.int64), biomes=("plains",), biome=None))
    assert builder.build().untextured == ("stone",)


def deep(count: int) -> dict[str, Any]:
    return {"facing": "up"} if count == 0 else {"OR": [deep(count - 1)]}


ODD = {
    "infinite turns": {"variants": {"": {"model": "block/odd", "x": float("inf"), "y": float("nan")}}},
    "text for turns": {"variants": {"": {"model": "block/odd", "x": "90", "uvlock": 3}}},
    "deep conditions": {"multipart": [{"when": deep(200), "apply": []}, {"when": deep(3), "apply": [[]]}]},
    "no variants": {"variants": []},
    "numbers": {"variants": {"": 7}},
}


@pytest.mark.parametrize("what", ODD)
def test_odd_block_states_and_models_break_nothing(tmp_path: Path, what: str):
    face = {"texture": "#a", "uv": [0, float("inf"), "x", 16], "rotation": float("nan")}
    model = {"textures": {"a": "#b", "b": "#a", "c": "block/stone", "d": 5}, "elements": [7, {"from": 1, "faces": 2}]}
    model["elements"] += [{"from": [0] * 3, "to": [0] * 3, "faces": {"up": face, "down": {**face, "texture": "#c"}}}]
    pack = write_pack(
        tmp_path / "a.zip", textures(stone=CORNERS) | json_files(blockstates__stone=ODD[what], models__block__odd=model)
    )
    table, (number,) = table_of(pack, "stone")
    assert table.textures is not None
    assert (table.textures.faces[number, :, 1] == 2).all()


def test_odd_names_stay_in_the_archive(tmp_path: Path):
    """A model may name what it likes: it finds nothing outside the list of files."""
    odd = {"variants": {"": {"model": "../../../etc/passwd"}}}
    pack = write_pack(tmp_path / "a.zip", textures(stone=CORNERS) | json_files(blockstates__stone=odd))
    assert zipfile.ZipFile(pack).namelist()
    table, (number,) = table_of(pack, "stone")
    assert seen_from_outside(table, number, "up") == UPRIGHT, "by its name"
