"""Poses and lenses of cameras that look at a point."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor

from gbufrt.camera.matrices import told_shape

PARALLEL = 1e-9  # sine of the smallest angle between the view direction and up


def looking_at(eye: Any, target: Any, up: Any) -> Tensor:
    """``(B, 4, 4)``: world from view of cameras at ``eye``; see `gbufrt.Camera.look_at` for arguments and errors."""
    tensors = [value for value in (eye, target, up) if isinstance(value, Tensor)]
    device = tensors[0].device if tensors else None
    dtype = torch.float64 if any(value.dtype == torch.float64 for value in tensors) else torch.float32
    given = {"eye": eye, "target": target, "up": up}
    eye, target, up = torch.broadcast_tensors(*(_vectors(name, value, device) for name, value in given.items()))
    forward = target - eye
    right = torch.linalg.cross(forward, up)
    parallel = right.norm(dim=-1) < PARALLEL * forward.norm(dim=-1).clamp_min(PARALLEL)
    if parallel.device.type != "meta" and bool(parallel.any()):
        if bool((forward == 0).all(dim=-1).any()):
            raise ValueError(
                "eye and target must be two places, so that the camera looks somewhere; got the same twice"
            )
        raise ValueError("eye, target and up must not lie on one line; choose another up or target")
    forward = forward / forward.norm(dim=-1, keepdim=True)
    right = right / right.norm(dim=-1, keepdim=True)
    axes = torch.stack([right, torch.linalg.cross(forward, right), forward, eye], dim=-1)
    last = torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=eye.dtype, device=device)
    return torch.cat([axes, last.expand(eye.shape[0], 1, 4)], dim=1).to(dtype)


def centred_lens(size: tuple[int, int], spread: float, like: Tensor) -> Tensor:
    """``(3, 3)`` intrinsics whose principal point is the middle of the picture.

    Args:
        size: ``(H, W)``.
        spread: what the picture's height spans, at depth 1 or in world units.
        like: a tensor of the device and type wanted.
    """
    (height, width), focal = size, size[0] / spread
    k = torch.tensor([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]], dtype=like.dtype)
    return k.to(like.device)


def spread_of(fov_y: float) -> float:
    """Height of the picture plane at depth 1, for a vertical field of view in degrees.

    Raises:
        ValueError: it is not in (0, 180).
    """
    if not 0.0 < fov_y < 180.0:
        raise ValueError(f"fov_y must lie between 0 and 180 degrees, got {fov_y}")
    return 2 * math.tan(math.radians(fov_y) / 2)


def _vectors(name: str, value: Any, device: torch.device | None) -> Tensor:
    try:
        tensor = torch.as_tensor(value, dtype=torch.float64, device=device)
    except (TypeError, ValueError, RuntimeError):
        raise TypeError(f"{name} must be three numbers or a tensor, got {value!r}") from None
    tensor = tensor[None] if tensor.ndim == 1 else tensor
    if tensor.ndim != 2 or tensor.shape[1] != 3:
        raise ValueError(f"{name}, a position or direction, must be (3,) or (B,3), got {told_shape(tensor)}")
    if tensor.device.type == "cpu" and not bool(tensor.isfinite().all()):
        raise ValueError(f"{name} must be finite, got {value!r}")
    return tensor
