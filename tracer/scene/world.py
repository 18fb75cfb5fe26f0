"""World: voxel ids in 16-cubed bricks under an index grid, where empty bricks cost nothing."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gbufrt.compute.resident import resident_on
from gbufrt.numeric import check_kind
from gbufrt.tree import map_tensors
from tracer.scene.grids import BRICK, Grid
from tracer.scene.material import MaterialTable

UNSIGNED = (torch.uint16, torch.uint32, torch.uint64)  # torch stores them, and can do little else with them


@dataclass(frozen=True, eq=False, kw_only=True)
class World:
    """A voxel grid of unit cubes: voxel ``(i, j, k)`` fills world x in [i, i+1], y in [j, j+1], z in [k, k+1].

    Args:
        bricks: ``(N, 16, 16, 16)`` int16 voxel ids in x, y, z order; 0 is air. Brick 0 is all air.
        index: ``(X, Y, Z)`` int32: which brick fills each 16-cubed cell; 0 where it is empty.
        origin: voxel coordinates of the low corner of ``index[0, 0, 0]``.
        materials: what the ids mean.
        prepared: the same voxels in the form that rays traverse, where a `tracer.scene.pool.Pool` keeps both; then
            nothing is checked, since that takes longer than to exchange a few bricks.
        shining: ``(N,)`` bool: bricks that hold what emits light, where that is known.

    Raises:
        ValueError: a shape or an id breaks a rule above.
        TypeError: a tensor is of the wrong integer type.
    """

    bricks: Tensor
    index: Tensor
    origin: tuple[int, int, int]
    materials: MaterialTable
    prepared: Grid | None = None
    shining: Tensor | None = None

    def __post_init__(self) -> None:
        if self.prepared is not None:
            return
        if self.bricks.ndim != 4 or self.bricks.shape[1:] != (BRICK,) * 3 or self.bricks.shape[0] < 1:
            raise ValueError(f"bricks must be (N,16,16,16) with N at least 1, got {tuple(self.bricks.shape)}")
        if self.index.ndim != 3:
            raise ValueError(f"index must be (X,Y,Z), got {tuple(self.index.shape)}")
        if self.bricks.dtype != torch.int16 or self.index.dtype != torch.int32:
            raise TypeError(f"bricks must be int16 and index int32, got {self.bricks.dtype} and {self.index.dtype}")
        if bool(self.bricks[0].any()):
            raise ValueError("bricks[0] must be all air, because index 0 stands for an empty cell")
        _check_ids("bricks", self.bricks, len(self.materials), "the material table")
        _check_ids("index", self.index, len(self.bricks), "the bricks")

    @staticmethod
    def from_dense(
        voxels: Tensor | NDArray[Any], materials: MaterialTable, *, origin: Sequence[int] = (0, 0, 0)
    ) -> World:
        """A world from a dense grid.

        Args:
            voxels: ``(X, Y, Z)`` ids of any integer type, y up; 0 is air.
            materials: what the ids mean.
            origin: voxel coordinates of ``voxels[0, 0, 0]``.

        Raises:
            ValueError: not a 3D grid, or ids outside the material table.
            TypeError: not integers, neither tensor nor array, or materials or origin are of another type.
        """
        voxels = _integers(voxels)
        if voxels.ndim != 3 or voxels.numel() == 0:
            raise ValueError(f"voxels must be (X,Y,Z) with no side of zero, got {tuple(voxels.shape)}")
        if not isinstance(materials, MaterialTable):
            raise TypeError(f"materials must be a MaterialTable, got {type(materials).__name__}; see MaterialTable.of")
        try:
            x, y, z = map(operator.index, origin)
        except (TypeError, ValueError):
            raise TypeError(f"origin must be three integers such as (0, 0, 0), got {type(origin).__name__}") from None
        _check_ids("voxels", voxels, len(materials), "the material table")
        cells = [(n + BRICK - 1) // BRICK for n in voxels.shape]
        padded = torch.zeros([n * BRICK for n in cells], dtype=torch.int16, device=voxels.device)
        padded[tuple(slice(0, n) for n in voxels.shape)] = voxels.to(torch.int16)
        split = padded.view(cells[0], BRICK, cells[1], BRICK, cells[2], BRICK).permute(0, 2, 4, 1, 3, 5)
        blocks = split.reshape(-1, BRICK, BRICK, BRICK)
        filled = blocks.flatten(1).any(dim=1)
        number = torch.where(filled, filled.cumsum(0), 0)
        empty = torch.zeros(1, BRICK, BRICK, BRICK, dtype=torch.int16, device=voxels.device)
        return World(
            bricks=torch.cat([empty, blocks[filled]]).contiguous(),
            index=number.view(*cells).to(torch.int32).contiguous(),
            origin=(x, y, z),
            materials=materials,
        )

    def __repr__(self) -> str:
        """Extent and counts in one line, where the tensors would take pages."""
        low, high = self.bounds()
        bricks, materials = self.bricks.shape[0] - 1, len(self.materials)
        return f"World({low} to {high}, {bricks} bricks, {materials} materials, on {self.device})"

    @cached_property
    def empty(self) -> bool:
        """Whether there is no voxel at all; never so of a world from a pool, to which some may yet come."""
        return self.prepared is None and not bool(self.bricks.any())

    @cached_property
    def grid(self) -> Grid:
        """The voxels in the form that rays traverse."""
        return self.prepared or Grid.of(self.bricks, self.index)

    @property
    def device(self) -> torch.device:
        """The device of the bricks."""
        return self.bricks.device

    def bounds(self) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
        """Low and high corner of the index grid in voxel coordinates."""
        high = tuple(o + n * BRICK for o, n in zip(self.origin, self.index.shape, strict=True))
        return self.origin, (high[0], high[1], high[2])

    def at(self, cells: Tensor) -> Tensor:
        """Voxel ids at integer voxel coordinates.

        Args:
            cells: ``(..., 3)`` integers, world voxel coordinates.

        Returns:
            ``(...)`` int16; 0 outside the grid.
        """
        check_kind(Tensor, "cells", cells)
        if cells.ndim < 1 or cells.shape[-1] != 3:
            raise ValueError(f"cells must be (...,3) voxel coordinates, got {tuple(cells.shape)}")
        local = cells.long() - resident_on(cells.device, self.origin, torch.int64)
        limit = resident_on(cells.device, tuple(n * BRICK for n in self.index.shape), torch.int64)
        within = ((local >= 0) & (local < limit)).all(dim=-1)
        local = torch.where(within[..., None], local, 0)
        cell, inner = local // BRICK, local % BRICK
        brick = self.index[cell[..., 0], cell[..., 1], cell[..., 2]].long()
        ids = self.bricks[brick, inner[..., 0], inner[..., 1], inner[..., 2]]
        return torch.where(within, ids, torch.zeros_like(ids))

    def to(self, *args: Any, **kwargs: Any) -> World:
        """The world on another device; arguments as `torch.Tensor.to`."""
        return map_tensors(lambda t: t.to(*args, **kwargs), self)


def _integers(voxels: Tensor | NDArray[Any]) -> Tensor:
    """Voxels as a tensor of a type that torch can compare."""
    if isinstance(voxels, np.ndarray):
        native = voxels.dtype.newbyteorder("=")
        voxels = torch.from_numpy(np.require(voxels, native, ("C", "W")))
    if not isinstance(voxels, Tensor):
        raise TypeError(f"voxels must be a tensor or a numpy array, got {type(voxels).__name__}")
    if voxels.is_floating_point() or voxels.is_complex() or voxels.dtype == torch.bool:
        raise TypeError(f"voxels must hold integer material ids, got {voxels.dtype}; convert them to int16")
    return voxels.to(torch.int64) if voxels.dtype in UNSIGNED else voxels


def _check_ids(name: str, ids: Tensor, count: int, what: str) -> None:
    if ids.numel() and not 0 <= int(ids.min()) <= int(ids.max()) < count:
        raise ValueError(f"{name} must hold ids in 0..{count - 1}, {what}; got {int(ids.min())}..{int(ids.max())}")
