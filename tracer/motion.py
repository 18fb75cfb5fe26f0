"""Where a camera showed, a frame ago, what it shows now."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.camera.transforms import projected, sampled_rows
from gbufrt.compute.resident import places, waits
from tracer.scene.scene import Scene
from tracer.traversal.hits import Hits

Where = tuple[Tensor, ...]
"""Indices ``(n,)`` of pixels: in the batch, rows and columns."""


def motion_of(
    scene: Scene, camera: Camera, previous: Camera, hits: Hits, depth: Tensor, *, poses: Tensor, rises: Tensor | None
) -> tuple[Tensor, Tensor]:
    """Motion and motion_z: of a static world, on instances of the same point of the model, and of water that rises.

    Args:
        scene: what is there.
        camera: B cameras.
        previous: where they were a frame ago.
        hits: ``(B, H, W)`` of the pixels.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        poses: ``(B, I, 4, 4)`` of the instances a frame ago.
        rises: ``(B, H, W)`` how much higher the surface was a frame ago, world units; None for none.

    Returns:
        ``(B, 2, H, W)`` pixels and ``(B, 1, H, W)`` world units, see `gbufrt.GBuffer`.
    """
    motion, motion_z = camera.static_motion(previous, depth, hits.hit[:, None])
    if rises is not None and (waits(rises) or bool(rises.any())):
        points = camera.to_world(camera.unproject(depth.double()))
        points[:, 1] += rises
        batch, row, column = where = places(moves := rises != 0)
        _put(motion, motion_z, camera, previous, depth, points[batch, :, row, column], where, moves)
    moves = hits.instance > 0
    if scene.instances and (waits(moves) or bool(moves.any())):
        batch, *_ = where = places(moves)
        chosen = scene.world_from_model(poses.double())[batch, hits.instance[where].long() - 1]
        points = _moved(chosen, hits.local[where].double())
        _put(motion, motion_z, camera, previous, depth, points, where, moves)
    return motion, motion_z


def _put(
    motion: Tensor,
    motion_z: Tensor,
    camera: Camera,
    previous: Camera,
    depth: Tensor,
    points: Tensor,
    where: Where,
    moves: Tensor,
) -> None:
    """Write motion of what was at ``points`` ``(n, 3)`` a frame ago, world space, where ``moves`` ``(B, H, W)`` is set.

    ``where`` is its `places`: few pixels of a picture move by themselves.
    """
    batch, row, column = where
    before = _moved(previous.view_from_world.double()[batch], points)
    px = projected(before, previous.intrinsics[batch], orthographic=previous.orthographic)
    x, y = (part.expand(camera.batch, -1, -1, -1) for part in sampled_rows(camera.size, camera.jitter, points))
    moved = px - torch.stack([x[batch, 0, 0, column], y[batch, 0, row, 0]], dim=1)
    change, set_ = before[:, 2] - depth[batch, 0, row, column], moves[where]
    still, still_z = motion[batch, :, row, column], motion_z[batch, 0, row, column]
    motion[batch, :, row, column] = torch.where(set_[:, None], moved.to(depth.dtype), still)
    motion_z[batch, 0, row, column] = torch.where(set_, change.to(depth.dtype), still_z)


def _moved(matrices: Tensor, points: Tensor) -> Tensor:
    """Points ``(n, 3)``, each moved by its own ``(n, 4, 4)``."""
    return (matrices[:, :3, :3] @ points[..., None])[..., 0] + matrices[:, :3, 3]
