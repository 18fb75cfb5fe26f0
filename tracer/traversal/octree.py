"""Octree: the voxels of a world as a tree of cubes, a second form for rays beside the bricks that `trace` follows.

It gives the same hits and is measured by `gbufrt bench --scaling`.

Source: Jonkers 2017 (nodes sorted by Morton code); Laine and Karras 2010 (rays go back up no farther than the node that
two cubes share).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.compute.each import Each
from tracer.scene.grids import BRICK
from tracer.scene.world import World
from tracer.traversal import octree_kernel
from tracer.traversal.hits import Hits
from tracer.traversal.rays import FARTHEST

PART = 256  # bricks whose voxels are sorted at a time
BITS = 4  # of a voxel's place in its brick, along an axis

surface_each = Each(octree_kernel.surface)


@dataclass(frozen=True, eq=False, kw_only=True)
class Octree:
    """The voxels of one world.

    Args:
        nodes: ``(N, 8)`` int32, level by level from the root down, each level in Morton order. A child, in the order of
            x, then y, then z, is 0 where all is air, -id where all voxels have that id, and else the row of its node.
        levels: from the voxels up to the root.
        world: what it was made from.
    """

    nodes: Tensor
    levels: int
    world: World

    @staticmethod
    def of(world: World) -> Octree:
        """The octree of a world; beside its nodes, the codes of some hundred bricks take up to 50 MB."""
        top = int(max(world.index.shape) - 1).bit_length() + BITS
        places = (world.index > 0).nonzero()
        cells, order = morton(places, top - BITS).sort()
        numbers = world.index[tuple(places[order].T)].long()
        place = torch.arange(BRICK, device=world.device)
        within = morton(torch.cartesian_prod(place, place, place), BITS).argsort()
        levels: list[list[Tensor]] = [[] for _ in range(top)]
        codes, values = [cells[:0]], [cells[:0]]
        for part, cell in zip(numbers.split(PART), cells.split(PART), strict=True):
            ids = world.bricks[part].flatten(1)[:, within].long()
            brick, inner = ids.nonzero(as_tuple=True)
            found = _grown(cell[brick] << 3 * BITS | inner, ids[brick, inner], levels, range(BITS))
            codes.append(found[0])
            values.append(found[1])
        _grown(torch.cat(codes), torch.cat(values), levels, range(BITS, top))
        return Octree(nodes=_joined(levels, world.device), levels=top, world=world)

    @property
    def nbytes(self) -> int:
        """Bytes of the nodes."""
        return self.nodes.nbytes

    def trace(
        self, origins: Tensor, directions: Tensor, *, t_min: Tensor | float = 0.0, t_max: Tensor | float = torch.inf
    ) -> Hits:
        """What `tracer.trace` finds in a scene of this world alone. See there for arguments; rays are ``(..., 3)``."""
        shape, grid = origins.shape[:-1], self.world.grid
        rays = [r.detach().float().reshape(-1, 3).contiguous() for r in (origins, directions)]
        count, device = len(rays[0]), origins.device
        ends = [
            torch.as_tensor(t, dtype=torch.float32, device=device).expand(shape).reshape(-1) for t in (t_min, t_max)
        ]
        spans = torch.stack([ends[0], ends[1].clamp_max(FARTHEST)], dim=1)
        corner = torch.tensor(self.world.origin, dtype=torch.float64, device=device)
        matrix = torch.cat([torch.eye(3, dtype=torch.float64, device=device), -corner[:, None]], dim=1)
        row = [0, 0, 0, *grid.index.shape, *grid.low, *grid.high, *self.world.origin]  # as in `Grids.entries`
        box = torch.tensor(row, dtype=torch.int32, device=device)
        materials = self.world.materials
        media = torch.cat([materials.opacity[:, None], materials.tint], dim=1).float().contiguous()
        paths = torch.empty(count, self.levels + 1, dtype=torch.int32, device=device)
        numbers = torch.zeros(count, 4, device=device)
        ids = torch.zeros(count, 7, dtype=torch.int32, device=device)
        surface_each(count, *rays, spans, matrix, self.nodes, box, media, paths, numbers, ids)
        hit, face = ids[:, 1] >= 0, ids[:, 2]
        normal = torch.eye(3, device=device)[face.long() // 2] * (face % 2 * 2 - 1)[:, None]
        return Hits(
            t=numbers[:, 0].reshape(shape),
            hit=hit.reshape(shape),
            material=ids[:, 0].reshape(shape),
            instance=ids[:, 1].clamp_min(0).reshape(shape),
            normal=torch.where(hit[:, None], normal, 0.0).reshape(*shape, 3),
            cell=ids[:, 4:].reshape(*shape, 3),
            local=numbers[:, 1:].reshape(*shape, 3),
            face=face.reshape(shape),
            back_face=(ids[:, 3] > 0).reshape(shape),
        )


def morton(cells: Tensor, bits: int) -> Tensor:
    """``(N,)`` int64: the bits of ``(N, 3)`` coordinates in turn, from the highest; of x, then y, then z."""
    code = torch.zeros_like(cells[:, 0])
    for bit in range(bits):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + 2 - axis)
    return code


def _grown(codes: Tensor, values: Tensor, levels: list[list[Tensor]], steps: range) -> tuple[Tensor, Tensor]:
    """Join cubes to cubes of twice the side, adding nodes to ``levels``; cubes that hold nothing are not among them.

    Args:
        codes: ``(N,)`` sorted Morton codes.
        values: ``(N,)``: the id of all voxels, or -k for the k-th node that was added to the level below.
        levels: parts of each level's nodes, in which mixed children are k.
        steps: which levels.

    Returns:
        The same of the last level.
    """
    for level in steps:
        codes, inner = codes >> 3, codes & 7
        codes, parent, count = codes.unique_consecutive(return_inverse=True, return_counts=True)
        first = values[count.cumsum(0) - count]
        mixed = count < 8
        mixed[parent[values != first[parent]]] = True
        if level == len(levels) - 1:
            mixed[:] = True  # the root is a node in any case
        rank, inside = mixed.cumsum(0) - 1, mixed[parent]
        nodes = torch.zeros(int(mixed.sum()), 8, dtype=torch.int32, device=codes.device)
        nodes[rank[parent][inside], inner[inside]] = -values[inside].int()
        before = sum(len(part) for part in levels[level])
        levels[level].append(nodes)
        values = torch.where(mixed, -(before + rank + 1), first)
    return codes, values


def _joined(levels: list[list[Tensor]], device: torch.device) -> Tensor:
    """All nodes, from the root down, with their children's rows."""
    root = torch.zeros(1, 8, dtype=torch.int32, device=device)
    tables = [torch.cat(parts) if parts else root[:0] for parts in reversed(levels)]
    if not len(tables[0]):
        return root
    rows = 0
    for table in tables:
        rows += len(table)
        table[table > 0] += rows - 1
    return torch.cat(tables)
