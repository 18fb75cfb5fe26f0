"""Screen-space rays as a torch operator: the kernel on the CPU, the torch reference elsewhere."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.march.reference import march_rays_reference


@operator("gbufrt::march_rays")
def march_rays_cpu(
    planes: Tensor,
    pyramid: Tensor,
    table: Tensor,
    lens: Tensor,
    origins: Tensor,
    directions: Tensor,
    near: float,
    orthographic: bool,
    distance: float,
    steps: int,
) -> Tensor:
    """``(B, 5, h, w)`` float32: px x, px y, distance, agreement, status. Inputs as `post.march.rays` lays them out."""
    from post.march.drivers import march_each

    origins, directions, size = origins.flatten(2), directions.flatten(2), origins.shape[2:]
    out = origins.new_empty((len(origins), 5, origins.shape[2]), dtype=torch.float32)
    inputs = (planes, pyramid, table, lens, origins, directions)
    march_each(len(origins) * origins.shape[2], out, *inputs, near, orthographic, distance, steps)
    return out.unflatten(2, size)


@march_rays_cpu.register_fake
def _(planes, pyramid, table, lens, origins, directions, near, orthographic, distance, steps):
    return origins.new_empty((origins.shape[0], 5, *origins.shape[2:]), dtype=torch.float32)


def march(
    planes: Tensor,
    pyramid: Tensor,
    table: Tensor,
    lens: Tensor,
    origins: Tensor,
    directions: Tensor,
    near: float,
    orthographic: bool,
    distance: float,
    steps: int,
    *,
    compiled: bool | None,
) -> Tensor:
    """Either form of `march_rays_cpu`; see `gbufrt.compute.dispatch.form_of` for ``compiled``."""
    form = form_of(planes, pyramid, origins, directions, compiled=compiled, cuda=True)
    run = march_rays_reference if form is Form.REFERENCE else march_rays_cpu
    return run(planes, pyramid, table, lens, origins, directions, near, orthographic, distance, steps)
