"""Grids: the voxels of a whole scene as flat arrays, in the form that rays traverse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from gbufrt.tree import map_tensors
from tracer.scene.material import MaterialTable

BRICK = 16
MAX_REACH = 64
PART = 1024  # bricks at a time
(MASK, MATERIAL, INDEX, NX, NY, NZ, LOW, HIGH, ORIGIN) = (0, 1, 2, 3, 4, 5, 6, 9, 12)
"""Columns of `Grids.entries`; the last three begin triples."""
COLUMNS_OF_TABLE = ("albedo", "roughness", "metallic", "emission", "opacity", "tint", "variation")


@dataclass(frozen=True, eq=False, kw_only=True)
class Grid:
    """One world's voxels; every empty place holds the size of the empty space around it.

    Args:
        bricks: ``(N, 16, 16, 16)`` int16: a voxel id, or -k where the aligned cube of side 2^k around it is empty.
        index: ``(X, Y, Z)`` int32: a brick, or -r where all bricks fewer than r cells away along each axis are empty.
        low: low corner of the occupied voxels, counted from the corner of ``index``.
        high: high corner; equal to ``low`` where there is no voxel.
    """

    bricks: Tensor
    index: Tensor
    low: tuple[int, int, int]
    high: tuple[int, int, int]

    @staticmethod
    def of(bricks: Tensor, index: Tensor) -> Grid:
        """The grid of a world's ``bricks`` and ``index``; see `tracer.scene.world.World`."""
        solid = bricks > 0
        low, high = _occupied(solid, index)
        return Grid(bricks=_with_cubes(bricks), index=_with_reach(index), low=low, high=high)


@dataclass(frozen=True, eq=False, kw_only=True)
class Grids:
    """All grids of a scene: entry 0 is the world, entry i + 1 is instance i.

    Args:
        bricks: ``(N, 16, 16, 16)`` int16, of all grids; see `Grid`.
        index: ``(K,)`` int32, of all grids, with brick numbers consecutive over all grids.
        entries: ``(I + 1, 15)`` int32: mask; what to add to a voxel id to get its row of ``materials``; first element,
            and size, of its index; low and high corner of its voxels; its origin.
        materials: of all grids. Row 0 is air, and the world's ids keep their rows.
        media: ``(M, 4)`` opacity and tint of each material.
    """

    bricks: Tensor
    index: Tensor
    entries: Tensor
    materials: MaterialTable
    media: Tensor

    @property
    def tensors(self) -> list[Tensor]:
        """The ``grids`` argument of the operators of `tracer.traversal.op`."""
        return [self.bricks.flatten(), self.index, self.entries, self.media]

    def to(self, *args: Any, **kwargs: Any) -> Grids:
        """The grids on another device; arguments as `torch.Tensor.to`."""
        return map_tensors(lambda t: t.to(*args, **kwargs), self)


def join(worlds: Sequence[Any], masks: Sequence[int], names: Sequence[str]) -> Grids:
    """Flatten worlds, the static one first. Worlds and tables that occur twice are stored once."""
    tables: list[MaterialTable] = []
    stored: dict[tuple[int, ...], int] = {}
    offsets: dict[tuple[int, ...], int] = {}
    bricks, indices, rows, labels = [], [], [], list[str]()
    for world, mask, name in zip(worlds, masks, names, strict=True):
        grid, table = world.grid, world.materials
        same_table = tuple(id(getattr(table, key)) for key in COLUMNS_OF_TABLE)
        same_voxels = (id(world.bricks), id(world.index))
        if same_table not in offsets:
            offsets[same_table] = len(labels) - 1 if tables else 0
            labels += _labels(table, name, labels) if tables else list(table.names)
            tables.append(table)
        if same_voxels not in stored:
            first = sum(len(b) for b in bricks)
            stored[same_voxels] = sum(i.numel() for i in indices)
            bricks.append(grid.bricks)
            indices.append(torch.where(grid.index > 0, grid.index + first, grid.index).flatten())
        offset, place = offsets[same_table], stored[same_voxels]
        rows.append([mask, offset, place, *grid.index.shape, *grid.low, *grid.high, *world.origin])
    materials = _merge(tables, labels)
    return Grids(
        bricks=torch.cat(bricks).contiguous() if len(bricks) > 1 else bricks[0].contiguous(),
        index=torch.cat(indices).contiguous(),
        entries=torch.tensor(rows, dtype=torch.int32, device=worlds[0].device),
        materials=materials,
        media=torch.cat([materials.opacity[:, None], materials.tint], dim=1).float().contiguous(),
    )


def _labels(table: MaterialTable, name: str, taken: Sequence[str]) -> list[str]:
    """Names of a further table's rows after air; a taken name is extended by the instance's name or a number."""
    used, labels = set(taken), []
    for label in table.names[1:]:
        unique, count = (f"{name}.{label}" if name and label in used else label), 2
        while unique in used:
            unique, count = f"{label}.{count}", count + 1
        used.add(unique)
        labels.append(unique)
    return labels


def _merge(tables: Sequence[MaterialTable], names: Sequence[str]) -> MaterialTable:
    if len(tables) == 1:
        return tables[0]
    columns = {key: torch.cat([getattr(t, key)[min(i, 1) :] for i, t in enumerate(tables)]) for key in COLUMNS_OF_TABLE}
    return MaterialTable(names=tuple(names), **columns)


def _with_cubes(bricks: Tensor) -> Tensor:
    coded = bricks.clone()
    for part in coded.split(PART):  # so that what is made on the way stays small
        solid = part > 0
        for power in (1, 2, 3):
            side, count = 1 << power, BRICK >> power
            empty = ~solid.view(-1, count, side, count, side, count, side).any(6).any(4).any(2)
            for dim in (1, 2, 3):
                empty = empty.repeat_interleave(side, dim=dim)
            part[empty] = -power
    return coded


def _with_reach(index: Tensor) -> Tensor:
    filled = index > 0
    reach = torch.zeros_like(index, dtype=torch.uint8)
    for _ in range(min(MAX_REACH, max(index.shape))):
        if bool(filled.all()):
            break
        reach += ~filled
        for axis, length in enumerate(index.shape):
            before, after = filled.narrow(axis, 0, length - 1), filled.narrow(axis, 1, length - 1)
            wider = filled.clone()
            wider.narrow(axis, 1, length - 1).logical_or_(before)
            wider.narrow(axis, 0, length - 1).logical_or_(after)
            filled = wider
    return torch.where(index > 0, index, -reach.to(torch.int32)).contiguous()


def _occupied(solid: Tensor, index: Tensor) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    cells = (index > 0).nonzero()
    low, high = [0, 0, 0], [0, 0, 0]
    numbers = index[tuple(cells.T)].long()
    place = torch.arange(BRICK, device=index.device)
    for axis in range(3):
        others = [dim for dim in (3, 2, 1) if dim != axis + 1]
        layers = solid.any(others[0]).any(others[1])[numbers]
        positions = (cells[:, axis : axis + 1] * BRICK + place)[layers]
        if positions.numel():
            low[axis], high[axis] = int(positions.min()), int(positions.max()) + 1
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
