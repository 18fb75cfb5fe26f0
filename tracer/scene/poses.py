"""Poses of instances, ``(I, 4, 4)``: rigid up to a scale, world from model."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from gbufrt.compute.resident import waits


def posed(pose: Any, name: str) -> Tensor:
    """What the pose of an instance called ``name`` returns, as float32.

    Raises:
        TypeError: it is no tensor.
        ValueError: it is of another shape.
    """
    whose = f"pose of instance {name!r}" if name else "pose of an instance"
    if not isinstance(pose, Tensor):
        got = type(pose).__name__
        raise TypeError(f"{whose} must return a (4,4) tensor, got {got}; torch.as_tensor(...) makes one")
    if pose.shape != (4, 4):
        raise ValueError(f"{whose} must return a (4,4) tensor, got {tuple(pose.shape)}")
    return pose.float()


def checked(poses: Tensor) -> Tensor:
    """Poses as they are.

    Raises:
        ValueError: they are not finite, or end in another row than a rigid transform; on a GPU all go.
    """
    if not waits(poses):
        if not poses.isfinite().all():
            raise ValueError("poses of instances must be finite; see what their functions return at this time")
        last = poses[..., 3, :].reshape(-1, 4)
        if not torch.equal(last, last.new_tensor([0.0, 0.0, 0.0, 1.0]).expand_as(last)):
            raise ValueError("poses of instances must end in the row (0, 0, 0, 1): position goes in the last column")
    return poses


def inverse(poses: Tensor) -> Tensor:
    """``(..., 3, 4)``: the upper rows of the inverse of ``(..., 4, 4)``, far cheaper than that of a general matrix."""
    turned = poses[..., :3, :3].transpose(-1, -2)
    turned = turned / turned.square().sum(dim=-1, keepdim=True).clamp_min(1e-30)
    return torch.cat([turned, -(turned @ poses[..., :3, 3:])], dim=-1)


def known_still(then: Tensor, now: Tensor) -> bool:
    """Whether no instance has moved from poses ``then`` to ``now``, as far as this is known without waiting for it."""
    return not len(now) or (not waits(now) and torch.equal(then, now))


def between(then: Tensor, now: Tensor) -> Tensor:
    """``(I + 1, 3, 4)`` float32: points on the world and each instance, from poses ``then`` to where they are ``now``.

    The world, row 0, stands still.
    """
    carried = now.double()[:, :3, :3] @ inverse(then.double())
    carried[..., 3] += now.double()[:, :3, 3]
    return torch.cat([torch.eye(3, 4, dtype=carried.dtype, device=carried.device)[None], carried]).float()
