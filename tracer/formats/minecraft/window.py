"""A window of chunks that follows a place over a world: only what enters it is read, and what stays is left alone."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import final

import numpy as np
import torch
from numpy.typing import NDArray

from gbufrt.numeric import check_counts
from tracer.formats.minecraft.build import Blocks, instance_of
from tracer.formats.minecraft.pack.archive import PackError
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.region import SIDE, Place, Region, region_files, region_place
from tracer.formats.minecraft.save import NAMED, WIDTH, Selection, chunk_sections, unknown_told, untextured_told
from tracer.formats.minecraft.states import GROUPS, States, Voxels
from tracer.scene.grids import BRICK
from tracer.scene.material import MaterialTable
from tracer.scene.pool import Key, Pool
from tracer.scene.world import World

LEAST, MOST = 4, 64  # chunks along a window


@dataclass(frozen=True, eq=False, kw_only=True)
class _Chunk:
    """What a chunk has in the pool: cells of both indices, the bricks there, and their keys."""

    cells: NDArray[np.int64]
    bricks: NDArray[np.int32]
    groups: NDArray[np.int64]
    pieces: NDArray[np.int32]
    keys: list[Key]


@final
class Window:
    """N x N chunks of a region file or a save folder, those round a place.

    Damaged chunks are left out, and warnings name the first of them; missing ones are empty.

    Args:
        path: of the file or folder.
        chunks: N; from any place in the middle at least `reach` blocks are there on every side.
        selection: the part of the world beyond which nothing is taken; by default all.
        device: where the voxels lie.
        pack: a resource pack with textures; see `tracer.formats.minecraft.pack.pack.Pack` for its errors.

    Raises:
        ValueError: N is out of range, or the path holds no regions.
        FileNotFoundError: there is no such file or folder.
    """

    def __init__(
        self,
        path: Path,
        *,
        chunks: int,
        selection: Selection | None = None,
        device: torch.device | str = "cpu",
        pack: str | PathLike[str] | None = None,
    ) -> None:
        check_counts(window=chunks)
        if not LEAST <= chunks <= MOST:
            raise ValueError(f"window must lie in {LEAST}..{MOST} chunks, got {chunks}")
        self.chunks, self.device = chunks, device
        self.pool = Pool(device)
        self._selection = selection or Selection()
        self._files = {region_place(file): file for file in region_files(path)}
        self._regions: dict[Place, Region] = {}
        self._states, self._table = States(None if pack is None else Pack(pack)), MaterialTable.of([])
        self._emits = torch.zeros(1, dtype=torch.bool)
        self._held: dict[Place, _Chunk] = {}
        self._damaged, self._told = 0, set[str]()
        self._low: Place | None = None
        self._blocks: Blocks | None = None

    @property
    def reach(self) -> float:
        """Blocks."""
        return reach_of(self.chunks)

    def __len__(self) -> int:
        """How many chunks are held."""
        return len(self._held)

    def at(self, x: float, z: float) -> Blocks:
        """The blocks round a place; the same object as before where the window does not move.

        What was returned before the window moved is no longer right.
        """
        low, high = Selection(chunks=self.chunks).chunk_range((math.floor(x), math.floor(z)))
        if self._blocks is None or low != self._low:
            self._move(low, high)
            self._low, self._blocks = low, self._made(low)
        return self._blocks

    def _move(self, low: Place, high: Place) -> None:
        for place in [place for place in self._held if not _within(low, place, high)]:
            self.pool.give(self._held.pop(place).keys)
        self._open(low, high)
        for region in self._regions.values():
            for place in _places(region, low, high):
                if place not in self._held and self._selection.takes(place):
                    self._held[place] = self._read(region, place)
        self._tell(self._states.unknown, unknown_told)
        self._tell(self._states.untextured, untextured_told)

    def _tell(self, names: Iterable[str], told: Callable[[list[str]], str]) -> None:
        """Warn of blocks that have not been told before."""
        if fresh := sorted(set(names) - self._told):
            self._told.update(fresh)
            warnings.warn(told(fresh), stacklevel=5)

    def _open(self, low: Place, high: Place) -> None:
        """Keep the tables of the regions that the window touches, and no others."""
        near = {
            (x, z)
            for x in range(low[0] // SIDE, (high[0] - 1) // SIDE + 1)
            for z in range(low[1] // SIDE, (high[1] - 1) // SIDE + 1)
        } & self._files.keys()
        self._regions = {key: self._regions.get(key) or Region.of(self._files[key]) for key in sorted(near)}

    def _read(self, region: Region, place: Place) -> _Chunk:
        try:
            parts = chunk_sections(region, place, self._selection.box)
            made = [(section.y, self._states.voxels(section, keep)) for section, keep in parts]
        except PackError:
            raise
        except ValueError as error:
            self._damaged += 1
            if self._damaged <= NAMED:
                last = "; further ones are left out without a word" if self._damaged == NAMED else ""
                what = f"chunk {place[0]},{place[1]} of {region.path.name} is damaged and left out"
                warnings.warn(f"{what}: {error}{last}", stacklevel=5)
            made = []
        if len(self._states) >= len(self._table):
            self._table = self._states.materials()
            self._emits = self._table.emission.amax(dim=1) > 0
        return self._stored(place, made)

    def _stored(self, place: Place, made: list[tuple[int, Voxels]]) -> _Chunk:
        """A chunk's bricks in the pool."""
        solid = [(y, v.cubes) for y, v in made if not isinstance(v.cubes, int) or v.cubes]
        keys: list[Key] = [cubes if isinstance(cubes, int) else (place[0], y, place[1]) for y, cubes in solid]
        bricks = self.pool.take(keys, lambda which: np.stack([_brick(solid[n][1]) for n in which]), self._emits)
        corners = [v.groups + np.array((place[0], y, place[1])) * GROUPS for y, v in made]
        groups = np.concatenate([np.zeros((0, 3), np.int64), *corners])
        rows = np.concatenate([np.zeros((0, 8), np.uint16), *(v.rows for _, v in made)])
        packed, number = np.unique(np.ascontiguousarray(rows).view("V16"), return_inverse=True)
        shapes = packed.view(np.uint16).reshape(-1, 8)
        names: list[Key] = [row.tobytes() for row in shapes]
        pieces = self.pool.take(names, lambda which: self._states.pieces(shapes[which]), self._emits)
        return _Chunk(
            cells=np.array([(place[0], y, place[1]) for y, _ in solid], np.int64).reshape(-1, 3),
            bricks=np.array(bricks, np.int32),
            groups=groups,
            pieces=np.array(pieces, np.int32)[number.reshape(-1)],
            keys=[*keys, *names],
        )

    def _made(self, low: Place) -> Blocks:
        table, held = self._table.to(self.device), list(self._held.values())
        cubes = self._world([c.cells for c in held], [c.bricks for c in held], low, 1, table)
        shapes = self._world([c.groups for c in held], [c.pieces for c in held], low, GROUPS, table)
        return Blocks(world=cubes, shaped=instance_of(shapes), unknown=tuple(sorted(self._states.unknown)))

    def _world(
        self,
        cells: list[NDArray[np.int64]],
        bricks: list[NDArray[np.int32]],
        low: Place,
        each: int,
        table: MaterialTable,
    ) -> World:
        """All bricks at their cells, of which a chunk has ``each`` along its side."""
        where = np.concatenate([np.zeros((0, 3), np.int64), *cells])
        bottom, top = (int(where[:, 1].min()), int(where[:, 1].max())) if len(where) else (0, 0)
        corner = np.array((low[0] * each, bottom, low[1] * each))
        index = np.zeros((self.chunks * each, top - bottom + 1, self.chunks * each), np.int32)
        index[tuple((where - corner).T)] = np.concatenate([np.zeros(0, np.int32), *bricks])
        x, y, z = (int(n) * BRICK for n in corner)
        return self.pool.world(index, (x, y, z), table)


def reach_of(chunks: int) -> float:
    """How many blocks a window of so many chunks along each side holds at least on every side of its place."""
    return WIDTH * (chunks - 1) / 2


def _within(low: Place, place: Place, high: Place) -> bool:
    return low[0] <= place[0] < high[0] and low[1] <= place[1] < high[1]


def _places(region: Region, low: Place, high: Place) -> Iterator[Place]:
    """The chunks of a region that lie within."""
    for x in range(low[0], high[0]):
        for z in range(low[1], high[1]):
            if (x, z) in region.sectors:
                yield x, z


def _brick(cubes: NDArray[np.int16] | int) -> NDArray[np.int16]:
    return np.full((BRICK,) * 3, cubes, np.int16) if isinstance(cubes, int) else cubes
