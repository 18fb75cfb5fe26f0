"""Waves: the height of water over time, and where rays of the camera meet it.

Water ends in a face at the top of its voxels. A wave lies below that face, inside the voxel: a ray that enters there
goes on to where it meets the height field.
"""

from __future__ import annotations

from dataclasses import replace

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.resident import places
from gbufrt.tree import map_tensors
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.texture import facing
from tracer.traversal.hits import Hits
from tracer.traversal.rays import trace
from tracer.weather.reference import meet
from tracer.weather.water import TOP, Water

MOST = 8  # materials of water that a ray crosses over one wave


def on_waves(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    first: Hits,
    second: Hits,
    *,
    poses: Tensor,
    t_max: Tensor,
    eyes: Tensor,
    times: list[float],
    before: list[float],
) -> tuple[Hits, Hits, Tensor]:
    """What rays of a camera hit where water has waves.

    Rays that enter water by its top go on to the wave, and have its normal there; on the way they may cross into water
    of another material, such as that of another biome. Where they come to something else first, the bank at the water's
    edge, they have that as first hit, and nothing behind it.

    Args:
        scene: with ``waves``.
        origins: ``(B, H, W, 3)`` of the rays, world space.
        directions: likewise, unit length.
        first: their first hits, on still water.
        second: what lies behind those.
        poses: ``(B, I, 4, 4)`` of the instances.
        t_max: ``(B, H, W)`` where the rays end.
        eyes: ``(B, 3)`` of the cameras.
        times: B, seconds.
        before: of the frame before.

    Returns:
        The first hits, the second hits, and ``(B, H, W)`` how much higher the water at the first ones was in the frame
        before, world units.
    """
    assert scene.waves is not None
    top = scene.materials.water[first.material.long()] & first.hit & ~first.back_face
    top = top & (first.face == TOP) & (first.instance == 0)
    rises, dry = torch.zeros_like(first.t), torch.zeros_like(first.hit)
    first, second = (map_tensors(torch.clone, hits) for hits in (first, second))
    for b in range(len(origins)):
        here = (b, *places(top[b]))
        wavy = top[here]
        water = Water.of(scene.waves, times[b], eyes[b])
        origin, direction = rays = origins[here], directions[here]
        on, behind = first.at(here), second.at(here)
        met = _met(scene, water, rays, on, behind, wavy, poses=poses[b], t_max=t_max[here])
        dry[here] = met >= behind.t
        at = (origin + direction * met[:, None])[:, ::2]
        slopes = water.slopes(at)
        up = F.normalize(torch.stack([-slopes[:, 0], torch.ones_like(met), -slopes[:, 1]], dim=-1), dim=-1)
        first.put(here, replace(on, t=met, normal=facing(up, on.normal, direction)).where(wavy, first.at(here)))
        second.put(here, behind)
        if times[b] != before[b]:
            earlier = Water.of(scene.waves, before[b], eyes[b])
            rises[here] = torch.where(wavy, earlier.height(at) - water.height(at), 0.0)
    return second.where(dry, first), second.without(dry), torch.where(dry, 0.0, rises)


def _met(
    scene: Scene,
    water: Water,
    rays: tuple[Tensor, Tensor],
    on: Hits,
    behind: Hits,
    wavy: Tensor,
    *,
    poses: Tensor,
    t_max: Tensor,
) -> Tensor:
    """``(n,)`` where rays meet the wave, or what bounds the water; of those that are not ``wavy``, 0.

    Where that is water again, it takes the place of the first in ``on``, and what bounds it that of ``behind``.
    """
    met = _meet(water, *rays, on.t, behind.t, wavy)
    for _ in range(MOST):
        again = wavy & (met >= behind.t) & behind.hit & ~behind.back_face
        again = again & scene.materials.water[behind.material.long()]
        rows = places(again)
        if not len(rows[0]):
            break
        here, over, entered, way = again[rows], on.at(rows), behind.at(rows), (rays[0][rows], rays[1][rows])
        crossed = replace(over, material=entered.material, cell=entered.cell, local=entered.local)
        on.put(rows, crossed.where(here, over))
        far = torch.where(here, t_max[rows], 0.0)
        beyond = trace(scene, *way, poses=poses, mask=MASK_PRIMARY, t_max=far, beyond=entered)
        behind.put(rows, beyond.where(here, entered))
        met[rows] = torch.where(here, _meet(water, *way, over.t, beyond.t, here), met[rows])
    return met


def _meet(water: Water, origins: Tensor, directions: Tensor, t: Tensor, end: Tensor, wavy: Tensor) -> Tensor:
    """See `tracer.weather.reference.meet`; rays that are not ``wavy`` end where they begin, at 0."""
    rays = origins, directions, torch.where(wavy, t, 0.0), torch.where(wavy, end, 0.0)
    if form_of(*rays, cuda=True) is Form.REFERENCE:
        return meet(water, *rays)
    from tracer.weather import drivers

    return drivers.meet(water, *rays)


def above_waves(scene: Scene, materials: Tensor | None, normals: Tensor, points: Tensor) -> Tensor:
    """Points ``(B, 3, H, W)`` to send rays from: those on waves lifted to the face of still water, out of its voxels.

    So are those on banks and hulls over the mean height of the waves, which are taken as dry: the face of still water
    would draw a dark line along the shore.

    Args:
        scene: what is there.
        materials: ``(B, 1, H, W)`` at the points.
        normals: ``(B, 3, H, W)`` there.
        points: as they are.
    """
    if scene.waves is None or materials is None:
        return points
    height, water = points[:, 1:2], scene.materials.water
    top = (height - 1e-2).ceil()
    wave = water[materials.long()] & (normals[:, 1:2] > 0.1) & (normals[:, 1:2] < 1)
    dry = ~water[materials.long()] & (normals[:, 1:2] > -0.1) & (height > top - scene.waves.amplitude)
    clear = torch.where(wave | (dry & _ends_water(scene, points)), torch.maximum(height, top + 1e-3), height)
    return torch.cat([points[:, :1], clear, points[:, 2:]], dim=1)


def _ends_water(scene: Scene, points: Tensor) -> Tensor:
    """``(B, 1, H, W)`` whether points lie in voxels of water under open air."""
    cells = points.movedim(1, -1).floor().long()
    above = torch.cat([cells[..., :1], cells[..., 1:2] + 1, cells[..., 2:]], dim=-1)
    here = scene.materials.water[scene.world.at(cells).long()] & (scene.world.at(above) == 0)
    return here[:, None]
