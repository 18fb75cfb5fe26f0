"""Voxel traversal in plain torch: the definition of what a ray meets, the oracle of the compiled kernel's tests, and
what runs where there is no compiled kernel.

All rays walk in step through one grid after another. A ray crosses an empty brick in one step and anything else voxel
by voxel, in grid coordinates and double precision. A ray that starts exactly on a face is in the voxel it heads into.
The arguments are those of the operators in `tracer.traversal.op`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from gbufrt.specular import DIELECTRIC_F0, schlick
from gbufrt.tree import map_tensors
from tracer.scene.grids import BRICK, HIGH, INDEX, LOW, MASK, MATERIAL, NY, NZ, ORIGIN

SOLID = -1
"""Stands for the medium of a ray that is inside something opaque and has not come out yet."""
TINY = 1e-30
"""What a direction's zero component is taken for, so that no division needs a special case."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Walk:
    """Rays inside one grid. ``axis`` is the last face's axis; ``medium`` a voxel id of the grid, or SOLID."""

    ray: Tensor
    origin: Tensor
    direction: Tensor
    t: Tensor
    t_end: Tensor
    cell: Tensor
    axis: Tensor
    medium: Tensor

    def __getitem__(self, keep: Tensor) -> Walk:
        return map_tensors(lambda x: x[keep], self)

    def at(self, t: Tensor) -> Tensor:
        """Positions in grid coordinates at distance ``t``."""
        return self.origin + self.direction * t[:, None]


class Voxels:
    """One entry of the grids, ready to be looked up."""

    def __init__(self, grids: Sequence[Tensor], entry: int) -> None:
        bricks, self.index, entries, self.media = grids
        self.bricks, self.entry, self.row = bricks.flatten(), entry, entries[entry].tolist()
        self.low, self.high, self.corner = (entries[entry, i : i + 3].long() for i in (LOW, HIGH, ORIGIN))
        self.opaque = self.media[:, 0] >= 1.0

    def look(self, cell: Tensor) -> tuple[Tensor, Tensor]:
        """Voxel ids (n,) at grid cells (n, 3), and whether the whole brick is empty."""
        c, v = cell // BRICK, cell % BRICK
        brick = self.index[self.row[INDEX] + (c[:, 0] * self.row[NY] + c[:, 1]) * self.row[NZ] + c[:, 2]].long()
        place = ((brick.clamp_min(0) * BRICK + v[:, 0]) * BRICK + v[:, 1]) * BRICK + v[:, 2]
        return torch.where(brick > 0, self.bricks[place].long().clamp_min(0), 0), brick <= 0

    def is_opaque(self, value: Tensor) -> Tensor:
        """Whether voxels stop all light."""
        return (value > 0) & self.opaque[(value + self.row[MATERIAL]).clamp_min(0)]


def surface(rays: Sequence[Tensor], grids: Sequence[Tensor], left: Tensor, mask: int) -> tuple[Tensor, Tensor]:
    """See `tracer.traversal.op.surface`."""
    count, nearest = len(rays[0]), rays[2][:, 1].double()
    numbers = rays[0].new_zeros(count, 4, dtype=torch.float32)
    ids = rays[0].new_zeros(count, 7, dtype=torch.int32)
    numbers[:, 0], ids[:, 1] = torch.inf, -1
    for entry in _seen(grids, mask):
        voxels = Voxels(grids, entry)
        walk = _enter(voxels, rays, rays[2][:, 0].double(), nearest)
        silent = torch.zeros_like(walk.ray, dtype=torch.bool)
        if len(left):
            start = left.long()[walk.ray]
            silent = start[:, 1] == entry
            walk = replace(
                walk,
                medium=torch.where(silent, start[:, 0] - voxels.row[MATERIAL], walk.medium),
                cell=torch.where(silent[:, None], start[:, 2:] - voxels.corner, walk.cell),
            )
        _first_surface(voxels, walk, silent, numbers, ids, nearest)
    return numbers, ids


def transmit(rays: Sequence[Tensor], grids: Sequence[Tensor], mask: int) -> Tensor:
    """See `tracer.traversal.op.transmit`."""
    passed = rays[0].new_ones(len(rays[0]), 3, dtype=torch.float32)
    for entry in _seen(grids, mask):
        voxels = Voxels(grids, entry)
        walk = _enter(voxels, rays, *rays[2].double().unbind(1))
        within = walk.medium != 0  # begins in what it is about to leave, by a face that is still to come
        walk = replace(walk, medium=torch.where(within, walk.medium, 0))
        began = walk.t.clone()
        while walk.ray.numel():
            value, empty = voxels.look(walk.cell)
            passed[walk.ray[voxels.is_opaque(value)]] = 0.0
            changed = value != walk.medium
            length = walk.t - began
            _attenuate(voxels, passed, walk[changed], length[changed])
            _enter_face(passed, walk[changed & ((value > 0) | within)])
            began, within = torch.where(changed, walk.t, began), within & ~changed
            walk, inside = _step(voxels, replace(walk, medium=value), empty)
            over = ~inside | (walk.t >= walk.t_end)
            length = torch.minimum(walk.t, walk.t_end) - began
            _attenuate(voxels, passed, walk[over], length[over])
            _enter_face(passed, walk[within & ~inside & (walk.t < walk.t_end)])
            going = ~over & (passed[walk.ray].amax(1) > 0)
            walk, began, within = walk[going], began[going], within[going]
    return passed


def runs(rays: Sequence[Tensor], grids: Sequence[Tensor], starts: Tensor) -> Tensor:
    """See `tracer.traversal.op.runs`."""
    lengths = rays[0].new_zeros(len(starts), 2, dtype=torch.float32)
    t0, t1 = rays[2].double().unbind(1)
    for entry in range(len(grids[2])):
        voxels = Voxels(grids, entry)
        walk = _enter(voxels, rays, torch.zeros_like(t0), t1)
        walk = walk[starts[walk.ray, 1] == entry]
        start = starts.long()[walk.ray]
        medium, cell = start[:, 0] - voxels.row[MATERIAL], start[:, 2:] - voxels.corner
        walk = replace(walk, t=t0[walk.ray], cell=cell, medium=medium)
        same = torch.ones_like(walk.ray, dtype=torch.bool)
        while walk.ray.numel():
            value, empty = voxels.look(walk.cell)
            same = same & (value == walk.medium)
            solid = value > 0
            walk, same, empty = walk[solid], same[solid], empty[solid]
            walk, inside = _step(voxels, walk, empty)
            length = (torch.minimum(walk.t, walk.t_end) - t0[walk.ray]).clamp_min(0).float()
            lengths[walk.ray, 0] = length
            lengths[walk.ray[same], 1] = length[same]
            going = inside & (walk.t < walk.t_end)
            walk, same = walk[going], same[going]
    return lengths


def _seen(grids: Sequence[Tensor], mask: int) -> list[int]:
    return [entry for entry, own in enumerate(grids[2][:, MASK].tolist()) if own & mask]


def _enter(voxels: Voxels, rays: Sequence[Tensor], t_min: Tensor, t_max: Tensor) -> Walk:
    """The rays that meet the grid's bounds, at the place where they do."""
    origins, directions, _, transforms = rays
    matrix = transforms[:, voxels.entry]
    rotation, offset, each = matrix[..., :3], matrix[:, None, :, 3], (len(matrix), -1, 3)
    origin = torch.einsum("bij,bnj->bni", rotation, origins.double().view(each)) + offset
    direction = torch.einsum("bij,bnj->bni", rotation, directions.double().view(each))
    origin, direction = origin.reshape(-1, 3), direction.reshape(-1, 3)
    direction = torch.where(direction.abs() < TINY, TINY, direction)
    inverse = 1 / direction
    near, far = (voxels.low - origin) * inverse, (voxels.high - origin) * inverse
    near, far = torch.minimum(near, far), torch.maximum(near, far)
    enter, axis = near.max(dim=1)
    t = torch.maximum(enter, t_min)
    meets = (t < far.amin(1)) & (t < t_max) & origin.isfinite().all(1) & direction.isfinite().all(1)
    ray = meets.nonzero()[:, 0]
    place = origin + direction * t[:, None]
    cell = torch.where((direction < 0) & (place == place.floor()), place - 1, place.floor())[ray]
    cell = torch.minimum(torch.maximum(cell.long(), voxels.low), voxels.high - 1)
    walk = Walk(
        ray=ray, origin=origin[ray], direction=direction[ray], t=t[ray], t_end=t_max[ray], cell=cell, axis=axis[ray],
        medium=torch.zeros_like(ray),
    )  # fmt: skip
    value, _ = voxels.look(walk.cell)
    within = torch.where(voxels.is_opaque(value), SOLID, value)
    return replace(walk, medium=torch.where(enter[ray] > t_min[ray], 0, within))


def _first_surface(voxels: Voxels, walk: Walk, silent: Tensor, numbers: Tensor, ids: Tensor, nearest: Tensor) -> None:
    """Walk on to where the medium changes, and write what is there into the rows of the rays."""
    while walk.ray.numel():
        value, empty = voxels.look(walk.cell)
        out = (walk.medium == SOLID) & ~voxels.is_opaque(value)
        out = out | (silent & (walk.medium > 0) & (value == 0))
        medium = torch.where(out, value, walk.medium)
        stops = (value != medium) & (medium != SOLID)
        _write(voxels, walk[stops], value[stops], numbers, ids, nearest)
        walk, silent, empty = replace(walk, medium=medium)[~stops], silent[~stops], empty[~stops]
        walk, inside = _step(voxels, walk, empty)
        before_end = walk.t < walk.t_end
        leaves = ~inside & before_end & (walk.medium > 0) & ~silent
        _write(voxels, walk[leaves], torch.zeros_like(walk.ray[leaves]), numbers, ids, nearest)
        walk, silent = walk[inside & before_end], silent[inside & before_end]


def _step(voxels: Voxels, walk: Walk, empty: Tensor) -> tuple[Walk, Tensor]:
    """Leave the voxel, or the whole brick where it is empty; and whether that is still within the grid's bounds."""
    size = torch.where(empty, BRICK, 1)[:, None]
    low = torch.div(walk.cell, size, rounding_mode="floor") * size
    forward = walk.direction > 0
    t, axis = ((torch.where(forward, low + size, low) - walk.origin) * (1 / walk.direction)).min(dim=1)
    beside = torch.minimum(torch.maximum(walk.at(t).floor().long(), low), low + size - 1)
    through = torch.nn.functional.one_hot(axis, 3).bool()
    cell = torch.where(through, torch.where(forward, low + size, low - 1), beside)
    inside = ((cell >= voxels.low) & (cell < voxels.high)).all(dim=1)
    return replace(walk, t=t, axis=axis, cell=cell), inside


def _write(voxels: Voxels, walk: Walk, value: Tensor, numbers: Tensor, ids: Tensor, nearest: Tensor) -> None:
    """Store hits. Where ``value`` is air, the surface is the back of the medium that the ray leaves."""
    back = value == 0
    falling = walk.direction.gather(1, walk.axis[:, None])[:, 0] < 0
    through = torch.nn.functional.one_hot(walk.axis, 3)
    behind = torch.where(falling, -1, 1)[:, None] * through
    cell = torch.where(back[:, None], walk.cell - behind, walk.cell)
    material = torch.where(back, walk.medium, value) + voxels.row[MATERIAL]
    face = walk.axis * 2 + falling
    row: list[Any] = [material, torch.full_like(material, voxels.entry), face, back]
    numbers[walk.ray] = torch.cat([walk.t[:, None], walk.at(walk.t) + voxels.corner], dim=1).float()
    ids[walk.ray] = torch.cat([torch.stack(row, dim=1), cell + voxels.corner], dim=1).int()
    nearest[walk.ray] = walk.t


def _attenuate(voxels: Voxels, passed: Tensor, walk: Walk, length: Tensor) -> None:
    """Multiply the light of rays by what comes through ``length`` of the medium that they are in."""
    row = voxels.media[(walk.medium + voxels.row[MATERIAL]).clamp_min(0)].double()
    factor = (1 - row[:, :1]) * row[:, 1:] ** length.clamp_min(0)[:, None]
    passed[walk.ray] *= torch.where(walk.medium[:, None] > 0, factor, 1.0).float()


def _enter_face(passed: Tensor, walk: Walk) -> None:
    """Multiply the light of rays by what the dielectric face that they go through does not mirror."""
    along = walk.direction.gather(1, walk.axis[:, None])[:, 0].abs() / walk.direction.norm(dim=1)
    passed[walk.ray] *= (1 - schlick(along, DIELECTRIC_F0))[:, None].float()
