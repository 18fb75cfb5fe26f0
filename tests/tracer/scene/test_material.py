"""Materials and their tables."""

from __future__ import annotations

import pytest
import torch

from tracer.scene.material import Material, MaterialTable


def test_a_table_holds_its_materials_after_air() -> None:
    glass = Material(name="glass", albedo=(0.1, 0.2, 0.3), opacity=0.2, tint=(0.9, 0.8, 0.7), roughness=0.05)
    lamp = Material(name="lamp", emission=(9.0, 8.0, 7.0), metallic=1.0, variation=0.0)
    table = MaterialTable.of([glass, lamp])
    assert table.names == ("air", "glass", "lamp")
    assert len(table) == 3
    assert table.id("lamp") == 2
    for row, material in ((1, glass), (2, lamp)):
        for key in ("albedo", "roughness", "metallic", "emission", "opacity", "tint", "variation"):
            torch.testing.assert_close(getattr(table, key)[row], torch.tensor(getattr(material, key)))
    assert float(table.opacity[0]) == 0.0


def test_errors_name_what_is_wrong() -> None:
    with pytest.raises(ValueError, match="albedo of material 'a' must lie in"):
        Material(name="a", albedo=(0.5, 1.5, 0.5))
    with pytest.raises(ValueError, match="roughness of material 'a' must lie in"):
        Material(name="a", roughness=-0.1)
    with pytest.raises(ValueError, match="emission of material 'a' must not be negative"):
        Material(name="a", emission=(-1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="material names must differ"):
        MaterialTable.of([Material(name="a"), Material(name="a")])
    with pytest.raises(ValueError, match="no material 'b'; there are air, a"):
        MaterialTable.of([Material(name="a")]).id("b")
