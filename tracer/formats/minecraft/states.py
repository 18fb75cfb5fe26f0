"""Block states as numbers: the voxel ids of cubes, and the shapes of all else, with what they are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import final

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft import plants, shapes
from tracer.formats.minecraft.colors import known, material, table, tint_kind
from tracer.formats.minecraft.lamps import FRONTS
from tracer.formats.minecraft.pack.pack import NONE, Dressed, Faces, Pack
from tracer.formats.minecraft.sections import Section
from tracer.formats.minecraft.voxels import SIDE, Shape
from tracer.scene.grids import BRICK
from tracer.scene.material import Material, MaterialTable

NOTHING_TOLD: Mapping[str, str] = MappingProxyType({})
WET = ("seagrass", "tall_seagrass", "kelp", "kelp_plant", "bubble_column")
GROUPS = BRICK // 2  # of 2 x 2 x 2 blocks, along a section


@dataclass(frozen=True, eq=False, kw_only=True)
class Voxels:
    """A section as voxels.

    Args:
        cubes: ``(16, 16, 16)`` int16 voxel ids in the order x, y, z; or one for all.
        groups: ``(G, 3)`` the groups of 2 x 2 x 2 blocks that hold one that is no cube, counted in groups from the
            section's corner.
        rows: ``(G, 8)`` uint16 the shapes in each.
    """

    cubes: NDArray[np.int16] | int
    groups: NDArray[np.int64]
    rows: NDArray[np.uint16]


@final
class States:
    """Gives numbers to block states in the order in which they come; numbers that are given stay.

    Args:
        pack: whose textures they have, if any.
    """

    def __init__(self, pack: Pack | None = None) -> None:
        self.unknown: set[str] = set()
        self._pack = pack
        self._materials: dict[str, Material] = {}
        self._faces: list[Faces] = []
        self._numbers: dict[tuple[str, Faces], int] = {}
        self._rows: dict[tuple[str, str], tuple[int, int]] = {}
        self._kinds: list[NDArray[np.int16]] = [np.zeros((SIDE,) * 3, np.int16)]
        self._kind_of: dict[bytes, int] = {}

    def __len__(self) -> int:
        return len(self._materials)

    def materials(self) -> MaterialTable:
        """What the voxel ids mean."""
        table = MaterialTable.of(list(self._materials.values()))
        return table if self._pack is None else replace(table, textures=self._pack.textures(self._faces))

    @property
    def untextured(self) -> tuple[str, ...]:
        """Names of blocks that the pack has no texture of."""
        return () if self._pack is None else tuple(sorted(self._pack.missing))

    def voxels(self, section: Section, keep: tuple[slice, slice, slice] | None = None) -> Voxels:
        """A section as voxels; ``keep`` says which of its blocks, in the order x, y, z, by default all."""
        biome = 0 if section.biome is None else section.biome
        blocks = np.broadcast_to(section.blocks, BRICK**3).reshape(BRICK, BRICK, BRICK)
        there = np.full((len(section.states), len(section.biomes)), len(section.biomes) == 1)
        there[blocks, biome] = True  # thousands of states and of biomes would make millions of pairs
        pairs = np.zeros((*there.shape, 2), np.int64)
        pairs[there] = [self._row(section.states[i], section.biomes[j]) for i, j in np.argwhere(there)]
        cubes, kinds = pairs.transpose(2, 0, 1)
        nothing = np.zeros((0, 3), np.int64), np.zeros((0, 8), np.uint16)
        if section.blocks.size == 1 and section.biome is None and keep is None and not kinds[0, 0]:
            return Voxels(cubes=int(cubes[0, 0]), groups=nothing[0], rows=nothing[1])
        ids, kind = (_cropped(lut[blocks, biome].transpose(2, 0, 1), keep) for lut in (cubes, kinds))
        groups, rows = _grouped(kind.astype(np.uint16)) if kind.any() else nothing
        return Voxels(cubes=np.ascontiguousarray(ids, np.int16) if ids.any() else 0, groups=groups, rows=rows)

    def pieces(self, rows: NDArray[np.uint16]) -> NDArray[np.int16]:
        """``(N, 16, 16, 16)`` voxel ids of groups ``(N, 8)`` of shapes."""
        pieces = np.stack(self._kinds)[rows.reshape(-1, 2, 2, 2)]
        return pieces.transpose(0, 1, 4, 2, 5, 3, 6).reshape(-1, BRICK, BRICK, BRICK)

    def _row(self, state: str, biome: str) -> tuple[int, int]:
        """Voxel id and number of the shape of a block state in a biome; 0 is nothing."""
        key = (state, biome)
        if key not in self._rows:
            self._rows[key] = self._made(state, biome)
        return self._rows[key]

    def _made(self, state: str, biome: str) -> tuple[int, int]:
        name, told = shapes.parse_state(state)
        told, block = {**shapes.defaults_of(name), **told}, name
        wet = name in WET or told.get("waterlogged") == "true"
        if shapes.is_nothing(name) or name == "bubble_column":
            return (self._number("water", biome, "water") if wet else 0), 0
        if told.get("lit") == "true" and (lit := f"lit_{name.removeprefix('waxed_')}") in table()["emission"]:
            name = lit
        parts = self._parts(name, block, told, biome)
        if parts is None:
            return self._number(name, biome, block, told), 0
        voxels = np.zeros((SIDE,) * 3, np.int16)
        for part, mask in parts:
            voxels[mask] = self._number(part, biome, block if part == name else None, told)
        key = voxels.tobytes()
        if key not in self._kind_of:
            self._kind_of[key] = len(self._kinds)
            self._kinds.append(voxels)
        return (self._number("water", biome, "water") if wet else 0), self._kind_of[key]

    def _parts(self, name: str, block: str, told: Mapping[str, str], biome: str) -> Shape | None:
        """The shape of a block, or None for a cube; plants and leaves have that of their picture, if they have one."""
        try:
            parts = shapes.shape_of(name, told)
        except (ValueError, KeyError):  # properties that no game writes
            parts = None
        plant = plants.is_plant(name)
        if plant or parts is None or name in FRONTS:
            dressed = self._dressed(name, biome, block, told)
            if name in FRONTS:  # a pack's own picture tells what glows
                return parts if dressed.faces == NONE else None
            if dressed.solid is not None and dressed.material.opacity == 1.0:
                return ((name, plants.cut_out(dressed.solid, crossed=plant)),)
        return parts

    def _number(self, name: str, biome: str, block: str | None, told: Mapping[str, str] = NOTHING_TOLD) -> int:
        """The voxel id of a material; ``block`` is the block whose texture it has, if any."""
        dressed = self._dressed(name, biome, block, told)
        if dressed.faces == NONE and not known(name) and name not in table()["emission"]:
            self.unknown.add(name)
        made, key = dressed.material, (dressed.material.name, dressed.faces)
        if key not in self._numbers:
            self._numbers[key] = len(self._materials) + 1
            label = made.name if made.name not in self._materials else f"{made.name}, {len(self._materials)}"
            self._materials[label] = replace(made, name=label)
            self._faces.append(dressed.faces)
        return self._numbers[key]

    def _dressed(self, name: str, biome: str, block: str | None, told: Mapping[str, str]) -> Dressed:
        """The material of a block, with textures where there is a pack."""
        biome = biome.rpartition(":")[2] if tint_kind(name) else ""
        plain = material(name, biome)
        if self._pack is None or block is None:
            return Dressed(material=plain)
        return self._pack.dress(plain, block, told, biome)


def _grouped(kind: NDArray[np.uint16]) -> tuple[NDArray[np.int64], NDArray[np.uint16]]:
    """The groups of 2 x 2 x 2 blocks of a section that hold one that is no cube."""
    groups = kind.reshape(GROUPS, 2, GROUPS, 2, GROUPS, 2).transpose(0, 2, 4, 1, 3, 5).reshape(-1, 8)
    used = np.flatnonzero(groups.any(axis=1))
    return np.stack(np.unravel_index(used, (GROUPS,) * 3), axis=1), groups[used]


def _cropped(ids: NDArray[np.int64], keep: tuple[slice, slice, slice] | None) -> NDArray[np.int64]:
    if keep is None:
        return ids
    kept = np.zeros_like(ids)
    kept[keep] = ids[keep]
    return kept
