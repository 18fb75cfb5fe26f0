"""The three traversals of voxels as torch operators: kernels on the CPU and on CUDA, the torch reference elsewhere.

They share these arguments:
    rays: origins and directions, ``(N, 3)`` float32 world space, ordered by the B batch elements, with t in units of
        the direction's length; spans, ``(N, 2)`` float32, t at which each ray begins and ends; and transforms,
        ``(B, I + 1, 4, 4)`` float64, grid from world, where a grid counts voxels from its index's corner; the fourth
        row is the centre and the radius, in world space, of a sphere around the voxels.
    grids: bricks, index, entries and media; see `tracer.scene.grids.Grids`.
    mask: which entries rays can hit.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from tracer.traversal import reference


@operator("tracer::surface")
def surface(rays: Sequence[Tensor], grids: Sequence[Tensor], left: Tensor, mask: int) -> tuple[Tensor, Tensor]:
    """The nearest place where the medium along a ray changes.

    A ray that begins in something opaque first leaves it, which is no surface. ``left`` is ``(N, 5)`` int32, or has
    no rows: a material, an entry and a voxel in which the ray is; leaving that material into air is no surface.

    Returns:
        ``(N, 4)`` float32: t (inf on a miss) and the place in voxel coordinates of its grid; and ``(N, 7)`` int32:
        material, entry (-1 on a miss), face (2 x axis, + 1 where the ray falls along it), whether it is the back of the
        medium that the ray leaves, and the voxel.
    """
    if _form(rays, grids) is Form.REFERENCE:
        return reference.surface(rays, grids, left, mask)
    from tracer.traversal import drivers

    return drivers.surface(rays, grids, left, mask)


@operator("tracer::transmit")
def transmit(rays: Sequence[Tensor], grids: Sequence[Tensor], mask: int) -> Tensor:
    """``(N, 3)`` float32: the share of light that is transmitted; 0 behind anything opaque."""
    if _form(rays, grids) is Form.REFERENCE:
        return reference.transmit(rays, grids, mask)
    from tracer.traversal import drivers

    return drivers.transmit(rays, grids, mask)


@operator("tracer::runs")
def runs(rays: Sequence[Tensor], grids: Sequence[Tensor], starts: Tensor) -> Tensor:
    """Length of a ray inside the solid whose surface it hit.

    ``starts`` is ``(N, 5)`` int32: material, entry (-1 for none) and voxel at the beginning of the span.

    Returns:
        ``(N, 2)`` float32, in t: through voxels that are not air, and through the first ones of the same material.
    """
    if _form(rays, grids) is Form.REFERENCE:
        return reference.runs(rays, grids, starts)
    from tracer.traversal import drivers

    return drivers.runs(rays, grids, starts)


@surface.register_fake
def _(rays: Sequence[Tensor], grids: Sequence[Tensor], left: Tensor, mask: int) -> tuple[Tensor, Tensor]:
    count = rays[0].shape[0]
    return left.new_empty(count, 4, dtype=torch.float32), left.new_empty(count, 7, dtype=torch.int32)


@transmit.register_fake
def _(rays: Sequence[Tensor], grids: Sequence[Tensor], mask: int) -> Tensor:
    return rays[0].new_empty(rays[0].shape[0], 3, dtype=torch.float32)


@runs.register_fake
def _(rays: Sequence[Tensor], grids: Sequence[Tensor], starts: Tensor) -> Tensor:
    return starts.new_empty(starts.shape[0], 2, dtype=torch.float32)


def _form(rays: Sequence[Tensor], grids: Sequence[Tensor]) -> Form:
    return form_of(*rays[:3], *grids, cuda=True)
