"""Normals of the surfaces that planar depth describes."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from gbufrt.camera.matrices import told_shape
from gbufrt.directions import length


def check_depth_map(depth: Any, size: tuple[int, int]) -> None:
    """Raise ValueError unless depth is ``(B, 1, H, W)`` of a camera's ``size`` ``(H, W)``; TypeError if no tensor."""
    if not isinstance(depth, Tensor):
        raise TypeError(f"depth must be a torch.Tensor, got {type(depth).__name__}")
    if depth.ndim != 4 or depth.shape[1] != 1:
        raise ValueError(f"depth must be (B,1,H,W), planar view z, got {told_shape(depth)}")
    if tuple(depth.shape[2:]) != tuple(size):
        raise ValueError(f"depth must be (B,1,{size[0]},{size[1]}) like its camera, got {told_shape(depth)}")


def facing_normals(points: Tensor, toward: Tensor, lens: Tensor, *, orthographic: bool) -> Tensor:
    """``(B, 3, H, W)`` unit normals in view space that face the eye, by differences between neighbours.

    Args:
        points: ``(B, 3, H, W)`` view space, where each pixel was sampled.
        toward: ``(B, 3, H, W)`` unit directions to the eye, view space.
        lens: ``(B, 6)``, see `gbufrt.Camera.lens`.
        orthographic: whether rays are parallel.
    """
    if orthographic:
        dx, dy = torch.gradient(points, dim=(3, 2))
        away = torch.linalg.cross(dx, dy, dim=1)
        away = away / length(away)
    else:  # kornia counts pixel centres from integers, and its normals face away from the camera
        from kornia.geometry.depth import depth_to_normals  # late: kornia takes most of a second to import

        focal, center, jitter = lens.to(points.dtype).split(2, dim=1)
        k = torch.diag_embed(torch.nn.functional.pad(focal, (0, 1), value=1.0))
        k[:, :2, 2] = center - 0.5 - jitter
        away = depth_to_normals(points[:, 2:], k)
    return torch.where((away * toward).sum(1, keepdim=True) < 0, -away, away)
