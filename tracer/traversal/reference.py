"""Voxel traversal in plain torch: it defines what a ray hits, is the reference in the kernel's tests, and runs where
there is no compiled kernel.

All rays advance in lockstep through one grid after another. A ray crosses an empty brick in one step and anything else
voxel by voxel, in grid coordinates and double precision. A ray that starts exactly on a face is in the voxel it heads
into. The arguments are those of the operators in `tracer.traversal.op`.
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
"""The medium of a ray that began inside something opaque and has not left it yet."""
TINY = 1e-30
"""Replaces a direction's zero component, so that no division needs a special case."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Traversal:
    """Rays inside one grid. ``axis`` is the last face's axis; ``medium`` a voxel id of the grid, or SOLID."""

    ray: Tensor
    origin: Tensor
    direction: Tensor
    t: Tensor
    t_end: Tensor
    cell: Tensor
    axis: Tensor
    medium: Tensor

    def __getitem__(self, keep: Tensor) -> Traversal:
        return map_tensors(lambda x: x[keep], self)

    def at(self, t: Tensor) -> Tensor:
        """Positions in grid coordinates at distance ``t``."""
        return self.origin + self.direction * t[:, None]


class Voxels:
    """One entry of the grids, ready for look-ups."""

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
        """Whether voxels block all light."""
        return (value > 0) & self.opaque[(value + self.row[MATERIAL]).clamp_min(0)]


def surface(rays: Sequence[Tensor], grids: Sequence[Tensor], left: Tensor, mask: int) -> tuple[Tensor, Tensor]:
    """See `tracer.traversal.op.surface`."""
    count, nearest = len(rays[0]), rays[2][:, 1].double()
    numbers = rays[0].new_zeros(count, 4, dtype=torch.float32)
    ids = rays[0].new_zeros(count, 7, dtype=torch.int32)
    numbers[:, 0], ids[:, 1] = torch.inf, -1
    for entry in _seen(grids, mask):
        voxels = Voxels(grids, entry)
        state = _enter(voxels, rays, rays[2][:, 0].double(), nearest)
        silent = torch.zeros_like(state.ray, dtype=torch.bool)
        if len(left):
            start = left.long()[state.ray]
            silent = start[:, 1] == entry
            state = replace(
                state,
                medium=torch.where(silent, start[:, 0] - voxels.row[MATERIAL], state.medium),
                cell=torch.where(silent[:, None], start[:, 2:] - voxels.corner, state.cell),
            )
        _first_surface(voxels, state, silent, numbers, ids, nearest)
    return numbers, ids


def transmit(rays: Sequence[Tensor], grids: Sequence[Tensor], mask: int) -> Tensor:
    """See `tracer.traversal.op.transmit`."""
    passed = rays[0].new_ones(len(rays[0]), 3, dtype=torch.float32)
    for entry in _seen(grids, mask):
        voxels = Voxels(grids, entry)
        state = _enter(voxels, rays, *rays[2].double().unbind(1))
        within = state.medium != 0  # begins inside a medium whose exit face is still ahead
        state = replace(state, medium=torch.where(within, state.medium, 0))
        began = state.t.clone()
        while state.ray.numel():
            value, empty = voxels.look(state.cell)
            passed[state.ray[voxels.is_opaque(value)]] = 0.0
            changed = value != state.medium
            length = state.t - began
            _attenuate(voxels, passed, state[changed], length[changed])
            _enter_face(passed, state[changed & ((value > 0) | within)])
            began, within = torch.where(changed, state.t, began), within & ~changed
            state, inside = _step(voxels, replace(state, medium=value), empty)
            over = ~inside | (state.t >= state.t_end)
            length = torch.minimum(state.t, state.t_end) - began
            _attenuate(voxels, passed, state[over], length[over])
            _enter_face(passed, state[within & ~inside & (state.t < state.t_end)])
            going = ~over & (passed[state.ray].amax(1) > 0)
            state, began, within = state[going], began[going], within[going]
    return passed


def runs(rays: Sequence[Tensor], grids: Sequence[Tensor], starts: Tensor) -> Tensor:
    """See `tracer.traversal.op.runs`."""
    lengths = rays[0].new_zeros(len(starts), 2, dtype=torch.float32)
    t0, t1 = rays[2].double().unbind(1)
    for entry in range(len(grids[2])):
        voxels = Voxels(grids, entry)
        state = _enter(voxels, rays, torch.zeros_like(t0), t1)
        state = state[starts[state.ray, 1] == entry]
        start = starts.long()[state.ray]
        medium, cell = start[:, 0] - voxels.row[MATERIAL], start[:, 2:] - voxels.corner
        state = replace(state, t=t0[state.ray], cell=cell, medium=medium)
        same = torch.ones_like(state.ray, dtype=torch.bool)
        while state.ray.numel():
            value, empty = voxels.look(state.cell)
            same = same & (value == state.medium)
            solid = value > 0
            state, same, empty = state[solid], same[solid], empty[solid]
            state, inside = _step(voxels, state, empty)
            length = (torch.minimum(state.t, state.t_end) - t0[state.ray]).clamp_min(0).float()
            lengths[state.ray, 0] = length
            lengths[state.ray[same], 1] = length[same]
            going = inside & (state.t < state.t_end)
            state, same = state[going], same[going]
    return lengths


def _seen(grids: Sequence[Tensor], mask: int) -> list[int]:
    return [entry for entry, own in enumerate(grids[2][:, MASK].tolist()) if own & mask]


def _enter(voxels: Voxels, rays: Sequence[Tensor], t_min: Tensor, t_max: Tensor) -> Traversal:
    """The rays that intersect the grid's bounds, at the point of entry."""
    origins, directions, _, transforms = rays
    matrix = transforms[:, voxels.entry, :3]
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
    enters = (t < far.amin(1)) & (t < t_max) & origin.isfinite().all(1) & direction.isfinite().all(1)
    ray = enters.nonzero()[:, 0]
    place = origin + direction * t[:, None]
    cell = torch.where((direction < 0) & (place == place.floor()), place - 1, place.floor())[ray]
    cell = torch.minimum(torch.maximum(cell.long(), voxels.low), voxels.high - 1)
    state = Traversal(
        ray=ray, origin=origin[ray], direction=direction[ray], t=t[ray], t_end=t_max[ray], cell=cell, axis=axis[ray],
        medium=torch.zeros_like(ray),
    )  # fmt: skip
    value, _ = voxels.look(state.cell)
    within = torch.where(voxels.is_opaque(value), SOLID, value)
    return replace(state, medium=torch.where(enter[ray] > t_min[ray], 0, within))


def _first_surface(
    voxels: Voxels, state: Traversal, silent: Tensor, numbers: Tensor, ids: Tensor, nearest: Tensor
) -> None:
    """Step to where the medium changes, and write the hits into the rows of the rays."""
    while state.ray.numel():
        value, empty = voxels.look(state.cell)
        out = (state.medium == SOLID) & ~voxels.is_opaque(value)
        out = out | (silent & (state.medium > 0) & (value == 0))
        medium = torch.where(out, value, state.medium)
        stops = (value != medium) & (medium != SOLID)
        _write(voxels, state[stops], value[stops], numbers, ids, nearest)
        state, silent, empty = replace(state, medium=medium)[~stops], silent[~stops], empty[~stops]
        state, inside = _step(voxels, state, empty)
        before_end = state.t < state.t_end
        leaves = ~inside & before_end & (state.medium > 0) & ~silent
        _write(voxels, state[leaves], torch.zeros_like(state.ray[leaves]), numbers, ids, nearest)
        state, silent = state[inside & before_end], silent[inside & before_end]


def _step(voxels: Voxels, state: Traversal, empty: Tensor) -> tuple[Traversal, Tensor]:
    """Leave the voxel, or the whole brick where it is empty; and whether that is still within the grid's bounds."""
    size = torch.where(empty, BRICK, 1)[:, None]
    low = torch.div(state.cell, size, rounding_mode="floor") * size
    forward = state.direction > 0
    t, axis = ((torch.where(forward, low + size, low) - state.origin) * (1 / state.direction)).min(dim=1)
    beside = torch.minimum(torch.maximum(state.at(t).floor().long(), low), low + size - 1)
    through = torch.nn.functional.one_hot(axis, 3).bool()
    cell = torch.where(through, torch.where(forward, low + size, low - 1), beside)
    inside = ((cell >= voxels.low) & (cell < voxels.high)).all(dim=1)
    return replace(state, t=t, axis=axis, cell=cell), inside


def _write(voxels: Voxels, state: Traversal, value: Tensor, numbers: Tensor, ids: Tensor, nearest: Tensor) -> None:
    """Store hits. Where ``value`` is air, the surface is the back of the medium that the ray leaves."""
    back = value == 0
    falling = state.direction.gather(1, state.axis[:, None])[:, 0] < 0
    through = torch.nn.functional.one_hot(state.axis, 3)
    behind = torch.where(falling, -1, 1)[:, None] * through
    cell = torch.where(back[:, None], state.cell - behind, state.cell)
    material = torch.where(back, state.medium, value) + voxels.row[MATERIAL]
    face = state.axis * 2 + falling
    row: list[Any] = [material, torch.full_like(material, voxels.entry), face, back]
    numbers[state.ray] = torch.cat([state.t[:, None], state.at(state.t) + voxels.corner], dim=1).float()
    ids[state.ray] = torch.cat([torch.stack(row, dim=1), cell + voxels.corner], dim=1).int()
    nearest[state.ray] = state.t


def _attenuate(voxels: Voxels, passed: Tensor, state: Traversal, length: Tensor) -> None:
    """Multiply the light of rays by the transmission through ``length`` of their medium."""
    row = voxels.media[(state.medium + voxels.row[MATERIAL]).clamp_min(0)].double()
    factor = (1 - row[:, :1]) * row[:, 1:] ** length.clamp_min(0)[:, None]
    passed[state.ray] *= torch.where(state.medium[:, None] > 0, factor, 1.0).float()


def _enter_face(passed: Tensor, state: Traversal) -> None:
    """Multiply the light of rays by the share that the dielectric face they cross does not reflect."""
    along = state.direction.gather(1, state.axis[:, None])[:, 0].abs() / state.direction.norm(dim=1)
    passed[state.ray] *= (1 - schlick(along, DIELECTRIC_F0))[:, None].float()
