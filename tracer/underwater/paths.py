"""Light paths from cameras in water, as far as the water's surface or what lies in it."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor

from tracer.lights.shadows import SHORT
from tracer.sampling.scatter import mirrored
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.traversal.hits import Hits
from tracer.traversal.rays import trace
from tracer.underwater.medium import Medium
from tracer.underwater.surface import LIFT, leaves, past_borders, reflectance, refracted


class Onward(NamedTuple):
    """Rays that go on where water has led those of a camera: light of those is ``added + weight * light`` of these."""

    origins: Tensor
    """``(N, 3)`` world space."""
    directions: Tensor
    """``(N, 3)`` unit length."""
    t_min: Tensor
    """``(N,)`` where they begin."""
    u: Tensor
    """``(N,)`` numbers in [0, 1), as good as new."""
    weight: Tensor
    """``(N, 3)``."""
    added: Tensor
    """``(N, 3)`` linear radiance."""


def onward(
    scene: Scene,
    eye: Tensor,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    poses: Tensor,
    t_min: Tensor,
    t_max: Tensor,
) -> Onward | None:
    """Lead rays from a camera through the water that it is in; None where it is in the air.

    They end just before what they hit. At the water's surface, which is flat here, they go on into the air or, as
    often as it reflects, back through the water to what they hit there.

    Args:
        scene: what is there.
        eye: ``(1, 3)`` of the camera.
        origins: ``(N, 3)`` of the rays, world space.
        directions: ``(N, 3)``, unit length.
        u: ``(N,)`` in [0, 1), whether the surface reflects.
        poses: ``(I, 4, 4)`` of the instances.
        t_min: ``(N,)`` where they begin.
        t_max: ``(N,)`` where they end.
    """
    medium = Medium.of(scene, eye, poses[None])
    if medium is None:
        return None
    hits = _first(scene, medium, origins, directions, poses, t_min, t_max)
    weight, added = _on_the_way(medium, directions, hits)
    begins = torch.where(hits.hit, torch.maximum(hits.t - SHORT, t_min), t_min)
    shows = leaves(scene, hits) & medium.wet
    cosine = -(hits.normal * directions).sum(dim=1)
    share = torch.where(shows, reflectance(cosine), 0.0)
    back = u < share
    u = torch.where(back, u / share.clamp_min(1e-9), (u - share) / (1 - share).clamp_min(1e-9)).clamp(0, 1 - 2**-24)
    points = origins + directions * torch.where(shows, hits.t, 0.0)[:, None]
    side = torch.where(back, LIFT, -LIFT)[:, None]
    ways = torch.where(back[:, None], mirrored(directions, hits.normal), refracted(directions, hits.normal))
    there = shows[:, None]
    origins, directions = torch.where(there, points + hits.normal * side, origins), torch.where(there, ways, directions)
    begins = torch.where(shows, 0.0, begins)
    again = _first(scene, medium, origins, directions, poses, begins, torch.where(back, t_max, 0.0))
    dimmed, more = _on_the_way(medium, directions, again, origins[:, 1])
    begins = torch.where(back & again.hit, (again.t - SHORT).clamp_min(0), begins)
    through = torch.where(shows & ~back, medium.lets, 1.0)[:, None]
    twice = back[:, None]
    added = added + torch.where(twice, weight * more, 0.0)
    weight = weight * torch.where(twice, dimmed, through)
    return Onward(origins, directions, begins, u, weight, added)


def _first(
    scene: Scene, medium: Medium, origins: Tensor, directions: Tensor, poses: Tensor, t_min: Tensor, t_max: Tensor
) -> Hits:
    """What rays in the water hit that is no border between waters."""
    rays = origins[None], directions[None]
    given: dict[str, Any] = {"poses": poses[None], "t_max": t_max[None]}
    hits = trace(scene, *rays, mask=MASK_PRIMARY, t_min=t_min[None], **given)
    return past_borders(scene, *rays, hits, medium.wet[:, None], **given).at((0,))


def _on_the_way(medium: Medium, directions: Tensor, hits: Hits, heights: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """``(N, 3)`` the light that water leaves, and the radiance that it adds; all of it where nothing was hit."""
    far = hits.t[None]
    heights = None if heights is None else heights[None]
    return medium.clear(far)[0].T, medium.scattered(directions[None, :, 1], far, heights)[0].T
