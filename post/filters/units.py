"""Mean directions made unit vectors again, as a torch operator: kernels on the CPU and on CUDA, else the torch
reference."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.directions import length
from post.filters.constants import SHORTEST


@operator("gbufrt::unit_vectors")
def unit_cpu(vector: Tensor, fallback: Tensor) -> Tensor:
    """See `unit_vectors`."""
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import unit_rows
    from post.filters.pixel_drivers import unit_each

    out = torch.empty_like(vector, memory_format=torch.contiguous_format)
    if form_of(out, cuda=True) is Form.CUDA:
        unit_each(out[:, 0].numel(), out, vector, fallback)
    else:
        unit_rows(array(out), array(vector), array(fallback), threads())
    return out


@unit_cpu.register_fake
def _(vector, fallback):
    return torch.empty_like(vector, memory_format=torch.contiguous_format)


def unit_vectors(vector: Tensor, fallback: Tensor, *, compiled: bool | None = None) -> Tensor:
    """Vectors ``(B, 3, H, W)`` over their length; where they cancelled, and have no direction, the ``fallback``.

    Args:
        vector: of any length.
        fallback: as ``vector``.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        As ``vector``.
    """
    if form_of(vector, fallback, compiled=compiled, cuda=True) is not Form.REFERENCE:
        return unit_cpu(vector, fallback)
    size = length(vector)
    return torch.where(size > SHORTEST, vector / size.clamp_min(SHORTEST), fallback)
