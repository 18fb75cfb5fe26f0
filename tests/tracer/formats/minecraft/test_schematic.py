"""Schematics: each version holds the blocks that were written; what is damaged is refused in one line."""

from __future__ import annotations

import os
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")

import torch
from nbtlib import ByteArray, Compound, Double, File, Int, IntArray, List, Short, String
from writers.region import nbt_bytes

import tracer
from tracer.formats.minecraft.schematic import read_schematic, varints
from tracer.scene.world import World

NAMES = ["minecraft:air", "minecraft:stone", "minecraft:gold_block", "minecraft:water", "minecraft:oak_slab[type=top]"]
SIDES = (5, 18, 21)  # y, z, x
BLOCKS = np.random.default_rng(3).integers(0, 4, SIDES)


def encoded(numbers: np.ndarray) -> ByteArray:
    out = bytearray()
    for number in numbers.reshape(-1).tolist():
        while number > 127:
            out.append(number & 127 | 128)
            number >>= 7
        out.append(number)
    return ByteArray(np.frombuffer(bytes(out), np.int8))


def sponge(version: int, *, shift: int = 0, **changed: object) -> File:
    """A file of one version; ``shift`` adds to the palette's numbers, so that some take two bytes."""
    palette = Compound({name: Int(n + shift * n) for n, name in enumerate(NAMES)})
    data = encoded(BLOCKS + shift * BLOCKS)
    sides = {"Height": Short(SIDES[0]), "Length": Short(SIDES[1]), "Width": Short(SIDES[2]), "Version": Int(version)}
    if version == 3:
        return File(
            {"Schematic": Compound({**sides, "Blocks": Compound({"Palette": palette, "Data": data}), **changed})}
        )
    return File({**sides, "Palette": palette, "BlockData": data, **changed})


def mcedit(**changed: object) -> File:
    numbers = np.array([0, 1, 41, 9])[BLOCKS].reshape(-1).astype(np.uint8).view(np.int8)
    sides = {"Height": Short(SIDES[0]), "Length": Short(SIDES[1]), "Width": Short(SIDES[2])}
    arrays = {"Blocks": ByteArray(numbers), "Data": ByteArray(np.zeros(BLOCKS.size, np.int8))}
    return File({**sides, "Materials": Short(0), **arrays, **changed})


def written(path: Path, tags: File, *, packed: bool = True) -> Path:
    data = nbt_bytes(tags)
    path.write_bytes(zlib.compress(data, wbits=31) if packed else data)
    return path


def blocks_of(world: World) -> list[str]:
    y, z, x = np.indices(SIDES).reshape(3, -1)
    ids = world.at(torch.from_numpy(np.stack([x, y, z], axis=1)))
    return [world.materials.names[int(n)] for n in ids]


@pytest.mark.parametrize(
    ("tags", "packed"),
    [
        (sponge(1), True),
        (sponge(2), True),
        (sponge(3), True),
        (sponge(2, shift=90), True),
        (sponge(2), False),
        (mcedit(), True),
    ],
)
def test_every_version_reads_as_it_was_written(tmp_path: Path, tags: File, packed: bool):
    blocks = read_schematic(written(tmp_path / "a.schem", tags, packed=packed))
    wanted = ["air", "stone", "gold_block", "water in plains"]
    assert blocks_of(blocks.world) == [wanted[n] for n in BLOCKS.reshape(-1)]
    assert blocks.shaped is None


BIOMES = np.random.default_rng(4).integers(0, 2, SIDES)
PALETTE = Compound({"minecraft:swamp": Int(0), "minecraft:badlands": Int(200)})


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("columns", [True, False])
def test_water_has_the_colour_of_its_biome(tmp_path: Path, version: int, columns: bool):
    """By columns in version 2, by blocks in version 3; blocks in version 2 are what some programs write."""
    here = np.broadcast_to(BIOMES[:1], SIDES) if columns else BIOMES
    data = encoded(200 * (BIOMES[0] if columns and version == 2 else here))
    told: dict[str, Any] = {"BiomePalette": PALETTE, "BiomeData": data}
    if version == 3:
        told = {"Biomes": Compound({"Palette": PALETTE, "Data": data})}
    names = blocks_of(read_schematic(written(tmp_path / "a.schem", sponge(version, **told))).world)
    water = BLOCKS.reshape(-1) == 3
    wanted = np.array(["water in swamp", "water in badlands"])[here.reshape(-1)]
    assert (np.array(names)[water] == wanted[water]).all()


def test_thousands_of_biomes_and_blocks_are_no_millions_of_pairs(tmp_path: Path):
    many = np.arange(4096)
    palettes = [Compound({f"mod:{what}{n}": Int(n) for n in many.tolist()}) for what in ("block", "biome")]
    parts = [Compound({"Palette": palette, "Data": encoded(many)}) for palette in palettes]
    sides = {side: Short(16) for side in ("Height", "Length", "Width")}
    tags = File({"Schematic": Compound({**sides, "Version": Int(3), "Blocks": parts[0], "Biomes": parts[1]})})
    begun = time.process_time()
    with pytest.warns(UserWarning, match="4096 unknown blocks"):
        blocks = read_schematic(written(tmp_path / "a.schem", tags))
    assert len(blocks.world.materials) == 4097
    assert time.process_time() - begun < 5.0


def test_numbers_of_several_bytes():
    wanted = [0, 127, 128, 300, 16384, 5, (1 << 28) - 1]
    assert varints(np.asarray(encoded(np.array(wanted))).view(np.uint8)).tolist() == wanted
    with pytest.raises(ValueError, match="truncated"):
        varints(np.array([1, 128], np.uint8))
    with pytest.raises(ValueError, match="more than four bytes"):
        varints(np.array([128, 128, 128, 128, 1], np.uint8))


WRONG = {
    "Version must be 1, 2 or 3, got 9": sponge(9),
    "the palette of blocks lacks number 1": sponge(2, Palette=Compound({"minecraft:air": Int(0)})),
    "but the sides make 1785": sponge(1, Length=Short(17)),
    "got 65535 x 65535 x 65535": sponge(2, Width=Short(-1), Height=Short(-1), Length=Short(-1)),
    "Palette must be dict, got none": sponge(3, Blocks=Compound()),
    "Blocks and Data hold 1890 and 3": mcedit(Data=ByteArray([0, 0, 0])),
    "AddBlocks holds 2 blocks": mcedit(AddBlocks=ByteArray([0])),
    "BiomeData holds 3 biomes, but the sides make 378": sponge(
        2, BiomePalette=Compound(), BiomeData=ByteArray([0, 0, 0])
    ),
    "the palette of biomes lacks number 0": sponge(2, BiomePalette=Compound(), BiomeData=ByteArray([0] * 378)),
    "Width must be int, got none": File({"Height": Short(1), "Length": Short(1)}),
    "neither a schematic nor a structure: it holds Data": File({"Data": Compound({"raining": Int(0)})}),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_damaged_is_refused_in_one_line(tmp_path: Path, message: str):
    path = written(tmp_path / "a.schem", WRONG[message])
    with pytest.raises(ValueError, match=message) as told:
        tracer.load(path)
    assert str(path) in str(told.value)


@pytest.mark.parametrize("tags", [sponge(1), sponge(2), sponge(3)["Schematic"], mcedit()], ids=["1", "2", "3", "mc"])
def test_no_value_of_a_wrong_kind_does_worse_than_a_message(tmp_path: Path, tags: Compound) -> None:
    wrong = (Int(-1), Int(2**31 - 1), String(""), Compound(), ByteArray([]), IntArray([-1, 2]), Double("inf"), List([]))
    told = list[str]()
    for key in tags:
        for value in (None, *wrong):
            changed = {
                **{name: tag for name, tag in tags.items() if name != key},
                **({key: value} if value is not None else {}),
            }
            path = written(tmp_path / "a.schem", File(changed), packed=False)
            try:
                read_schematic(path)
            except ValueError as error:
                told.append(str(error))
    assert len(told) > len(wrong), "sizes and blocks at least are needed"
    assert all("a.schem" in line for line in told), "each says which file"


def test_truncated_and_bombed_files_are_refused(tmp_path: Path):
    path = written(tmp_path / "a.schem", sponge(2))
    whole = path.read_bytes()
    for data in (whole[:-9], whole[:40], b"", b"\x1f\x8b", zlib.compress(bytes(1 << 27), wbits=31)):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=r"a\.schem: "):
            tracer.load(path)


def test_a_schematic_stands_on_ground_with_its_shapes(tmp_path: Path):
    blocks = np.full(SIDES, 4)
    blocks[0, 0, 0] = 1
    scene = tracer.load(written(tmp_path / "a.schem", sponge(2, BlockData=encoded(blocks))))
    assert list(scene.views) == ["front", "orbit", "detail"]
    assert len(scene.instances) == 1
    origins = torch.tensor([[10.5, 30.0, 9.5], [10.5, -0.2, -40.0], [10.5, 30.0, -40.0]])
    directions = torch.tensor([[0.0, -1.0, 0.0], [0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])
    hits = tracer.trace(scene, origins, directions, poses=scene.poses([0.0])[0][None])
    assert torch.allclose(hits.t[[0, 2]], torch.tensor([25.0, 30.0]), atol=1e-3)  # the slab's top, and the ground


def test_what_is_made_of_shapes_alone_is_framed_with_them(tmp_path: Path):
    blocks = np.full(SIDES, 4)  # slabs
    scene = tracer.load(written(tmp_path / "a.schem", sponge(2, BlockData=encoded(blocks))))
    size = np.array(SIDES)[[2, 0, 1]]
    for view in scene.views.values():
        assert np.allclose(view.target(0.0), size / 2, atol=size.max() / 4)
    camera = scene.views["front"].camera(time=0.0, size=(64, 96))
    corners = torch.tensor(list(np.ndindex(2, 2, 2))) * torch.from_numpy(size).float()
    pixels = camera.project(camera.to_view(corners.T[None, :, None]))[0].flatten(1)
    assert (pixels > 0).all()
    assert (pixels < torch.tensor([[96.0], [64.0]])).all()
    assert (pixels.amax(dim=1) - pixels.amin(dim=1) > torch.tensor([40.0, 25.0])).any()


def test_the_real_schematic():
    data = os.environ.get("GBUFRT_TEST_DATA")
    if data is None:
        pytest.skip("GBUFRT_TEST_DATA is not set")
    blocks = read_schematic(Path(data) / "schem/smallhouse1.schem")
    assert blocks.unknown == ()
    assert blocks.shaped is not None
    names = {blocks.world.materials.names[int(n)] for n in blocks.shaped.model.bricks.unique()}
    assert {"spruce_stairs", "torch_head", "stick"} <= names or {"spruce_stairs", "lantern_glass"} <= names
