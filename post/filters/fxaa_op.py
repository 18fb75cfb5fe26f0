"""Anti-aliasing by luma edges as a torch operator: kernels on the CPU and CUDA, else the torch reference."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.filters.fxaa_reference import stairs_reference


@operator("gbufrt::smooth_stairs")
def stairs_cpu(image: Tensor, subpixel: float, edge_threshold: float, dark_threshold: float) -> Tensor:
    """``(B, 3, H, W)``. See `smooth_stairs`."""
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import stairs_rows
    from post.filters.pixel_drivers import luma_each, stairs_each

    out = torch.empty_like(image, memory_format=torch.contiguous_format)
    luma = image.new_empty(image.shape[0], image.shape[2], image.shape[3] + 2)
    options = (subpixel, edge_threshold, dark_threshold)
    if form_of(image, cuda=True) is Form.CUDA:
        luma_each(luma.numel(), luma, image)
        stairs_each(image[:, 0].numel(), out, luma, image, *options)
    else:
        stairs_rows(array(out), array(luma), array(image), *options, threads())
    return out


@stairs_cpu.register_fake
def _(image, subpixel, edge_threshold, dark_threshold):
    return torch.empty_like(image, memory_format=torch.contiguous_format)


def smooth_stairs(
    image: Tensor, *, subpixel: float, edge_threshold: float, dark_threshold: float, compiled: bool | None = None
) -> Tensor:
    """Anti-alias a finished picture by its own luma edges.

    Args:
        image: ``(B, 3, H, W)`` display-referred and encoded, in [0, 1].
        subpixel: see `post.fxaa`, as the rest.
        edge_threshold: see ``subpixel``.
        dark_threshold: see ``subpixel``.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 3, H, W)``; pixels without an edge are exactly as they were.
    """
    tunables = (subpixel, edge_threshold, dark_threshold)
    if form_of(image, *tunables, compiled=compiled, cuda=True) is Form.REFERENCE:
        return stairs_reference(image, *tunables)
    return stairs_cpu(image, *map(float, tunables))
