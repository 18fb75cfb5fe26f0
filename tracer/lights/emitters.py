"""Lamps: the exposed faces of emissive voxels, merged to rectangles; each group is sampled as one light."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from weakref import WeakKeyDictionary

import torch
from torch import Tensor

from tracer.scene.grids import PART
from tracer.scene.scene import MASK_SECONDARY, Scene
from tracer.scene.world import BRICK, World

GROUPS = (4, 8, 16, 32)  # side, in voxels, of the cells that group lamps: the first that gives at most MANY lamps
MANY = 1 << 14
_known: WeakKeyDictionary[World, dict[int, Lamps]] = WeakKeyDictionary()  # finding lamps takes time; by least side


@dataclass(frozen=True, eq=False)
class Lamps:
    """L lights of up to K one-sided rectangles each, in world space.

    Args:
        corner: ``(L, K, 3)``; a rectangle is ``corner + s edge_u + t edge_v`` for s, t in [0, 1].
        edge_u: ``(L, K, 3)``.
        edge_v: ``(L, K, 3)``; ``edge_u x edge_v`` points to the emitting side. Both edges are zero where a lamp has
            fewer than K rectangles, in the last places.
        side: ``(L, K)`` int64: -x +x -y +y -z +z of its own grid; what has one faces one way.
        radiance: ``(L, 3)`` linear.
        center: ``(L, 3)`` of a sphere that holds all rectangles.
        radius: ``(L,)`` of that sphere, world units.
    """

    corner: Tensor
    edge_u: Tensor
    edge_v: Tensor
    side: Tensor
    radiance: Tensor
    center: Tensor
    radius: Tensor

    def __len__(self) -> int:
        return self.corner.shape[0]


def lamps_of(scene: Scene, poses: Tensor) -> Lamps:
    """All lamps of a scene at one time; instances emit too, unless their mask excludes secondary rays.

    Args:
        scene: world and instances.
        poses: ``(I, 4, 4)`` world from model.

    Returns:
        The lamps; none where nothing emits.
    """
    parts = [lamps_of_world(scene.world)]
    for instance, pose in zip(scene.instances, poses, strict=True):
        lamps = lamps_of_world(instance.model, side=round(1 / instance.scale))
        if instance.mask & MASK_SECONDARY and len(lamps):
            parts.append(_moved(lamps, pose.to(scene.world.device), instance.scale))
    widest = max(part.corner.shape[1] for part in parts)
    columns = {f.name: [getattr(part, f.name) for part in parts] for f in fields(Lamps)}
    for name in ("corner", "edge_u", "edge_v", "side"):
        columns[name] = [_widen(table, widest) for table in columns[name]]
    return Lamps(**{name: torch.cat(tables) for name, tables in columns.items()})


def lamps_of_world(world: World, *, side: int = GROUPS[0]) -> Lamps:
    """The lamps of a voxel grid in its own coordinates.

    A face emits where the voxel in front of it is not opaque and is of another material. Faces of one material in a
    cell of 4x4x4 voxels form a lamp. Those that fill a rectangle are merged.

    Args:
        world: the grid.
        side: in voxels, that cells have at least, such as a unit of the scene: a torch is one lamp, not a part in each
            cell that meets in its middle. They are larger too where there would be many lamps.
    """
    side = min(max(side, GROUPS[0]), GROUPS[-1])
    known = _known.setdefault(world, {})
    if side not in known:
        known[side] = _found(world, side)
    return known[side]


def _found(world: World, side: int) -> Lamps:
    faces, sides, ids = _exposed_faces(world)
    if not len(ids):
        none = torch.zeros(0, 1, 3, dtype=torch.float32, device=world.device)
        return Lamps(none, none, none, none[..., 0].long(), none[:, 0], none[:, 0], none[:, 0, 0])
    cells, lamp = ids[:, None], ids
    for group in (side, *(g for g in GROUPS if g > side)):
        key = torch.cat([torch.div(faces, group, rounding_mode="floor"), ids[:, None]], dim=1)
        cells, lamp, _ = _unique_rows(key)
        if len(cells) <= MANY:
            break
    low, high, sides, lamp = _merged(faces, sides, lamp)
    return _assembled(low, high, sides, lamp, world.materials.emission[cells[:, -1]])


def _exposed_faces(world: World) -> tuple[Tensor, Tensor, Tensor]:
    """Voxel ``(F, 3)``, side ``(F,)`` (twice the axis, plus one where it faces up the axis) and material ``(F,)``."""
    materials = world.materials
    voxels, ids = _emissive_voxels(world)
    kept: list[tuple[Tensor, Tensor, Tensor]] = []
    for side in range(6):
        step = torch.zeros(3, dtype=torch.long, device=world.device)
        step[side // 2] = 1 if side % 2 else -1
        before = world.at(voxels + step).long()
        open_ = (materials.opacity[before] < 1) & (before != ids)
        kept.append((voxels[open_], torch.full_like(ids[open_], side), ids[open_]))
    faces, sides, ids = (torch.cat(group) for group in zip(*kept, strict=True))
    return faces, sides, ids


def _emissive_voxels(world: World) -> tuple[Tensor, Tensor]:
    """World voxel coordinates ``(V, 3)`` and ids ``(V,)`` of everything that emits."""
    emits = world.materials.emission.amax(dim=1) > 0
    shining = world.shining
    if shining is None:
        shining = torch.cat([emits[part.long()].flatten(1).any(dim=1) for part in world.bricks.split(PART)])
    cells = shining[world.index.long()].nonzero()
    bricks = world.bricks[world.index[tuple(cells.unbind(dim=1))].long()]
    which, *inner = emits[bricks.long()].nonzero(as_tuple=True)
    origin = torch.tensor(world.origin, device=world.device)
    return cells[which] * BRICK + torch.stack(inner, dim=1) + origin, bricks[which, *inner].long()


def _merged(faces: Tensor, sides: Tensor, lamp: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Low and high corner, side and lamp of the rectangles that unit faces are merged to."""
    axis = torch.div(sides, 2, rounding_mode="floor")[:, None]
    along = torch.zeros_like(faces).scatter(1, axis, 1)
    low = faces + along * (sides % 2)[:, None]
    high = low + 1 - along
    key = torch.stack([lamp, sides, low.gather(1, axis)[:, 0]], dim=1)
    plane, group, count = _unique_rows(key)
    spread = group[:, None].expand(-1, 3)
    least = torch.zeros_like(low[: len(plane)]).scatter_reduce(0, spread, low, "amin", include_self=False)
    most = torch.zeros_like(low[: len(plane)]).scatter_reduce(0, spread, high, "amax", include_self=False)
    full = (most - least).clamp_min(1).prod(dim=1) == count
    rest = ~full[group]
    pairs = ((least[full], low[rest]), (most[full], high[rest]), (plane[full, 1], sides[rest]))
    low, high, sides = (torch.cat(pair) for pair in pairs)
    return low, high, sides, torch.cat([plane[full, 0], lamp[rest]])


def _unique_rows(rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """`torch.unique` of rows of integers, with inverse and counts, by one number for each: twenty times faster."""
    low = rows.amin(dim=0)
    sizes = (rows.amax(dim=0) - low + 1).tolist()
    steps = rows.new_tensor([math.prod(sizes[k + 1 :]) for k in range(len(sizes))])
    found, inverse, counts = torch.unique(((rows - low) * steps).sum(dim=1), return_inverse=True, return_counts=True)
    columns = torch.div(found[:, None], steps, rounding_mode="floor") % rows.new_tensor(sizes)
    return columns + low, inverse, counts


def _assembled(low: Tensor, high: Tensor, sides: Tensor, lamp: Tensor, radiance: Tensor) -> Lamps:
    """Rectangles sorted into the rows of a table, one row per lamp."""
    lamp, order = lamp.sort(stable=True)
    low, high, sides = low[order].float(), high[order].float(), sides[order]
    axis, up = torch.div(sides, 2, rounding_mode="floor"), (sides % 2).bool()
    # the two other axes in the order whose cross product points out of the voxel
    first = torch.where(up, axis + 1, axis + 2) % 3
    size = high - low
    edge_u = torch.zeros_like(size).scatter(1, first[:, None], size.gather(1, first[:, None]))
    count = torch.bincount(lamp, minlength=len(radiance))
    place = torch.arange(len(lamp), device=lamp.device) - (count.cumsum(0) - count)[lamp]
    table = low.new_zeros(3, len(radiance), int(count.max()), 3)
    table[:, lamp, place] = torch.stack([low, edge_u, size - edge_u])
    side = sides.new_zeros(table.shape[1:3])
    side[lamp, place] = sides
    spread = lamp[:, None].expand(-1, 3)
    least = torch.zeros_like(radiance).scatter_reduce(0, spread, low, "amin", include_self=False)
    most = torch.zeros_like(radiance).scatter_reduce(0, spread, high, "amax", include_self=False)
    corner, edge_u, edge_v = table
    return Lamps(corner, edge_u, edge_v, side, radiance, (least + most) / 2, (most - least).norm(dim=1) / 2)


def _moved(lamps: Lamps, pose: Tensor, scale: float) -> Lamps:
    rotation, offset = pose[:3, :3].T * scale, pose[:3, 3]
    return replace(
        lamps,
        corner=lamps.corner @ rotation + offset,
        edge_u=lamps.edge_u @ rotation,
        edge_v=lamps.edge_v @ rotation,
        center=lamps.center @ rotation + offset,
        radius=lamps.radius * scale,
    )


def _widen(table: Tensor, width: int) -> Tensor:
    return torch.nn.functional.pad(table, (0, 0) * (table.ndim - 2) + (0, width - table.shape[1]))
