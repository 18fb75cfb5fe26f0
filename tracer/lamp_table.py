"""One lamp for each point: chosen by what lamps may give in its part of the world."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from tracer.emitters import Lamps

CELL = 8.0  # world units a side of the cells that share a choice of lamps, doubled until there are few cells
MANY = 1 << 13
SLOTS = 128  # of a cell, handed out to the lamps in proportion
SPREAD = 0.1  # share of the choices that are made by power alone, so that no lamp is forgotten
BLOCK = 1 << 20  # cells times rectangles at a time


@dataclass(frozen=True, eq=False, kw_only=True)
class LampTable:
    """The shining rectangles of a scene, flat, and for every cell of a coarse grid which of them to sample how often.

    Args:
        corner: ``(R, 3)``; see `tracer.emitters.Lamps`.
        edge_u: ``(R, 3)``.
        edge_v: ``(R, 3)``.
        outward: ``(R, 3)`` to the side that shines, as long as the rectangle's area.
        radiance: ``(R, 3)``.
        slots: ``(X * Y * Z, SLOTS)`` int32 rectangles, in rising order.
        counts: ``(X * Y * Z, SLOTS)`` int16: how many slots of the cell hold the same rectangle.
        shape: ``(X, Y, Z)`` of the grid.
        low: ``(3,)`` its low corner, world space.
        cell: side of its cells.
        power: ``(R,)`` share of each rectangle in the power of all.
    """

    corner: Tensor
    edge_u: Tensor
    edge_v: Tensor
    outward: Tensor
    radiance: Tensor
    slots: Tensor
    counts: Tensor
    shape: tuple[int, int, int]
    low: Tensor
    cell: float
    power: Tensor

    def __len__(self) -> int:
        return len(self.corner)

    @staticmethod
    def of(lamps: Lamps, low: tuple[int, int, int], high: tuple[int, int, int]) -> LampTable:
        """The table over a box; points outside use its nearest cell."""
        used = lamps.edge_u.abs().sum(dim=2) > 0
        corner, edge_u, edge_v = lamps.corner[used], lamps.edge_u[used], lamps.edge_v[used]
        radiance = lamps.radiance[:, None].expand(-1, used.shape[1], -1)[used]
        outward = torch.linalg.cross(edge_u, edge_v)
        power = outward.norm(dim=1) * radiance.mean(dim=1)
        cell = CELL
        while True:
            shape = tuple(max(1, -int(-(b - a) // cell)) for a, b in zip(low, high, strict=True))
            if shape[0] * shape[1] * shape[2] <= MANY:
                break
            cell *= 2
        table = LampTable(
            corner=corner,
            edge_u=edge_u,
            edge_v=edge_v,
            outward=outward,
            radiance=radiance,
            slots=torch.zeros(0, SLOTS, dtype=torch.int32, device=corner.device),
            counts=torch.zeros(0, SLOTS, dtype=torch.int16, device=corner.device),
            shape=(shape[0], shape[1], shape[2]),
            low=torch.tensor(low, dtype=torch.float32, device=corner.device),
            cell=cell,
            power=power / power.sum().clamp_min(1e-30),
        )
        return table if not len(table) else table.with_slots()

    def moved(self, lamps: Lamps) -> LampTable:
        """The same choices among the same lamps in other places."""
        used = lamps.edge_u.abs().sum(dim=2) > 0
        corner, edge_u, edge_v = lamps.corner[used], lamps.edge_u[used], lamps.edge_v[used]
        outward = torch.linalg.cross(edge_u, edge_v)
        return replace(self, corner=corner, edge_u=edge_u, edge_v=edge_v, outward=outward)

    def with_slots(self) -> LampTable:
        """The same with its slots filled."""
        axes = [torch.arange(n, device=self.corner.device) for n in self.shape]
        cells = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3)
        centers = self.low + (cells + 0.5) * self.cell
        step = max(1, BLOCK // len(self))
        slots = torch.cat([self._slots_of(part) for part in centers.split(step)])
        counts = torch.searchsorted(slots, slots, right=True) - torch.searchsorted(slots, slots)
        return replace(self, slots=slots, counts=counts.to(torch.int16))

    def _slots_of(self, centers: Tensor) -> Tensor:
        """``(C, SLOTS)``: rectangles in proportion to the most that they may give anywhere in a cell."""
        reach = self.cell * 3**0.5 / 2
        middle = self.corner + (self.edge_u + self.edge_v) / 2
        square = torch.cdist(centers, middle).square()
        height = centers @ self.outward.T - (self.corner * self.outward).sum(dim=1)
        area = self.outward.norm(dim=1).clamp_min(1e-20)
        height = height / area + reach  # of the highest point of the cell's sphere over the rectangle's plane
        leaning = (height / (square.sqrt() + reach)).clamp(0.0, 1.0)
        given = leaning * self.power / (square + reach * reach / 4)
        upto = given.cumsum(dim=1)
        total = upto[:, -1:].clamp_min(1e-30)
        place = (torch.arange(SLOTS, device=centers.device) + 0.5) / SLOTS * total
        return torch.searchsorted(upto, place).clamp_max(len(self) - 1).int()

    def choose(self, points: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        """One rectangle for each point.

        Args:
            points: ``(N, 3)`` world space.
            u: ``(N,)`` in [0, 1).

        Returns:
            Its number ``(N,)`` and the probability ``(N,)`` of that choice.
        """
        limit = torch.tensor(self.shape, device=points.device) - 1
        cell = ((points - self.low) / self.cell).long().clamp_min(0).minimum(limit)
        number = (cell[:, 0] * self.shape[1] + cell[:, 1]) * self.shape[2] + cell[:, 2]
        place = ((u - SPREAD) / (1 - SPREAD) * SLOTS).long().clamp(0, SLOTS - 1) + number * SLOTS
        chosen, count = self.slots.flatten()[place].long(), self.counts.flatten()[place].float()
        spread = (u < SPREAD).nonzero()[:, 0]
        every = torch.searchsorted(self.power.cumsum(0), u[spread] / SPREAD).clamp_max(len(self) - 1)
        chosen[spread] = every
        count[spread] = (self.slots[number[spread]] == every[:, None]).sum(dim=1).float()
        return chosen, SPREAD * self.power[chosen] + (1 - SPREAD) / SLOTS * count
