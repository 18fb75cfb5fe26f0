"""Sections of block states as bricks of voxels: one to one, and never a dense array of the whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.formats.minecraft import shapes
from tracer.formats.minecraft.colors import known, material, table, tint_kind
from tracer.formats.minecraft.sections import Section
from tracer.scene.cells import MAX_BRICK_CELLS
from tracer.scene.grids import BRICK
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance
from tracer.scene.world import World

MAX_PIECES = 1 << 15  # different groups of 2 x 2 x 2 blocks that are no cubes: 256 MiB
WET = ("seagrass", "tall_seagrass", "kelp", "kelp_plant", "bubble_column")

Cell = tuple[int, int, int]


@dataclass(frozen=True, eq=False, kw_only=True)
class Blocks:
    """Blocks as voxels.

    Args:
        world: the blocks that are cubes, and the water that others stand in.
        shaped: the others, at eight voxels a block, over the world; None where all are cubes.
        unknown: names of blocks that the colour table does not know.
    """

    world: World
    shaped: Instance | None
    unknown: tuple[str, ...]

    @property
    def instances(self) -> tuple[Instance, ...]:
        """For a scene."""
        return () if self.shaped is None else (self.shaped,)


@final
class Builder:
    """Collects sections and makes voxels of them, once."""

    def __init__(self) -> None:
        self.unknown: set[str] = set()
        self._materials: dict[str, Material] = {}
        self._numbers: dict[str, int] = {}
        self._rows: dict[tuple[str, str], tuple[int, int]] = {}
        self._kinds: list[NDArray[np.int16]] = [np.zeros((shapes.SIDE,) * 3, np.int16)]
        self._kind_of: dict[bytes, int] = {}
        self._bricks: list[NDArray[np.int16]] = [np.zeros((BRICK,) * 3, np.int16)]
        self._uniform: dict[int, int] = {0: 0}
        self._places: dict[Cell, int] = {}
        self._groups: list[tuple[NDArray[np.int64], NDArray[np.uint16]]] = []

    def add(self, x: int, z: int, section: Section, keep: tuple[slice, slice, slice] | None = None) -> None:
        """Add a section.

        Args:
            x: in sections.
            z: in sections.
            section: its blocks; nothing is added twice at one place.
            keep: which of its blocks to keep, in the order x, y, z; by default all.

        Raises:
            ValueError: the place is taken.
        """
        cell = (x, section.y, z)
        if cell in self._places:
            raise ValueError(f"section {section.y} comes twice")
        pairs = [[self._row(state, biome) for biome in section.biomes] for state in section.states]
        cubes, kinds = np.array(pairs, np.int64).transpose(2, 0, 1)
        if section.blocks.size == 1 and section.biome is None and keep is None and not kinds[0, 0]:
            self._places[cell] = self._uniformly(int(cubes[0, 0]))
            return
        blocks = np.broadcast_to(section.blocks, BRICK**3).reshape(BRICK, BRICK, BRICK)
        biome = 0 if section.biome is None else section.biome
        ids, kind = (_cropped(lut[blocks, biome].transpose(2, 0, 1), keep) for lut in (cubes, kinds))
        if ids.any():
            self._places[cell] = len(self._bricks)
            self._bricks.append(np.ascontiguousarray(ids, np.int16))
        else:
            self._places[cell] = 0
        if kind.any():
            self._shaped(np.array(cell), kind.astype(np.uint16))

    def build(self) -> Blocks:
        """The voxels of all sections.

        Raises:
            ValueError: there are none, or they lie too far apart for an index.
        """
        if not any(self._places.values()) and not self._groups:
            raise ValueError("there are no blocks but air")
        materials = MaterialTable.of(list(self._materials.values()))
        cells = np.array(list(self._places))
        low = cells.min(axis=0)
        index = np.zeros(_bounded(cells.max(axis=0) - low + 1), np.int32)
        index[tuple((cells - low).T)] = list(self._places.values())
        bricks = np.stack(self._bricks)
        self._bricks.clear()  # half of all memory
        world = World(
            bricks=torch.from_numpy(bricks),
            index=torch.from_numpy(index),
            origin=_triple(low * BRICK),
            materials=materials,
        )
        return Blocks(world=world, shaped=self._instance(materials), unknown=tuple(sorted(self.unknown)))

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

    def _uniformly(self, number: int) -> int:
        if number not in self._uniform:
            self._uniform[number] = len(self._bricks)
            self._bricks.append(np.full((BRICK,) * 3, number, np.int16))
        return self._uniform[number]

    def _shaped(self, cell: NDArray[np.int64], kind: NDArray[np.uint16]) -> None:
        """Keep the groups of 2 x 2 x 2 blocks of a section that hold one that is no cube."""
        half = BRICK // 2
        groups = kind.reshape(half, 2, half, 2, half, 2).transpose(0, 2, 4, 1, 3, 5).reshape(-1, 8)
        used = np.flatnonzero(groups.any(axis=1))
        self._groups.append((np.stack(np.unravel_index(used, (half,) * 3), axis=1) + cell * half, groups[used]))

    def _instance(self, materials: MaterialTable) -> Instance | None:
        """A brick for each different group: meadows are made of few."""
        if not self._groups:
            return None
        cells = np.concatenate([part for part, _ in self._groups])
        groups = np.concatenate([part for _, part in self._groups])
        rows, number = np.unique(groups.view("V16"), return_inverse=True)
        if len(rows) > MAX_PIECES:
            raise ValueError(
                f"more than {MAX_PIECES} different groups of blocks that are no cubes; choose a smaller box"
            )
        pieces = np.stack(self._kinds)[rows.view(np.uint16).reshape(-1, 2, 2, 2)]
        bricks = pieces.transpose(0, 1, 4, 2, 5, 3, 6).reshape(-1, BRICK, BRICK, BRICK)
        low = cells.min(axis=0)
        index = np.zeros(_bounded(cells.max(axis=0) - low + 1), np.int32)
        index[tuple((cells - low).T)] = number.reshape(-1) + 1
        model = World(
            bricks=torch.from_numpy(np.concatenate([np.zeros_like(bricks[:1]), bricks])),
            index=torch.from_numpy(index),
            origin=_triple(low * BRICK),
            materials=materials,
        )
        still = torch.eye(4)
        return Instance(model=model, pose=lambda _: still, scale=1 / shapes.SIDE, name="shapes")


def _cropped(ids: NDArray[np.int64], keep: tuple[slice, slice, slice] | None) -> NDArray[np.int64]:
    if keep is None:
        return ids
    kept = np.zeros_like(ids)
    kept[keep] = ids[keep]
    return kept


def _bounded(shape: NDArray[np.int64]) -> tuple[int, int, int]:
    if float(np.prod(shape.astype(np.float64))) > MAX_BRICK_CELLS:
        raise ValueError(
            f"blocks lie in a box of {_triple(shape * BRICK)}, too large for an index; choose a smaller box"
        )
    return _triple(shape)


def _triple(numbers: NDArray[np.int64]) -> tuple[int, int, int]:
    x, y, z = (int(n) for n in numbers)
    return x, y, z
