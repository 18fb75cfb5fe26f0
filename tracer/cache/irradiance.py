"""A cache of irradiance on the faces of voxels: what paths of the last frames found, for those of this one to read."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from gbufrt.luminance import luminance
from tracer.cache.cells import SIDES, cells
from tracer.cache.changes import Batch, segments, unchanged

CAPACITY = 1 << 18
KEPT = 0.82  # share of a cell's weight left after a frame: what is eight frames old counts a fifth
LEAST = 4.0  # samples that a coarse cell must have to be read
PRIOR = 16.0  # samples that it may add to those of a fine cell


@dataclass(frozen=True, eq=False, kw_only=True)
class IrradianceCache:
    """Mean light that arrives at cells, which are faces of voxels and of cubes of four voxels a side.

    A value: `update` returns another cache. It depends on the order of nothing, so equal frames give equal caches.

    Args:
        keys: ``(N,)`` int64, ascending: level, face and place of each cell.
        radiance: ``(N, 3)`` mean of what arrives from a cosine-weighted direction, linear radiance: irradiance / pi.
        weight: ``(N,)`` samples in that mean, older ones counting less.
        age: ``(N,)`` int32, frames since the last sample.
        capacity: most cells; those without a sample for longest make way.
    """

    keys: Tensor
    radiance: Tensor
    weight: Tensor
    age: Tensor
    capacity: int = CAPACITY

    @staticmethod
    def empty(*, capacity: int = CAPACITY, device: torch.device | str = "cpu") -> IrradianceCache:
        """A cache that knows nothing.

        Raises:
            ValueError: capacity is below 1.
        """
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1 cell, got {capacity}")
        floats = torch.zeros(0, 3, device=device)
        keys = torch.zeros(0, dtype=torch.int64, device=device)
        return IrradianceCache(keys=keys, radiance=floats, weight=floats[:, 0], age=keys.int(), capacity=capacity)

    def update(self, positions: Tensor, normals: Tensor, radiance: Tensor) -> IrradianceCache:
        """The cache a frame later.

        The mean of a cell counts what it held before by `KEPT` for each frame since, so that a cell which many paths
        meet forgets in eight frames, and one that none meets keeps what it knew. Cells whose light is seen to change
        forget at once, this frame's samples included, because these still hold what the cache told them of other cells;
        see `unchanged`. Until they have `LEAST` samples again nothing reads them, and paths go on instead.

        Args:
            positions: ``(N, 3)`` of the samples, world space, a little above their surfaces.
            normals: ``(N, 3)`` of those surfaces.
            radiance: ``(N, 3)`` that arrives there from a cosine-weighted direction; rows that are not finite are
                left out.
        """
        good = torch.isfinite(radiance).all(dim=1)
        positions, normals, radiance = positions[good], normals[good], radiance[good].float()
        found = torch.cat([cells(positions, normals, side, level) for level, side in enumerate(SIDES)])
        keys, cell = torch.unique(torch.cat([self.keys, found]), return_inverse=True)
        old, new = cell[: len(self.keys)], cell[len(self.keys) :]
        frames = torch.zeros_like(keys, dtype=torch.int32)
        frames[old] = self.age + 1
        kept, mean = torch.zeros_like(keys, dtype=torch.float32), torch.zeros(len(keys), 3, device=keys.device)
        kept[old], mean[old] = self.weight, self.radiance
        order = torch.argsort(new, stable=True)  # sums in an order of their own: the same in every run
        count = torch.bincount(new, minlength=len(keys))
        numbers = torch.cat([radiance, luminance(radiance).square()], dim=1)
        sums = segments(numbers.repeat(len(SIDES), 1)[order], count)
        met = count > 0
        earlier = torch.where(met, kept * KEPT ** frames.float(), kept)
        credible = unchanged(keys, mean, earlier, Batch(count=count, total=sums[:, :3], squares=sums[:, 3]))
        mean = mean * earlier[:, None] + sums[:, :3]
        weight = earlier + count
        mean, weight = mean / weight.clamp_min(1e-9)[:, None], weight * credible
        later = replace(self, keys=keys, radiance=mean, weight=weight, age=torch.where(met, 0, frames))
        return later if len(keys) <= self.capacity else later._youngest()

    def look_up(self, positions: Tensor, normals: Tensor) -> tuple[Tensor, Tensor]:
        """What is known of places: the mean of their fine cell, to which the coarse one adds at most `PRIOR` samples.

        Args:
            positions: ``(N, 3)``, see `update`.
            normals: ``(N, 3)``.

        Returns:
            ``(N, 3)`` radiance, and ``(N,)`` bool, where the coarse cell has `LEAST` samples; elsewhere radiance is 0.
        """
        found = [self._cell(cells(positions, normals, side, level)) for level, side in enumerate(SIDES)]
        (fine, own), (coarse, around) = found
        known, more = around >= LEAST, around.clamp_max(PRIOR)
        mean = (fine * own[:, None] + coarse * more[:, None]) / (own + more).clamp_min(1e-9)[:, None]
        return torch.where(known[:, None], mean, 0.0), known

    def _cell(self, wanted: Tensor) -> tuple[Tensor, Tensor]:
        """Radiance and weight of cells by their keys, 0 of those that are not there."""
        if not len(self.keys):
            return self.radiance.new_zeros(len(wanted), 3), self.weight.new_zeros(len(wanted))
        row = torch.searchsorted(self.keys, wanted).clamp_max(len(self.keys) - 1)
        there = self.keys[row] == wanted
        return self.radiance[row] * there[:, None], self.weight[row] * there

    def _youngest(self) -> IrradianceCache:
        rows = torch.argsort(self.age, stable=True)[: self.capacity].sort().values
        return replace(
            self, keys=self.keys[rows], radiance=self.radiance[rows], weight=self.weight[rows], age=self.age[rows]
        )
