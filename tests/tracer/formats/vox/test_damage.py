"""Broken and damaged MagicaVoxel files: one error that names file and fault, and no large allocations."""

from __future__ import annotations

import os
import struct
import tracemalloc
from pathlib import Path

import pytest
import torch
from damage import damaged
from hypothesis import given, settings
from hypothesis import strategies as st
from writers import vox
from writers.vox import MODEL, STEPS, read

from tracer.formats.vox.scene_graph import read_vox

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
