"""What lies behind several transmissive surfaces, and how much of its light they let through."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.resident import places
from gbufrt.tree import map_tensors
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.traversal.hits import Hits
from tracer.traversal.rays import run_lengths, trace

MOST = 4  # surfaces that are looked through
THICK = 64.0  # world units that are looked into one


def through_panes(
    scene: Scene, origins: Tensor, directions: Tensor, hits: Hits, *, poses: Tensor, t_max: Tensor
) -> tuple[Hits, Tensor]:
    """Go on through transmissive surfaces to what is opaque, or the sky.

    What these surfaces send themselves is left out.

    Args:
        scene: what is there.
        origins: ``(B, H, W, 3)`` of the rays, world space.
        directions: likewise, unit length.
        hits: of these rays.
        poses: ``(B, I, 4, 4)`` of the instances.
        t_max: ``(B, H, W)`` where the rays end.

    Returns:
        The hits, and ``(B, H, W, 3)`` the share of the light from there that comes through what was hit before.
    """
    table, share = scene.materials, torch.ones_like(origins)
    hits = map_tensors(torch.clone, hits)
    for b in range(len(origins)):
        for _ in range(MOST):
            clear = hits.hit[b] & (table.opacity[hits.material[b].long()] < 1)
            rows = places(clear)
            if not len(rows[0]):
                break
            rows = (b, *rows)
            pane, way = hits.at(rows), (origins[rows], directions[rows])
            behind = trace(scene, *way, poses=poses[b], mask=MASK_PRIMARY, t_max=t_max[rows], beyond=pane)
            run = run_lengths(scene, *way, pane, poses=poses[b], cap=THICK)[1]
            run = torch.minimum(run, behind.t - pane.t)
            here = clear[rows[1:]]
            share[rows] *= torch.where(here[:, None], table.passing(pane.material, run), 1.0)
            hits.put(rows, behind.where(here, pane))
    return hits, share
