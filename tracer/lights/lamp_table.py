"""The choice of one lamp for each point, by what lamps can contribute in its cell of the world."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from gbufrt.compute.resident import numbers, places
from tracer.lights.emitters import Lamps

CELL = 8.0  # side of the cells that share a choice of lamps, world units; doubled until there are few cells
MANY = 1 << 13
SLOTS = 128  # per cell, assigned to lamps in proportion to what they contribute
SPREAD = 0.1  # share of the choices made by power alone, so that every lamp can be chosen
CANDIDATES = 8  # drawn for each point from its cell's slots; one of them is chosen
BLOCK = 1 << 20  # cells times rectangles at a time


@dataclass(frozen=True, eq=False, kw_only=True)
class LampTable:
    """The emitting rectangles of a scene, flat, and how often each is sampled in each cell of a coarse grid.

    Args:
        corner: ``(R, 3)``; see `tracer.lights.emitters.Lamps`.
        edge_u: ``(R, 3)``.
        edge_v: ``(R, 3)``.
        facing: ``(R, 3)`` unit normal on the emitting side.
        area: ``(R,)``.
        radiance: ``(R, 3)``.
        slots: ``(X * Y * Z, SLOTS)`` int32 rectangles, in ascending order.
        counts: ``(X * Y * Z, SLOTS)`` int16: how many slots of the cell hold the same rectangle.
        shape: ``(X, Y, Z)`` of the grid.
        low: ``(3,)`` its low corner, world space.
        cell: side of its cells.
        power: ``(R,)`` share of each rectangle in the total power.
    """

    corner: Tensor
    edge_u: Tensor
    edge_v: Tensor
    facing: Tensor
    area: Tensor
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
        """The table over a box; points outside use its nearest cell.

        On a GPU it has room for as many rectangles of each lamp as one has; those that are none come last.
        """
        used = _used(lamps)
        radiance = lamps.radiance[:, None].expand(-1, lamps.corner.shape[1], -1)[used]
        rectangles = _rectangles(lamps, used)
        corner = rectangles["corner"]
        power = rectangles["area"] * radiance.mean(dim=1)
        cell = CELL
        while True:
            shape = tuple(max(1, -int(-(b - a) // cell)) for a, b in zip(low, high, strict=True))
            if shape[0] * shape[1] * shape[2] <= MANY:
                break
            cell *= 2
        table = LampTable(
            **rectangles,
            radiance=radiance,
            slots=torch.zeros(0, SLOTS, dtype=torch.int32, device=corner.device),
            counts=torch.zeros(0, SLOTS, dtype=torch.int16, device=corner.device),
            shape=(shape[0], shape[1], shape[2]),
            low=numbers((low,), corner.float())[0],
            cell=cell,
            power=power / power.sum().clamp_min(1e-30),
        )
        return table if not len(table) else table.with_slots()

    def moved(self, lamps: Lamps) -> LampTable:
        """The same table with the lamps in other places; the probabilities stay."""
        return replace(self, **_rectangles(lamps, _used(lamps)))

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
        """``(C, SLOTS)``: rectangles in proportion to the most that they can contribute anywhere in a cell."""
        reach = self.cell * 3**0.5 / 2
        middle = self.corner + (self.edge_u + self.edge_v) / 2
        square = torch.cdist(centers, middle).square()
        height = centers @ self.facing.T - (self.corner * self.facing).sum(dim=1)
        height = height + reach  # of the highest point of the cell's sphere over the rectangle's plane
        leaning = (height / (square.sqrt() + reach)).clamp(0.0, 1.0)
        given = leaning * self.power / (square + reach * reach / 4)
        upto = given.cumsum(dim=1)
        total = upto[:, -1:].clamp_min(1e-30)
        place = (torch.arange(SLOTS, device=centers.device) + 0.5) / SLOTS * total
        return torch.searchsorted(upto, place).clamp_max(len(self) - 1).int()

    def choose(self, points: Tensor, normals: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        """One rectangle for each point, drawn from a few of its cell in proportion to its rough contribution here.

        Args:
            points: ``(N, 3)`` world space.
            normals: ``(N, 3)`` unit length: light from below does not count.
            u: ``(2, N)`` in [0, 1).

        Returns:
            Its number ``(N,)``; and ``(N,)`` the factor that its light is multiplied by, 0 where none contributes.

        Source: Talbot, Cline and Egbert 2005 (resampled importance sampling).
        """
        steps = torch.arange(CANDIDATES, device=u.device)[:, None] / CANDIDATES
        candidates, chance = self._suggest(points.repeat(CANDIDATES, 1), ((u[:1] + steps) % 1.0).flatten())
        given = self._given(points, normals, candidates.view(CANDIDATES, -1))
        weight = given / chance.view(CANDIDATES, -1)
        upto = weight.cumsum(dim=0)
        which = (u[1] * upto[-1] >= upto).sum(dim=0).clamp_max(CANDIDATES - 1)[None]
        chosen, own = candidates.view(CANDIDATES, -1).gather(0, which)[0], given.gather(0, which)[0]
        return chosen, torch.where(own > 0, upto[-1] / (CANDIDATES * own.clamp_min(1e-30)), 0.0)

    def _suggest(self, points: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        """A rectangle ``(N,)`` for each point, drawn from its cell's slots, and its probability ``(N,)``."""
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

    def _given(self, points: Tensor, normals: Tensor, candidates: Tensor) -> Tensor:
        """``(K, N)``: rough unoccluded contribution of rectangles ``(K, N)``; zero only where there is none.

        A rectangle counts as if all of it were at its middle. Where the middle is below the surface's horizon, the
        highest point of its bounding sphere still counts.
        """
        way = (self.corner + (self.edge_u + self.edge_v) / 2)[candidates] - points
        facing = self.facing[candidates]
        square = way[..., 0] ** 2 + way[..., 1] ** 2 + way[..., 2] ** 2
        above = -(way[..., 0] * facing[..., 0] + way[..., 1] * facing[..., 1] + way[..., 2] * facing[..., 2])
        rise = way[..., 0] * normals[:, 0] + way[..., 1] * normals[:, 1] + way[..., 2] * normals[:, 2]
        reach = ((self.edge_u + self.edge_v).norm(dim=1) / 2)[candidates]
        rise = torch.maximum(rise, (rise + reach) / 4).clamp_min(0)
        near = reach * reach / 4  # limits the growth at close range
        return self.power[candidates] * above.clamp_min(0) * rise / (square + near).square()


def _used(lamps: Lamps) -> tuple[Tensor, ...]:
    """Where lamps have rectangles."""
    return places(lamps.edge_u.abs().sum(dim=2) > 0)


def _rectangles(lamps: Lamps, used: tuple[Tensor, ...]) -> dict[str, Tensor]:
    """Corner, edges, normal and area of all rectangles."""
    corner, edge_u, edge_v = lamps.corner[used], lamps.edge_u[used], lamps.edge_v[used]
    outward = torch.linalg.cross(edge_u, edge_v)
    area = outward.norm(dim=1)
    facing = outward / area.clamp_min(1e-20)[:, None]
    return {"corner": corner, "edge_u": edge_u, "edge_v": edge_v, "facing": facing, "area": area}
