"""Materials: what a voxel is made of."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from gbufrt.numeric import check_numbers, check_three
from gbufrt.tree import map_tensors
from tracer.scene.textures import Textures

RGB = tuple[float, float, float]
COLUMNS = ("albedo", "roughness", "metallic", "emission", "opacity", "tint", "variation")
"""The tensors of a `MaterialTable`, a row for each material."""
WATER = re.compile(r"(?:.*:)?water\b")


@dataclass(frozen=True, kw_only=True)
class Material:
    """One row of a material table; colours are linear.

    Args:
        name: for people and for look-ups.
        albedo: reflectance in [0, 1].
        roughness: perceptual, in [0, 1].
        metallic: in [0, 1].
        emission: emitted radiance.
        opacity: 1 blocks all light; below 1, ``tint`` of the rest is transmitted.
        tint: transmitted share of light per world unit of the material's depth.
        variation: relative deviation of the colour of a face's texels from ``albedo``.
    """

    name: str
    albedo: RGB = (0.8, 0.8, 0.8)
    roughness: float = 0.9
    metallic: float = 0.0
    emission: RGB = (0.0, 0.0, 0.0)
    opacity: float = 1.0
    tint: RGB = (1.0, 1.0, 1.0)
    variation: float = 0.08

    def __post_init__(self) -> None:
        for key in ("albedo", "tint", "emission"):
            check_three(key, getattr(self, key), f"material {self.name!r}")
        check_numbers(**{key: getattr(self, key) for key in ("roughness", "metallic", "opacity", "variation")})
        unit = {"albedo": self.albedo, "tint": self.tint}
        unit |= {k: (getattr(self, k),) for k in ("roughness", "metallic", "opacity", "variation")}
        for key, values in unit.items():
            if not all(0.0 <= v <= 1.0 for v in values):
                raise ValueError(f"{key} of material {self.name!r} must lie in [0, 1], got {values}")
        if min(self.emission) < 0:
            raise ValueError(f"emission of material {self.name!r} must not be negative, got {self.emission}")


AIR = Material(name="air", albedo=(0.0, 0.0, 0.0), opacity=0.0, variation=0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class MaterialTable:
    """M materials as tensors, row 0 being air; kernels index them with a voxel id.

    Args:
        names: M names.
        albedo: ``(M, 3)`` linear.
        roughness: ``(M,)`` perceptual.
        metallic: ``(M,)``.
        emission: ``(M, 3)`` radiance.
        opacity: ``(M,)``.
        tint: ``(M, 3)`` transmitted share per world unit.
        variation: ``(M,)`` relative.
        textures: of their faces; they take the place of albedo, roughness, metallic and emission where a face has one.
            The emission of the material is then their mean, by which its voxels light others.
    """

    names: tuple[str, ...]
    albedo: Tensor
    roughness: Tensor
    metallic: Tensor
    emission: Tensor
    opacity: Tensor
    tint: Tensor
    variation: Tensor
    textures: Textures | None = None

    @staticmethod
    def of(materials: Sequence[Material]) -> MaterialTable:
        """A table of ``materials`` after air, which is added as row 0.

        Raises:
            ValueError: two share a name, or there are more than int16 ids can name.
        """
        rows = [AIR, *materials]
        names = tuple(m.name for m in rows)
        if len(set(names)) != len(names):
            raise ValueError(
                f"material names must differ, got {sorted({n for n in names if names.count(n) > 1})} twice"
            )
        if len(rows) > 32767:
            raise ValueError(f"at most 32766 materials fit int16 voxel ids, got {len(materials)}")
        columns: dict[str, Any] = {}
        for key in COLUMNS:
            columns[key] = torch.tensor([getattr(m, key) for m in rows], dtype=torch.float32)
        return MaterialTable(names=names, **columns)

    @staticmethod
    def joined(tables: Sequence[MaterialTable], names: Sequence[str]) -> MaterialTable:
        """Tables in one: the rows of the first, and those of each other without its air. ``names`` are of all rows."""
        pairs = [(table, min(number, 1)) for number, table in enumerate(tables)]
        columns = {key: torch.cat([getattr(table, key)[first:] for table, first in pairs]) for key in COLUMNS}
        textures = None
        if any(table.textures is not None for table in tables):
            own = [(table.textures or Textures.none(len(table), table.albedo), first) for table, first in pairs]
            textures = Textures.joined([Textures(faces=t.faces[first:], texels=t.texels) for t, first in own])
        return MaterialTable(names=tuple(names), textures=textures, **columns)

    def __len__(self) -> int:
        return len(self.names)

    def id(self, name: str) -> int:
        """The voxel id of a material.

        Raises:
            ValueError: there is none of that name.
        """
        if name not in self.names:
            raise ValueError(f"no material {name!r}; there are {', '.join(self.names)}")
        return self.names.index(name)

    @cached_property
    def transmissive(self) -> bool:
        """Whether any material but air lets light through."""
        return bool((self.opacity[1:] < 1).any())

    @cached_property
    def water(self) -> Tensor:
        """``(M,)`` bool: which are called water, with or without a name space before it and a biome after it."""
        return torch.tensor([bool(WATER.match(name)) for name in self.names], device=self.albedo.device)

    @cached_property
    def has_water(self) -> bool:
        """Whether there is water that lets light through."""
        return bool((self.water & (self.opacity < 1)).any())

    def each(self, column: str, which: Tensor) -> Tensor:
        """What a column holds for materials ``which``, integers ``(...)``: in a third of the time of an index."""
        values: Tensor = getattr(self, column)
        return values.index_select(0, which.flatten()).view(which.shape + values.shape[1:])

    def passing(self, which: Tensor, run: Tensor) -> Tensor:
        """``(..., 3)`` share of light that comes through materials.

        Args:
            which: ``(...)`` integers.
            run: ``(...)`` how far light goes through each, world units.
        """
        share = self.each("tint", which) ** run.clamp_min(0)[..., None]
        return share * (1 - self.each("opacity", which))[..., None]

    def to(self, *args: Any, **kwargs: Any) -> MaterialTable:
        """The table on another device; arguments as `torch.Tensor.to`."""
        return map_tensors(lambda t: t.to(*args, **kwargs), self)
