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
from tracer.scene.scene import Scene
from tracer.texture import facing
from tracer.traversal.rays import Hits
from tracer.weather.reference import meet
from tracer.weather.water import TOP, Water


def on_waves(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    first: Hits,
    second: Hits,
    *,
    eyes: Tensor,
    times: list[float],
    before: list[float],
) -> tuple[Hits, Hits, Tensor]:
    """What rays of a camera hit where water has waves.

    Rays that enter water by its top go on to the wave, and have its normal there. Where they come to something else
    first, the bank at the water's edge, they have that as first hit, and nothing behind it.

    Args:
        scene: with ``waves``.
        origins: ``(B, H, W, 3)`` of the rays, world space.
        directions: likewise, unit length.
        first: their first hits, on still water.
        second: what lies behind those.
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
    t, normal, rises = first.t.clone(), first.normal.clone(), torch.zeros_like(first.t)
    dry = torch.zeros_like(first.hit)
    for b in range(len(origins)):
        here = top[b].nonzero(as_tuple=True)
        water = Water.of(scene.waves, times[b], eyes[b])
        origin, direction = origins[b][here], directions[b][here]
        met = _meet(water, origin, direction, first.t[b][here], second.t[b][here])
        places = (origin + direction * met[:, None])[:, [0, 2]]
        slopes = water.slopes(places)
        up = torch.stack([-slopes[:, 0], torch.ones_like(met), -slopes[:, 1]], dim=-1)
        t[b][here], dry[b][here] = met, met >= second.t[b][here]
        normal[b][here] = facing(F.normalize(up, dim=-1), first.normal[b][here], direction)
        if times[b] != before[b]:
            earlier = Water.of(scene.waves, before[b], eyes[b])
            rises[b][here] = earlier.height(places) - water.height(places)
    wet = replace(first, t=t, normal=normal)
    return _chosen(dry, second, wet), _without(second, dry), torch.where(dry, 0.0, rises)


def _meet(water: Water, origins: Tensor, directions: Tensor, t: Tensor, end: Tensor) -> Tensor:
    """See `tracer.weather.reference.meet`."""
    rays = origins, directions, t, end
    if form_of(*rays, cuda=True) is Form.REFERENCE:
        return meet(water, *rays)
    from tracer.weather import drivers

    return drivers.meet(water, *rays)


def above_waves(scene: Scene, materials: Tensor | None, normals: Tensor, points: Tensor) -> Tensor:
    """Points ``(B, 3, H, W)`` to send rays from: those on waves lifted to the face of still water, out of its voxels.

    Args:
        scene: what is there.
        materials: ``(B, 1, H, W)`` at the points.
        normals: ``(B, 3, H, W)`` there.
        points: as they are.
    """
    if scene.waves is None or materials is None:
        return points
    wave = scene.materials.water[materials.long()] & (normals[:, 1:2] > 0.1) & (normals[:, 1:2] < 1)
    height = points[:, 1:2]
    clear = torch.where(wave, torch.maximum(height, (height - 1e-2).ceil() + 1e-3), height)
    return torch.cat([points[:, :1], clear, points[:, 2:]], dim=1)


def _chosen(where: Tensor, a: Hits, b: Hits) -> Hits:
    """``a`` where so, else ``b``."""
    fields = {name: (getattr(a, name), getattr(b, name)) for name in Hits.__dataclass_fields__}
    wide = {name: where if x.ndim == where.ndim else where[..., None] for name, (x, _) in fields.items()}
    return Hits(**{name: torch.where(wide[name], *pair) for name, pair in fields.items()})


def _without(hits: Hits, where: Tensor) -> Hits:
    """Hits of which some have become misses."""
    return replace(
        hits,
        t=torch.where(where, torch.inf, hits.t),
        hit=hits.hit & ~where,
        material=torch.where(where, 0, hits.material),
        instance=torch.where(where, 0, hits.instance),
        normal=torch.where(where[..., None], 0.0, hits.normal),
    )
