"""Poses of instances, ``(I, 4, 4)``: rigid up to a scale, world from model."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.resident import waits


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
