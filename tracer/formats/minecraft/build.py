"""Sections of block states as bricks of voxels: one to one, and never a dense array of the whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.sections import Section
from tracer.formats.minecraft.states import GROUPS, States
from tracer.formats.minecraft.voxels import SIDE
from tracer.scene.cells import MAX_BRICK_CELLS
from tracer.scene.grids import BRICK
from tracer.scene.material import MaterialTable
from tracer.scene.scene import Instance
from tracer.scene.world import World

MAX_PIECES = 1 << 15  # different groups of 2 x 2 x 2 blocks that are no cubes: 256 MiB

Cell = tuple[int, int, int]


@dataclass(frozen=True, eq=False, kw_only=True)
class Blocks:
    """Blocks as voxels.

    Args:
        world: the blocks that are cubes, and the water that others stand in.
        shaped: the others, at eight voxels a block, over the world; None where all are cubes.
        unknown: names of blocks that the colour table does not know.
        untextured: names of blocks that the pack has no texture of.
    """

    world: World
    shaped: Instance | None
    unknown: tuple[str, ...]
    untextured: tuple[str, ...] = ()

    @property
    def instances(self) -> tuple[Instance, ...]:
        """For a scene."""
        return () if self.shaped is None else (self.shaped,)


@final
class Builder:
    """Collects sections and makes voxels of them, once; with the textures of a pack, if one is given."""

    def __init__(self, pack: Pack | None = None) -> None:
        self._states = States(pack)
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
        voxels = self._states.voxels(section, keep)
        if isinstance(voxels.cubes, int):
            self._places[cell] = self._uniformly(voxels.cubes)
        else:
            self._places[cell] = len(self._bricks)
            self._bricks.append(voxels.cubes)
        if len(voxels.rows):
            self._groups.append((voxels.groups + np.array(cell) * GROUPS, voxels.rows))

    def build(self) -> Blocks:
        """The voxels of all sections.

        Raises:
            ValueError: there are none, or they lie too far apart for an index.
        """
        if not any(self._places.values()) and not self._groups:
            raise ValueError("there are no blocks but air")
        materials = self._states.materials()
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
        return Blocks(
            world=world,
            shaped=self._instance(materials),
            unknown=tuple(sorted(self._states.unknown)),
            untextured=self._states.untextured,
        )

    def _uniformly(self, number: int) -> int:
        if number not in self._uniform:
            self._uniform[number] = len(self._bricks)
            self._bricks.append(np.full((BRICK,) * 3, number, np.int16))
        return self._uniform[number]

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
        bricks = self._states.pieces(rows.view(np.uint16).reshape(-1, 8))
        low = cells.min(axis=0)
        index = np.zeros(_bounded(cells.max(axis=0) - low + 1), np.int32)
        index[tuple((cells - low).T)] = number.reshape(-1) + 1
        model = World(
            bricks=torch.from_numpy(np.concatenate([np.zeros_like(bricks[:1]), bricks])),
            index=torch.from_numpy(index),
            origin=_triple(low * BRICK),
            materials=materials,
        )
        return instance_of(model)


def instance_of(model: World) -> Instance:
    """Blocks that are no cubes, over the world."""
    still = torch.eye(4)
    return Instance(model=model, pose=lambda _: still, scale=1 / SIDE, name="shapes")


def _bounded(shape: NDArray[np.int64]) -> tuple[int, int, int]:
    if float(np.prod(shape.astype(np.float64))) > MAX_BRICK_CELLS:
        raise ValueError(
            f"blocks lie in a box of {_triple(shape * BRICK)}, too large for an index; choose a smaller box"
        )
    return _triple(shape)


def _triple(numbers: NDArray[np.int64]) -> tuple[int, int, int]:
    x, y, z = (int(n) for n in numbers)
    return x, y, z
