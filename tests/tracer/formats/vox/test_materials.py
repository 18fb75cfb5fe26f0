"""MagicaVoxel's palette and materials."""

from __future__ import annotations

from pathlib import Path

import pytest
from writers import vox
from writers.vox import MODEL, read

from tracer.formats.vox.materials import default_palette


def test_palette_is_srgb_and_its_first_entry_colours_index_one(tmp_path: Path) -> None:
    table = read(tmp_path, MODEL, vox.palette({1: (188, 0, 0), 2: (255, 255, 255)})).materials
    assert table.albedo[1].tolist() == pytest.approx([0.5029, 0, 0], abs=1e-3)
    assert float(table.albedo.max()) == pytest.approx(0.85)


def test_a_palette_of_255_colours_is_whole(tmp_path: Path) -> None:
    colors = [(188, 0, 0, 255), *[(128, 128, 128, 255)] * 254]
    short = vox.chunk("RGBA", b"".join(map(bytes, colors)))
    assert read(tmp_path, MODEL, short).materials.albedo[1].tolist() == pytest.approx([0.5029, 0, 0], abs=1e-3)
    with pytest.raises(ValueError, match="RGBA needs 1020 bytes"):
        read(tmp_path, MODEL, vox.chunk("RGBA", b"".join(map(bytes, colors[1:]))))


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
