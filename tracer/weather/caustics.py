"""Caustics: sunlight that the waves of water reflect onto what stands over it."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.resident import numbers, places
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW, Scene
from tracer.traversal.rays import trace, transmission
from tracer.weather import reference
from tracer.weather.water import TOP, Water

LOWEST = 0.05  # sine of the sun's elevation below which its mirrored light is left out
LIFT = 1e-3  # world units over still water from which the sun is looked for


def caustics(
    scene: Scene, points: Tensor, normals: Tensor, lit: Tensor, *, poses: Tensor, time: float, eye: Tensor
) -> Tensor:
    """Irradiance from the sun by way of water with waves.

    The way from the sun by a mirror at the water's level is followed back from each point. Where it meets water within
    ``waves.caustics``, and the sun is not hidden from there, the waves round that place decide how much arrives. Waves
    are taken as high as their mean, and as seen from there alone: they do not end at the water's edge.

    Args:
        scene: with sun and waves.
        points: ``(n, 3)`` world space, a little above their surfaces.
        normals: ``(n, 3)``.
        lit: ``(n,)`` bool: where light is wanted.
        poses: ``(I, 4, 4)`` of the instances.
        time: seconds.
        eye: ``(3,)`` of the camera, from which fine waves end.

    Returns:
        ``(n, 3)``.

    Source: BetterRTX's reflected water caustics.
    """
    arrived = torch.zeros_like(points)
    if scene.sun is None or scene.waves is None or scene.waves.caustics == 0.0:
        return arrived
    x, y, z = F.normalize(torch.tensor(scene.sun.direction, dtype=points.dtype), dim=0).tolist()
    if y < LOWEST or not any(scene.sun.irradiance):
        return arrived
    sun, down, irradiance = numbers(((x, y, z), (x, -y, z), scene.sun.irradiance), points)
    above = lit & (normals @ down > 1e-3)
    rows = places(above)[0]
    ways = down.expand(len(rows), 3)
    reach = torch.where(above[rows], scene.waves.caustics, 0.0)  # rays of no length hit nothing
    hits = trace(scene, points[rows], ways, poses=poses, mask=MASK_SECONDARY, t_max=reach)
    top = hits.hit & ~hits.back_face & (hits.face == TOP) & (hits.instance == 0)
    top = top & scene.materials.water[hits.material.long()]
    here = places(top)[0]
    rows, at = rows[here], (points[rows] + ways * torch.where(top, hits.t, 0.0)[:, None])[here]
    levels, top = at[:, 1].round(), top[here]
    begin = torch.stack([at[:, 0], levels + LIFT, at[:, 2]], dim=-1)
    reach = torch.where(top, torch.inf, 0.0)
    sees = transmission(scene, begin, sun.expand_as(begin), poses=poses, mask=MASK_SHADOW, t_max=reach)
    seen = top & (sees.amax(dim=1) > 0)
    here = places(seen)[0]
    rows, levels, sees = rows[here], torch.where(seen, levels - scene.waves.amplitude, -torch.inf)[here], sees[here]
    water = Water.of(scene.waves, time, eye)
    share = _focused(water, points[rows], normals[rows], levels, sun)
    arrived[rows] = share[:, None] * sees * irradiance
    return arrived


def _focused(water: Water, points: Tensor, normals: Tensor, levels: Tensor, sun: Tensor) -> Tensor:
    """See `tracer.weather.reference.focused`."""
    if form_of(points, normals, levels, cuda=True) is Form.REFERENCE:
        return reference.focused(water, points, normals, levels, sun)
    from tracer.weather import drivers

    return drivers.focused(water, points, normals, levels, sun)
