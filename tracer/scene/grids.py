"""Grids: the voxels of a whole scene as flat arrays, in the form that rays traverse."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from gbufrt.tree import map_tensors
from tracer.scene.material import COLUMNS, MaterialTable

BRICK = 16
REACHES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)  # that are told apart; each at most twice the one before
PART = 1024  # bricks at a time
(MASK, MATERIAL, INDEX, NX, NY, NZ, LOW, HIGH, ORIGIN) = (0, 1, 2, 3, 4, 5, 6, 9, 12)
"""Columns of `Grids.entries`; the last three begin triples."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Grid:
    """One world's voxels; every empty place holds the size of the empty space around it.

    Args:
        bricks: ``(N, 16, 16, 16)`` int16: a voxel id, or -k where the aligned cube of side 2^k around it is empty.
        index: ``(X, Y, Z)`` int32: a brick, or -r, one of `REACHES`, where all bricks fewer than r cells away along
            each axis are empty.
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
        return Grid.over(with_cubes(bricks), layers_of(bricks), index)

    @staticmethod
    def over(coded: Tensor, layers: Tensor, index: Tensor) -> Grid:
        """The grid of bricks as `with_cubes` gives them, of their `layers_of`, and of a world's ``index``."""
        low, high = _occupied(layers, index)
        return Grid(bricks=coded, index=_with_reach(index), low=low, high=high)


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
    """Flatten worlds, the static one first. Bricks, indices and tables that occur twice are stored once."""
    tables: list[MaterialTable] = []
    numbers: dict[int, int] = {}
    stored: dict[tuple[int, ...], int] = {}
    offsets: dict[tuple[int, ...], int] = {}
    bricks, indices, rows, labels = [], [], [], list[str]()
    for world, mask, name in zip(worlds, masks, names, strict=True):
        grid, table = world.grid, world.materials
        columns = [getattr(table, key) for key in COLUMNS]
        same_table = tuple(map(id, [*columns, None if table.textures is None else table.textures.faces]))
        same_voxels = (id(world.bricks), id(world.index))
        if same_table not in offsets:
            offsets[same_table] = len(labels) - 1 if tables else 0
            labels += _labels(table, name, labels) if tables else list(table.names)
            tables.append(table)
        if id(world.bricks) not in numbers:
            numbers[id(world.bricks)] = sum(len(b) for b in bricks)
            bricks.append(grid.bricks)
        if same_voxels not in stored:
            first = numbers[id(world.bricks)]
            stored[same_voxels] = sum(i.numel() for i in indices)
            indices.append(torch.where(grid.index > 0, grid.index + first, grid.index).flatten())
        offset, place = offsets[same_table], stored[same_voxels]
        rows.append([mask, offset, place, *grid.index.shape, *grid.low, *grid.high, *world.origin])
    materials = MaterialTable.joined(tables, labels) if len(tables) > 1 else tables[0]
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


def with_cubes(bricks: Tensor) -> Tensor:
    """Voxel ids, and in empty places the size of the empty cube around them; see `Grid`."""
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
    for before, now in itertools.pairwise((0, *REACHES)):
        if before >= max(index.shape) or bool(filled.all()):
            break
        if before:  # so that bricks fewer than `now` cells away from one that holds something count as filled
            for axis in range(3):
                filled = _widened(filled, axis, now - before)
        reach.add_(~filled, alpha=now - before)
    return torch.where(index > 0, index, -reach.to(torch.int32)).contiguous()


def _widened(filled: Tensor, axis: int, step: int) -> Tensor:
    wider, left = filled.clone(), filled.shape[axis] - step
    if left > 0:
        wider.narrow(axis, step, left).logical_or_(filled.narrow(axis, 0, left))
        wider.narrow(axis, 0, left).logical_or_(filled.narrow(axis, step, left))
    return wider


def layers_of(bricks: Tensor) -> Tensor:
    """``(N, 3, 16)`` bool: which layers of each brick, across x, y and z, hold a voxel."""
    parts = [part > 0 for part in bricks.split(PART)]
    return torch.cat([torch.stack([p.any(3).any(2), p.any(3).any(1), p.any(2).any(1)], dim=1) for p in parts])


def _occupied(layers: Tensor, index: Tensor) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    cells = (index > 0).nonzero()
    low, high = [0, 0, 0], [0, 0, 0]
    numbers = index[tuple(cells.T)].long()
    place = torch.arange(BRICK, device=index.device)
    for axis in range(3):
        positions = (cells[:, axis : axis + 1] * BRICK + place)[layers[numbers, axis]]
        if positions.numel():
            low[axis], high[axis] = int(positions.min()), int(positions.max()) + 1
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
