"""Canvas: a dense voxel grid with named materials that the parts of a world paint on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, final

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.scene.material import MaterialTable
from tracer.scene.world import World
from tracer.worlds.palette import palette

Int3 = tuple[int, int, int]
AIR: Final = "air"


@final
class Canvas:
    """A grid of voxel ids to paint on; everything that falls outside is cut off.

    Args:
        size: voxels along x, y and z.
        origin: world coordinates of the low corner.
        materials: what may be painted; by default the shared palette.
    """

    def __init__(self, size: Int3, *, origin: Int3 = (0, 0, 0), materials: MaterialTable | None = None) -> None:
        self.materials = materials or palette()
        self.origin = origin
        self.voxels: NDArray[np.int16] = np.zeros(size, np.int16)
        self._ids = {name: i for i, name in enumerate(self.materials.names)}

    def id(self, name: str) -> int:
        """The voxel id of a material."""
        return self._ids[name]

    def ids(self, names: Sequence[str]) -> NDArray[np.int16]:
        """The voxel ids of several materials."""
        return np.array([self._ids[n] for n in names], np.int16)

    def box(self, low: Sequence[float], high: Sequence[float], name: str, *, into_air: bool = False) -> None:
        """Fill world coordinates ``low`` to ``high`` (half open); ``into_air`` fills air only."""
        part = self.voxels[self._slices(low, high)]
        value = self._ids[name]
        if into_air:
            part[part == 0] = value
        else:
            part[...] = value

    def put(self, x: float, y: float, z: float, name: str, *, into_air: bool = False) -> None:
        """Fill one voxel."""
        self.box((x, y, z), (x + 1, y + 1, z + 1), name, into_air=into_air)

    def shell(self, low: Sequence[int], high: Sequence[int], name: str) -> None:
        """The four upright walls of a box, one voxel thick."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        self.box((x0, y0, z0), (x1, y1, z0 + 1), name)
        self.box((x0, y0, z1 - 1), (x1, y1, z1), name)
        self.box((x0, y0, z0), (x0 + 1, y1, z1), name)
        self.box((x1 - 1, y0, z0), (x1, y1, z1), name)

    def stamp(self, low: Sequence[int], ids: NDArray[np.int16], *, into_air: bool = True) -> None:
        """Lay a block of ids with its low corner at ``low``; its air changes nothing."""
        high = [a + n for a, n in zip(low, ids.shape, strict=True)]
        where = self._slices(low, high)
        cut = tuple(slice(s.start + o - a, s.stop + o - a) for s, o, a in zip(where, self.origin, low, strict=True))
        part, new = self.voxels[where], ids[cut]
        mask = (new > 0) & (part == 0) if into_air else new > 0
        part[mask] = new[mask]

    def grid(self, low: Sequence[int], high: Sequence[int]) -> tuple[NDArray[np.int16], list[NDArray[np.float64]]]:
        """The part between two corners, to write into, and the world coordinates of its voxel centres."""
        where = self._slices(low, high)
        axes = [np.arange(s.start, s.stop) + o + 0.5 for s, o in zip(where, self.origin, strict=True)]
        return self.voxels[where], list(np.meshgrid(*axes, indexing="ij", sparse=True))

    def world(self) -> World:
        """The voxels in bricks."""
        return World.from_dense(torch.from_numpy(self.voxels), self.materials, origin=self.origin)

    def _slices(self, low: Sequence[float], high: Sequence[float]) -> tuple[slice, slice, slice]:
        cut = []
        for a, b, o, n in zip(low, high, self.origin, self.voxels.shape, strict=True):
            start, stop = max(int(a) - o, 0), min(int(b) - o, n)
            cut.append(slice(min(start, n), max(stop, min(start, n))))
        return cut[0], cut[1], cut[2]
