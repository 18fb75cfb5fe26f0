"""MagicaVoxel files: orientation, palette, materials, scene graph, and one clear error for whatever is broken."""

from __future__ import annotations

import itertools
import os
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import torch
import vox_writer as vox
from damage import damaged
from hypothesis import given, settings
from hypothesis import strategies as st

from tracer import worlds
from tracer.formats.vox.materials import default_palette
from tracer.formats.vox.scene_graph import load_vox_scene, read_vox
from tracer.scene.cells import cells_of_world
from tracer.scene.placement import place
from tracer.scene.world import World
from tracer.traversal.rays import trace

STEPS = ((0, 0, 0, 1), (1, 0, 0, 2), (0, 1, 0, 3), (0, 0, 1, 4))  # an origin and one voxel along each axis
MODEL = vox.model((3, 3, 3), STEPS)


def read(tmp_path: Path, *chunks: bytes, version: int = 200) -> World:
    path = tmp_path / "made.vox"
    path.write_bytes(vox.file(*chunks, version=version))
    return read_vox(path)


def contents(world: World) -> dict[tuple[int, ...], int]:
    cells, ids = cells_of_world(world)
    return {tuple(c): int(i) for c, i in zip(cells.tolist(), ids, strict=True)}


def by_color(world: World) -> dict[int, tuple[int, ...]]:
    return {i: c for c, i in contents(world).items()}


@pytest.mark.parametrize("version", [150, 200])
def test_z_up_becomes_y_up_without_a_mirror(tmp_path: Path, version: int) -> None:
    at = {k: np.array(v) for k, v in by_color(read(tmp_path, MODEL, version=version)).items()}
    x, y, z = at[2] - at[1], at[3] - at[1], at[4] - at[1]
    assert x.tolist() == [1, 0, 0]
    assert y.tolist() == [0, 0, -1]
    assert z.tolist() == [0, 1, 0]
    assert np.dot(np.cross(x, y), z) == 1


def test_every_rotation_turns_about_the_middle_as_its_byte_says(tmp_path: Path) -> None:
    odd = vox.model((3, 3, 3), STEPS)  # of odd size, so that turns about the middle stay on the grid
    for first, second in itertools.permutations(range(3), 2):
        for signs in range(8):
            byte = first | second << 2 | signs << 4
            rotation = np.zeros((3, 3), int)
            for row, column in enumerate((first, second, 3 - first - second)):
                rotation[row, column] = -1 if signs >> row & 1 else 1
            world = read(tmp_path, odd, vox.transform(0, 1, _r=str(byte), _t="10 -20 30"), vox.shape(1, 0))
            at = by_color(world)
            for x, y, z, color in STEPS:
                p = rotation @ (np.array([x, y, z]) + 0.5 - 1) + (10, -20, 30)
                assert at[color] == (int(np.floor(p[0])), int(np.floor(p[2])), int(np.floor(-p[1])))


def test_transforms_nest_and_models_repeat(tmp_path: Path) -> None:
    quarter = 1 | 0 << 2 | 1 << 4  # x' = -y, y' = x: a quarter turn about z
    dot = vox.model((1, 1, 1), [(0, 0, 0, 9)])
    world = read(
        tmp_path,
        dot,
        vox.transform(0, 1, _r=str(quarter), _t="100 0 0"),
        vox.group(1, 2, 4),
        vox.transform(2, 3, _t="5 0 0"),
        vox.shape(3, 0),
        vox.transform(4, 5, _t="0 0 7"),
        vox.shape(5, 0),
    )
    cells = sorted(contents(world))
    # (5,0,0) turns to (0,5,0), and 100 along x is added; the dot's own cell turns to the other side of the axis
    assert cells == sorted([(99, 0, -6), (99, 7, -1)])


def test_what_is_hidden_by_node_or_layer_stays_hidden(tmp_path: Path) -> None:
    dots = [vox.model((1, 1, 1), [(0, 0, 0, i)]) for i in (1, 2, 3)]
    world = read(
        tmp_path,
        *dots,
        vox.transform(0, 1),
        vox.group(1, 2, 4, 6),
        vox.transform(2, 3, _t="1 0 0"),
        vox.shape(3, 0),
        vox.transform(4, 5, hidden=True, _t="2 0 0"),
        vox.shape(5, 1),
        vox.transform(6, 7, layer=3, _t="3 0 0"),
        vox.shape(7, 2),
        vox.layer(3, hidden=True),
    )
    assert sorted(contents(world).values()) == [1]


def test_palette_is_srgb_and_its_first_entry_colours_index_one(tmp_path: Path) -> None:
    table = read(tmp_path, MODEL, vox.palette({1: (188, 0, 0), 2: (255, 255, 255)})).materials
    assert table.albedo[1].tolist() == pytest.approx([0.5029, 0, 0], abs=1e-3)
    assert float(table.albedo.max()) == pytest.approx(0.85)


def test_the_default_palette_has_its_known_structure(tmp_path: Path) -> None:
    table = default_palette().astype(int)
    rows = {1: "ffffff", 2: "ffffcc", 6: "ffff00", 7: "ffccff", 37: "ccffff", 215: "000033", 216: "ee0000"}
    rows |= {225: "110000", 226: "00ee00", 236: "0000ee", 246: "eeeeee", 255: "111111"}
    assert {i: bytes(table[i, :3].tolist()).hex() for i in rows} == rows
    assert read(tmp_path, MODEL).materials.albedo[6].tolist() == pytest.approx([0.85, 0.85, 0.0])


def test_materials_of_version_200(tmp_path: Path) -> None:
    red = dict.fromkeys(range(1, 6), (188, 0, 0))
    table = read(
        tmp_path,
        MODEL,
        vox.palette(red),
        vox.material(1, _type="_metal", _metal="0.75", _rough="0.3"),
        vox.material(2, _type="_glass", _weight="0.6", _rough="0.1"),
        vox.material(3, _type="_emit", _emit="0.5", _flux="2"),
        vox.material(4, _type="_diffuse", _rough="0.1"),
    ).materials
    assert table.metallic[1:5].tolist() == pytest.approx([0.75, 0, 0, 0])
    assert table.roughness[1:5].tolist() == pytest.approx([0.3, 0.1, 0.9, 0.9])
    assert table.opacity[1:5].tolist() == pytest.approx([1, 0.4, 1, 1])
    assert table.tint[2].tolist() == pytest.approx([0.5029, 0, 0], abs=1e-3)
    assert table.emission[3].tolist() == pytest.approx([0.5029 * 0.5 * 4 * 4, 0, 0], abs=1e-2)
    assert float(table.emission[4].max()) == 0


def test_materials_of_version_150(tmp_path: Path) -> None:
    table = read(
        tmp_path,
        MODEL,
        vox.old_material(1, 1, 0.8, {1: 0.25, 3: 0.3}),
        vox.old_material(2, 2, 0.5, {1: 0.0, 4: 0.1}),
        vox.old_material(3, 3, 1.0, {5: 0.5, 7: 0.0}),
        version=150,
    ).materials
    assert table.metallic[1].item() == pytest.approx(0.8)
    assert table.roughness[1].item() == pytest.approx(0.25)
    assert table.opacity[2].item() == pytest.approx(0.5)
    assert float(table.emission[3].max()) > float(table.emission[2].max()) == 0


BROKEN = {
    "no mark": (b"VOXX" + vox.file(MODEL)[4:], "begins with 'VOX '"),
    "version": (vox.file(MODEL, version=99), "version must be one of"),
    "truncated": (vox.file(MODEL)[:-3], "truncated"),
    "empty": (b"", "truncated"),
    "no model": (vox.file(), "no model"),
    "absurd side": (vox.file(vox.model((1, 1, 2**30), [])), r"sides of a model must lie in 1\.\.256"),
    "outside": (vox.file(vox.model((2, 2, 2), [STEPS[0], (0, 5, 0, 1)])), r"byte \d+: voxel \(0, 5, 0\) lies outside"),
    "voxel count": (
        vox.file(vox.chunk("SIZE", struct.pack("<iii", 1, 1, 1)), vox.chunk("XYZI", b"\xff\xff\xff\x7f")),
        "number of voxels",
    ),
    "no voxel": (vox.file(vox.model((2, 2, 2), [])), "0 visible voxels; show a layer"),
    "circle": (vox.file(MODEL, vox.transform(0, 1), vox.group(1, 2), vox.transform(2, 1)), "runs in a circle"),
    "no child": (vox.file(MODEL, vox.transform(0, 7)), "child 7 is no node"),
    "no root": (vox.file(MODEL, vox.shape(3, 0)), "no root"),
    "no such model": (vox.file(MODEL, vox.transform(0, 1), vox.shape(1, 4)), "model 4 of 1"),
    "rotation": (vox.file(MODEL, vox.transform(0, 1, _r="0"), vox.shape(1, 0)), "rotation byte 0"),
    "translation": (vox.file(MODEL, vox.transform(0, 1, _t="1 x 2"), vox.shape(1, 0)), "_t must be a whole number"),
    "far apart": (
        vox.file(
            MODEL, vox.transform(0, 1), vox.group(1, 2, 4), vox.transform(2, 3), vox.shape(3, 0),
            vox.transform(4, 5, _t="900000 0 0"), vox.shape(5, 0),
        ),
        "spans",
    ),
    "material": (vox.file(MODEL, vox.material(3, _type="_glass", _rough="nan")), "material 3: _rough must be finite"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_give_one_error_that_names_file_and_fault(tmp_path: Path, case: str) -> None:
    data, fault = BROKEN[case]
    path = tmp_path / "broken.vox"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=fault) as caught:
        read_vox(path)
    assert "broken.vox" in str(caught.value)


def test_deep_and_wide_scene_graphs_are_refused_without_large_allocations(tmp_path: Path) -> None:
    deep = [vox.transform(i, i + 1) for i in range(2000)] + [vox.shape(2000, 0)]
    wide = [vox.group(i, *[i + 1] * 20) for i in range(12)] + [vox.shape(12, 0)]
    full = [(x, y, z, 1) for x in range(16) for y in range(16) for z in range(16)]
    heavy = [vox.model((16, 16, 16), full), vox.group(0, *[1] * 30000), vox.shape(1, 0)]
    for nodes, fault in ((deep, "deeper"), (wide, "longer"), (heavy, "visible voxels")):
        tracemalloc.start()
        with pytest.raises(ValueError, match=fault):
            read(tmp_path, *([MODEL] if nodes is not heavy else []), *nodes)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 64 << 20


WHOLE = vox.file(
    vox.chunk("PACK", struct.pack("<i", 2)),
    MODEL,
    vox.model((4, 4, 4), [(1, 2, 3, 7), (3, 3, 3, 200)]),
    vox.palette({7: (10, 200, 30)}),
    vox.transform(0, 1, layer=0),
    vox.group(1, 2, 4),
    vox.transform(2, 3, _r="4", _t="3 4 5"),
    vox.shape(3, 0),
    vox.transform(4, 5, _r="17", _t="-3 0 2"),
    vox.shape(5, 1),
    vox.layer(0, hidden=False),
    vox.material(7, _type="_glass", _weight="0.5", _rough="0.1"),
    vox.old_material(9, 3, 1.0, {5: 0.5}),
    vox.chunk("rOBJ", b"whatever"),
)


@settings(max_examples=250, deadline=None)
@given(
    flips=st.lists(st.integers(0, 8 * len(WHOLE) - 1), max_size=6),
    keep=st.one_of(st.just(len(WHOLE)), st.integers(0, len(WHOLE))),
)
def test_damage_gives_a_value_error_or_a_world(
    tmp_path_factory: pytest.TempPathFactory, flips: list[int], keep: int
) -> None:
    data = bytearray(WHOLE)
    for bit in flips:
        data[bit // 8] ^= 1 << bit % 8
    path = tmp_path_factory.getbasetemp() / "damaged.vox"
    path.write_bytes(bytes(data[:keep]))
    try:
        world = read_vox(path)
    except ValueError as error:
        message = str(error)
    else:
        message = "damaged.vox"
        assert not world.empty
        assert bool(torch.isfinite(world.materials.emission).all())
    assert "damaged.vox" in message


def test_a_missing_file_is_named() -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.vox"):
        read_vox("nowhere.vox")


def test_a_placed_model_stands_on_ground_and_is_framed(tmp_path: Path) -> None:
    column = vox.model((4, 5, 20), [(x, y, z, 5) for x in range(4) for y in range(5) for z in range(20)])
    scene = place(read(tmp_path, column))
    assert list(scene.views) == ["front", "orbit", "detail"]
    table = scene.world.materials
    for name, view in scene.views.items():
        for t in (0.0, 5.0, 13.0):
            camera = view.camera(t, size=(60, 90))
            assert not bool(scene.world.at(camera.position.floor().long()).any())
            hits = trace(scene, *camera.rays())
            model = hits.hit & (hits.material == 5)
            assert model.any(), name
            if name != "detail":  # all of it is in the picture: nothing touches the border
                border = model[:, 0].any() or model[:, -1].any() or model[:, :, 0].any() or model[:, :, -1].any()
                assert not bool(border)
                rows = model[0].any(dim=1).sum().item()
                assert rows > 30
    under = scene.world.at(torch.tensor([[2, -1, -3], [2, 0, -3]]))
    assert table.names[int(under[0])].startswith("ground")
    assert int(under[1]) == 5


REAL = Path(os.environ.get("GBUFRT_TEST_DATA", "")) / "vox"


@pytest.mark.skipif("GBUFRT_TEST_DATA" not in os.environ, reason="GBUFRT_TEST_DATA is unset: no real .vox scenes")
@pytest.mark.parametrize(("name", "voxels"), [("scene_store8", 441118), ("scene_church1", 181774), ("chr_cop1", 267)])
def test_real_scenes_load(name: str, voxels: int) -> None:
    path = REAL / f"{name}.vox"
    assert int((read_vox(path).bricks > 0).sum()) == voxels
    scene = worlds.load(path)
    hits = trace(scene, *load_vox_scene(path).views["front"].camera(0.0, size=(27, 48)).rays())
    grounded = torch.tensor([n.startswith("ground") for n in scene.materials.names])[hits.material.long()]
    assert (hits.hit & ~grounded).float().mean().item() > 0.08


@pytest.mark.parametrize("name", ["chr_cop1", "scene_church1", "scene_store8"])
def test_damaged_real_files(tmp_path: Path, name: str) -> None:
    if "GBUFRT_TEST_DATA" not in os.environ:
        pytest.skip("GBUFRT_TEST_DATA is not set: it names the folder with files of other programs")
    data, told = (Path(os.environ["GBUFRT_TEST_DATA"]) / "vox" / f"{name}.vox").read_bytes(), []
    for seed in range(30):
        (tmp_path / "a.vox").write_bytes(damaged(data, seed))
        try:
            assert not read_vox(tmp_path / "a.vox").empty, seed
        except ValueError as error:
            told.append(str(error))
    assert len(told) >= 10
    assert all("a.vox" in message and "\n" not in message for message in told)


def test_the_limit_can_be_raised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.vox"
    path.write_bytes(vox.file(MODEL))
    with pytest.raises(ValueError, match=r"a\.vox: 4 visible voxels; at most 3 are read; .* GBUFRT_MAX_VOXELS"):
        read_vox(path, max_voxels=3)
    monkeypatch.setenv("GBUFRT_MAX_VOXELS", "3")
    with pytest.raises(ValueError, match="at most 3 are read"):
        read_vox(path)
    monkeypatch.setenv("GBUFRT_MAX_VOXELS", "4")
    assert not read_vox(path).empty
    monkeypatch.setenv("GBUFRT_MAX_VOXELS", "many")
    with pytest.raises(ValueError, match="GBUFRT_MAX_VOXELS must be a whole number of voxels, got 'many'"):
        read_vox(path)
