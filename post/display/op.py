"""Tone curves as torch operators: kernels for AgX on the CPU and on CUDA, the torch reference elsewhere."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from post.display.constants import AGX_INSET
from post.display.reference import Operator, matrix, tone_reference


@torch.library.custom_op("gbufrt::agx", mutates_args=())
def agx_cpu(color: Tensor, exposure: Tensor, contrast: float, saturation: float) -> Tensor:
    """``(B, 3, H, W)``. See `tone_curve`; ``exposure`` is ``(B,)``."""
    from gbufrt.compute.kernel import array, threads
    from post.display.drivers import agx_each, agx_rows

    out, inset = torch.empty_like(color, memory_format=torch.contiguous_format), matrix(AGX_INSET, color)
    matrices = inset, torch.linalg.inv_ex(inset).inverse
    if form_of(color, cuda=True) is Form.CUDA:
        agx_each(out[:, 0].numel(), out, color, exposure, contrast, saturation, *matrices)
    else:
        pictures = (array(t) for t in (out, color, exposure))
        agx_rows(*pictures, contrast, saturation, *map(array, matrices), threads())
    return out


@agx_cpu.register_fake
def _(color, exposure, contrast, saturation):
    return torch.empty_like(color, memory_format=torch.contiguous_format)


def tone_curve(
    color: Tensor,
    exposure: Tensor,
    operator: Operator,
    contrast: float,
    saturation: float,
    white: float,
    *,
    compiled: bool | None = None,
) -> Tensor:
    """Compress scene light into what a display can show.

    Args:
        color: ``(B, 3, H, W)`` linear.
        exposure: factor on ``color``, of one element or ``(B, 1, 1, 1)``.
        operator: see `post.tone_map`, as the rest.
        contrast: see ``operator``.
        saturation: see ``operator``.
        white: see ``operator``.
        compiled: see `gbufrt.compute.dispatch.form_of`; only AgX has a compiled form.

    Returns:
        ``(B, 3, H, W)`` display-linear in [0, 1].
    """
    form = form_of(color, exposure, contrast, saturation, compiled=compiled, cuda=True)
    if form is Form.REFERENCE or operator != "agx" or exposure.numel() not in (1, color.shape[0]):
        return tone_reference(color, exposure, operator, contrast, saturation, white)
    return agx_cpu(color, exposure.flatten().expand(color.shape[0]), float(contrast), float(saturation))
