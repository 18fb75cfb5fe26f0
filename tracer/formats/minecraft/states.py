"""Block states as numbers: the voxel ids of cubes, and the shapes of all else, with what they are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft import shapes
from tracer.formats.minecraft.colors import known, material, table, tint_kind
from tracer.formats.minecraft.sections import Section
from tracer.scene.grids import BRICK
from tracer.scene.material import Material, MaterialTable

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
    """Gives numbers to block states in the order in which they come; numbers that are given stay."""

    def __init__(self) -> None:
        self.unknown: set[str] = set()
        self._materials: dict[str, Material] = {}
        self._numbers: dict[str, int] = {}
        self._rows: dict[tuple[str, str], tuple[int, int]] = {}
        self._kinds: list[NDArray[np.int16]] = [np.zeros((shapes.SIDE,) * 3, np.int16)]
        self._kind_of: dict[bytes, int] = {}

    def __len__(self) -> int:
        return len(self._materials)

    def materials(self) -> MaterialTable:
        """What the voxel ids mean."""
        return MaterialTable.of(list(self._materials.values()))

    def voxels(self, section: Section, keep: tuple[slice, slice, slice] | None = None) -> Voxels:
        """A section as voxels; ``keep`` says which of its blocks, in the order x, y, z, by default all."""
        pairs = [[self._row(state, biome) for biome in section.biomes] for state in section.states]
        cubes, kinds = np.array(pairs, np.int64).transpose(2, 0, 1)
        nothing = np.zeros((0, 3), np.int64), np.zeros((0, 8), np.uint16)
        if section.blocks.size == 1 and section.biome is None and keep is None and not kinds[0, 0]:
            return Voxels(cubes=int(cubes[0, 0]), groups=nothing[0], rows=nothing[1])
        blocks = np.broadcast_to(section.blocks, BRICK**3).reshape(BRICK, BRICK, BRICK)
        biome = 0 if section.biome is None else section.biome
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
        wet = name in WET or told.get("waterlogged") == "true"
        if shapes.is_nothing(name) or name == "bubble_column":
            return (self._number("water", biome) if wet else 0), 0
        if told.get("lit") == "true" and f"lit_{name}" in table()["emission"]:
            name = f"lit_{name}"
        try:
            parts = shapes.shape_of(name, told)
        except (ValueError, KeyError):  # properties that no game writes
            parts = None
        if parts is None:
            return self._number(name, biome), 0
        voxels = np.zeros((shapes.SIDE,) * 3, np.int16)
        for part, mask in parts:
            voxels[mask] = self._number(part, biome)
        key = voxels.tobytes()
        if key not in self._kind_of:
            self._kind_of[key] = len(self._kinds)
            self._kinds.append(voxels)
        return (self._number("water", biome) if wet else 0), self._kind_of[key]

    def _number(self, name: str, biome: str) -> int:
        """The voxel id of a block's material."""
        if not known(name) and name not in table()["emission"]:
            self.unknown.add(name)
        made = material(name, biome.rpartition(":")[2] if tint_kind(name) else "")
        if made.name not in self._numbers:
            self._numbers[made.name] = len(self._materials) + 1
            self._materials[made.name] = made
        return self._numbers[made.name]


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
