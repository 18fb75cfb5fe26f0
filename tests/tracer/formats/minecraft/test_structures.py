"""Litematica's schematics and the game's own structures: what lies where, and what is told of damage."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nbtlib import Compound, Double, File, Int, List
from writers.region import nbt_bytes, pack, palette_of

import tracer
from gbufrt.commands.inspection.world import show_world
from tracer.formats.minecraft.schematic import root_of, structure_of
from tracer.formats.minecraft.sections import PART, unpack

STATES = ("minecraft:air", "minecraft:stone", "minecraft:oak_log[axis=x]", "minecraft:structure_void")


def _written(path: Path, **tags: Any) -> Path:
    path.write_bytes(gzip.compress(nbt_bytes(File({"MinecraftDataVersion": Int(3955), **tags}))))
    return path


def _axes(x: int, y: int, z: int) -> Compound:
    return Compound({"x": Int(x), "y": Int(y), "z": Int(z)})


def _region(
    position: tuple[int, int, int], size: tuple[int, int, int], blocks: np.ndarray, states: Any = STATES
) -> Any:
    bits = max(2, (len(states) - 1).bit_length())
    return Compound(
        {
            "Position": _axes(*position),
            "Size": _axes(*size),
            "BlockStatePalette": palette_of(states, "1.21"),
            "BlockStates": pack(blocks.reshape(-1), bits, padded=False),
        }
    )


def _template(path: Path, blocks: dict[tuple[int, int, int], int], size: tuple[int, int, int], key: str) -> Path:
    palette = palette_of(STATES, "1.21")
    listed = [Compound({"pos": List[Int]([*map(Int, at)]), "state": Int(n)}) for at, n in blocks.items()]
    palettes = {key: palette if key == "palette" else List[List[Compound]]([palette, palette])}
    return _written(path, size=List[Int]([*map(Int, size)]), blocks=List[Compound](listed), **palettes)


def _names(path: Path) -> np.ndarray:
    found = structure_of(root_of(path))
    assert found is not None
    return np.array(found[0])[found[1]]


def test_numbers_that_go_on_in_the_next_long_are_unpacked_in_parts() -> None:
    numbers = np.random.default_rng(0).integers(0, 1 << 9, 2 * PART + 77)
    assert (unpack(pack(numbers, 9, padded=False), 9, len(numbers), padded=False) == numbers).all()


@pytest.mark.parametrize("count", [4, 5, 17])
def test_a_litematic_holds_its_blocks_in_the_order_y_z_x(count: int, tmp_path: Path) -> None:
    states = (*STATES[:3], *(f"minecraft:mod_{n}" for n in range(count - 3)))
    numbers = np.random.default_rng(count).integers(0, count, (3, 5, 7))
    path = _written(tmp_path / "a.litematic", Regions=Compound({"a": _region((0, 0, 0), (7, 3, 5), numbers, states)}))
    assert (_names(path) == np.array(states)[numbers]).all()


def test_regions_of_a_litematic_lie_where_they_say_and_sides_may_count_down(tmp_path: Path) -> None:
    stone, log = np.full((2, 2, 2), 1), np.array([2, 0, 3, 2]).reshape(1, 1, 4)
    # from x = 1 down to -2, over the low corner of the stone at x, y, z = 1..2, 0..1, 0..1
    regions = Compound({"a": _region((1, 0, 0), (2, 2, 2), stone), "b": _region((1, 0, 0), (-4, 1, 1), log)})
    names = _names(_written(tmp_path / "a.litematic", Regions=regions))
    assert names.shape == (2, 2, 5)
    expected = np.full((2, 2, 5), STATES[0], dtype=object)
    expected[:, :, 3:] = STATES[1]
    expected[0, 0, :4] = STATES[2], STATES[0], STATES[0], STATES[2]
    assert (names == expected).all()


@pytest.mark.parametrize("key", ["palette", "palettes"])
def test_a_structure_of_the_game_holds_what_it_lists(key: str, tmp_path: Path) -> None:
    path = _template(tmp_path / "a.nbt", {(0, 0, 0): 1, (3, 1, 2): 2, (1, 1, 1): 3}, (4, 2, 3), key)
    names = _names(path)
    assert names.shape == (2, 3, 4)
    assert names[0, 0, 0] == STATES[1]
    assert names[1, 2, 3] == STATES[2]
    assert (names == STATES[0]).sum() == 22


def test_both_become_worlds_and_are_inspected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from rich.console import Console

    numbers = np.ones((3, 5, 7), np.int64)
    paths = [
        _written(tmp_path / "a.litematic", Regions=Compound({"a": _region((0, 0, 0), (7, 3, 5), numbers)})),
        _template(tmp_path / "a.nbt", {(x, 0, 0): 1 for x in range(4)}, (4, 2, 3), "palette"),
    ]
    for path, what in zip(paths, ("Litematica schematic, 7 x 3 x 5", "Minecraft structure, 4 x 2 x 3"), strict=True):
        assert len(tracer.load(path).views) > 0
        show_world(Console(width=200), path)
        assert f"{what} blocks, the middle number upwards, Minecraft's data version 3955" in capsys.readouterr().out


def test_large_structures_and_full_chests_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The game's structure blocks list 48 x 48 x 48 blocks; what their chests hold is no block."""
    from rich.console import Console

    at = np.indices((48, 48, 48)).reshape(3, -1).T
    states = np.random.default_rng(0).integers(0, 3, len(at))
    listed = [Compound({"pos": List[Int]([*map(Int, p)]), "state": Int(n)}) for p, n in zip(at, states, strict=True)]
    listed[7] = Compound({"nbt": Compound({"Items": List[Compound]([Compound({"n": Int(1)})])}), **listed[7]})
    listed[8] = Compound({"state": listed[8]["state"], "pos": listed[8]["pos"]})
    palette = palette_of(STATES, "1.21")
    whole = _written(tmp_path / "a.nbt", size=List[Int]([Int(48)] * 3), palette=palette, blocks=List[Compound](listed))
    assert (_names(whole).transpose(2, 0, 1).reshape(-1) == np.array(STATES)[states]).all()
    chests = List[Compound]([Compound({"Items": List[Compound]([_axes(0, 0, 0)] * 27)})] * 6000)
    region = _region((0, 0, 0), (7, 3, 5), np.ones((3, 5, 7), np.int64))
    full = _written(tmp_path / "b.litematic", Regions=Compound({"a": Compound({**region, "TileEntities": chests})}))
    assert (_names(full) == STATES[1]).all()
    broken = Compound({**region, "BlockStates": region["BlockStates"][:0]})
    _written(tmp_path / "c.litematic", Regions=Compound({"a": broken}))
    show_world(Console(width=200), tmp_path / "c.litematic")
    assert "7 x 3 x 5 blocks" in capsys.readouterr().out, "its size is told without its blocks"


def test_damage_is_told(tmp_path: Path) -> None:
    numbers, far = np.ones((1, 1, 4), np.int64), 1 << 20
    region = _region((0, 0, 0), (4, 1, 1), numbers)
    apart = Compound({"a": region, "b": _region((far, far, far), (4, 1, 1), numbers)})
    broken = {
        "holds no regions": Compound(),
        r"take 1 longs, got 0": Compound({"a": Compound({**region, "BlockStates": region["BlockStates"][:0]})}),
        r"has no entry 1": Compound({"a": _region((0, 0, 0), (4, 1, 1), numbers, STATES[:1])}),
        r"must have 1 to \d+ blocks, got 1048580 x": apart,
        r"got 0 x 1 x 1": Compound({"a": _region((0, 0, 0), (0, 1, 1), numbers)}),
    }
    for told, regions in broken.items():
        with pytest.raises(ValueError, match=rf"a\.litematic: .*{told}"):
            tracer.load(_written(tmp_path / "a.litematic", Regions=regions))
    for at, number, told in (((4, 0, 0), 1, "lies at 4, 0, 0, outside 4 x 2 x 3"), ((0, 0, 0), 9, "has no entry 9")):
        with pytest.raises(ValueError, match=rf"a\.nbt: .*{told}"):
            tracer.load(_template(tmp_path / "a.nbt", {at: number}, (4, 2, 3), "palette"))
    good = {"size": List[Int]([*map(Int, (4, 2, 3))]), "palettes": List[List[Compound]]([palette_of(STATES, "1.21")])}
    for wrong, told in (
        (
            {"size": List[Double]([*map(Double, (1.0, np.inf, 1.0))])},
            "size must be three whole numbers, got 3 of Double",
        ),
        ({"size": List[Int]([Int(1), Int(1)])}, "size must be three whole numbers, got 2 of Int"),
        ({"palettes": List[Int]([Int(3)])}, "palettes must hold lists, got Int"),
    ):
        with pytest.raises(ValueError, match=rf"c\.nbt: .*{told}"):
            tracer.load(_written(tmp_path / "c.nbt", **{**good, "blocks": List[Compound]([]), **wrong}))
    (tmp_path / "b.nbt").write_bytes(b"hello")
    with pytest.raises(ValueError, match=r"^[^:]*b\.nbt: it is no NBT: it begins with b'hell', in place of b'.n'$"):
        tracer.load(tmp_path / "b.nbt")
