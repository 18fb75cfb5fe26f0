"""A pool of bricks for worlds whose parts come and go: what stays keeps its place in memory."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from tracer.scene.grids import BRICK, Grid, layers_of, with_cubes
from tracer.scene.material import MaterialTable
from tracer.scene.world import World

Key = Hashable


@final
class Pool:
    """Bricks by their keys, both as voxel ids and in the form that rays traverse.

    A brick is stored once for all who take it, and its place is free again when all of them have given it back. The
    pool grows to what is held at once, by doubling, and never shrinks.

    Args:
        device: where the bricks lie.
    """

    def __init__(self, device: torch.device | str = "cpu") -> None:
        self._bricks = torch.zeros(1, BRICK, BRICK, BRICK, dtype=torch.int16, device=device)
        self._coded = with_cubes(self._bricks)
        self._layers = layers_of(self._bricks)
        self._shining = torch.zeros(1, dtype=torch.bool, device=device)
        self._free: list[int] = []
        self._places: dict[Key, int] = {}
        self._takers: dict[Key, int] = {}

    def __len__(self) -> int:
        """How many bricks are held."""
        return len(self._places)

    @property
    def capacity(self) -> int:
        """How many bricks there is memory for; the first one is air."""
        return len(self._bricks)

    def take(self, keys: Sequence[Key], make: Callable[[list[int]], NDArray[np.int16]], emits: Tensor) -> list[int]:
        """The places of bricks, to be given back as often as they are taken.

        Args:
            keys: of the bricks.
            make: gives the voxel ids ``(N, 16, 16, 16)`` of those that are not held yet, by their positions in
                ``keys``.
            emits: ``(M,)`` bool: which voxel ids emit light.
        """
        fresh: dict[Key, int] = {}
        for n, key in enumerate(keys):
            self._takers[key] = self._takers.get(key, 0) + 1
            if key not in self._places:
                fresh.setdefault(key, n)
        if fresh:
            self._reserve(len(fresh))
            places = [self._free.pop() for _ in fresh]
            self._write(places, torch.from_numpy(make(list(fresh.values()))), emits)
            self._places.update(zip(fresh, places, strict=True))
        return [self._places[key] for key in keys]

    def give(self, keys: Sequence[Key]) -> None:
        """Give bricks back."""
        for key in keys:
            self._takers[key] -= 1
            if not self._takers[key]:
                del self._takers[key]
                self._free.append(self._places.pop(key))

    def world(self, index: NDArray[np.int32], origin: tuple[int, int, int], materials: MaterialTable) -> World:
        """A world of bricks of the pool, right until one of them is given back.

        Args:
            index: ``(X, Y, Z)`` places of bricks; 0 where there is none.
            origin: voxel coordinates of its low corner.
            materials: what the voxel ids mean.
        """
        where = torch.from_numpy(index).to(self._bricks.device)
        return World(
            bricks=self._bricks,
            index=where,
            origin=origin,
            materials=materials.to(self._bricks.device),
            prepared=Grid.over(self._coded, self._layers, where),
            shining=self._shining,
        )

    def _write(self, places: list[int], ids: Tensor, emits: Tensor) -> None:
        at = torch.tensor(places, device=self._bricks.device)
        ids = ids.to(self._bricks.device)
        self._bricks[at], self._coded[at], self._layers[at] = ids, with_cubes(ids), layers_of(ids)
        self._shining[at] = emits.to(ids.device)[ids.long()].flatten(1).any(dim=1)

    def _reserve(self, count: int) -> None:
        if count <= len(self._free):
            return
        old = self.capacity
        more = max(old, count - len(self._free))
        for name in ("_bricks", "_coded", "_layers", "_shining"):
            tensor = getattr(self, name)
            setattr(self, name, torch.cat([tensor, tensor.new_zeros(more, *tensor.shape[1:])]))
        self._free = [*range(old + more - 1, old - 1, -1), *self._free]
