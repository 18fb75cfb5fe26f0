"""Straight paths along the arcs of what spins as a torch operator: kernels on the CPU and CUDA, else torch."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.lens.arc_reference import turned_reference


@operator("gbufrt::turn_motion")
def turned_cpu(motion: Tensor) -> Tensor:
    """``(B, 2, H, W)``. See `turned`."""
    from gbufrt.compute.kernel import array, threads
    from post.lens.arc_kernel import turn_each, turn_rows

    out = torch.empty_like(motion, memory_format=torch.contiguous_format)
    if form_of(motion, cuda=True) is Form.CUDA:
        turn_each(out[:, 0].numel(), out, motion)
    else:
        turn_rows(array(out), array(motion), threads())
    return out


@turned_cpu.register_fake
def _(motion):
    return torch.empty_like(motion, memory_format=torch.contiguous_format)


def turned(motion: Tensor, *, compiled: bool | None = None) -> Tensor:
    """Motion that leads straight along the arcs of what spins before the camera, a wheel or all of a rolling picture.

    Motion is the chord of a whole frame, so half the angle of a frame off where a pixel goes now. How motion changes
    from pixel to pixel tells the angle; what is sheared more than it turns, as ground under a camera that glides past,
    goes straight.

    Args:
        motion: ``(B, 2, H, W)`` previous minus current, pixels.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 2, H, W)``.

    Source: our own; the antisymmetric part of the motion's gradient is the sine of the angle.
    """
    if form_of(motion, compiled=compiled, cuda=True) is Form.REFERENCE:
        return turned_reference(motion)
    return turned_cpu(motion)
